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


rule figure_blind_detection:
    input:
        rows="results/blind/{scale}/graded.json",
    output:
        **figure(
            "blind_detection_{against}",
            "Blind study",
            caption="blind_detection",
            folder="results/blind/{scale}",
        ),
    log:
        "results/blind/{scale}/logs/figures/blind_detection_{against}.log",
    benchmark:
        "results/blind/{scale}/benchmarks/figures/blind_detection_{against}.tsv"
    wildcard_constraints:
        against="sigma|amplitude",
    params:
        **by("figures.blind.figure_blind_detection"),
        settings=lambda wc: blind_settings(config, wc.scale),
        against=lambda wc: wc.against,
    message:
        "figure: blind study, detection over {wildcards.against} ({wildcards.scale})"
    script:
        "../scripts/publish.py"


rule figure_blind_confusion:
    input:
        rows="results/blind/{scale}/graded.json",
    output:
        **figure("blind_confusion", "Blind study", folder="results/blind/{scale}"),
    log:
        "results/blind/{scale}/logs/figures/blind_confusion.log",
    benchmark:
        "results/blind/{scale}/benchmarks/figures/blind_confusion.tsv"
    params:
        **by("figures.blind.figure_blind_confusion"),
        settings=lambda wc: blind_settings(config, wc.scale),
    message:
        "figure: blind study, confusion ({wildcards.scale})"
    script:
        "../scripts/publish.py"


rule table_blind_bars:
    input:
        rows="results/blind/{scale}/graded.json",
    output:
        **table("blind_bars", "Blind study", folder="results/blind/{scale}"),
    log:
        "results/blind/{scale}/logs/tables/blind_bars.log",
    benchmark:
        "results/blind/{scale}/benchmarks/tables/blind_bars.tsv"
    params:
        **by("figures.blind.table_blind_bars"),
        settings=lambda wc: blind_settings(config, wc.scale),
    message:
        "table: blind study, acceptance criteria ({wildcards.scale})"
    script:
        "../scripts/publish.py"


rule table_blind_gain:
    input:
        rows="results/blind/{scale}/graded.json",
    output:
        **table("blind_gain", "Blind study", folder="results/blind/{scale}"),
    log:
        "results/blind/{scale}/logs/tables/blind_gain.log",
    benchmark:
        "results/blind/{scale}/benchmarks/tables/blind_gain.tsv"
    params:
        **by("figures.blind.table_blind_gain"),
        settings=lambda wc: blind_settings(config, wc.scale),
    message:
        "table: blind study, gain ({wildcards.scale})"
    script:
        "../scripts/publish.py"
