rule blind_diagnose:
    output:
        "results/blind/{scale}/diagnoses/{batch}.json",
    log:
        "results/blind/{scale}/logs/diagnoses/{batch}.log",
    benchmark:
        "results/blind/{scale}/benchmarks/diagnoses/{batch}.tsv"
    resources:
        mem_mb=4000,
        runtime=120,
    params:
        settings=lambda wc: blind_settings(config, wc.scale),
        batches=lambda wc: config["scales"][wc.scale]["blind_batches"],
        code=code("blind_diagnose"),
    message:
        "blind study: diagnoses, batch {wildcards.batch} ({wildcards.scale})"
    script:
        "../scripts/blind_diagnose.py"


rule blind_grade:
    input:
        batches=lambda wc: expand(
            "results/blind/{{scale}}/diagnoses/{batch}.json",
            batch=range(config["scales"][wc.scale]["blind_batches"]),
        ),
    output:
        rows="results/blind/{scale}/graded.json",
        table="results/blind/{scale}/graded.csv",
    log:
        "results/blind/{scale}/logs/graded.log",
    benchmark:
        "results/blind/{scale}/benchmarks/graded.tsv"
    resources:
        mem_mb=4000,
    params:
        settings=lambda wc: blind_settings(config, wc.scale),
        code=code("blind_grade"),
    message:
        "blind study: grades ({wildcards.scale})"
    script:
        "../scripts/blind_grade.py"


GRADED = {"rows": "results/blind/{scale}/graded.json"}
BLIND = {
    "folder": "results/blind/{scale}",
    "category": "Blind study",
    "settings": lambda wc: blind_settings(config, wc.scale),
}
draw(
    "blind.figure_blind_confusion",
    "figure: blind study, confusion ({wildcards.scale})",
    GRADED,
    **BLIND,
)
draw(
    "blind.table_blind_bars",
    "table: blind study, acceptance criteria ({wildcards.scale})",
    GRADED,
    **BLIND,
)
