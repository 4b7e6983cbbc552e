# By what is imported: no page or drawing of the diagnosis, and no grading, runs a diagnosis again.
DIAGNOSING = resting_on(
    "diagnosis/document.py", "blind/study.py", "provenance.py"
)
GRADING = resting_on("blind/grade.py", "blind/summary.py", "provenance.py")
BLIND_DRAWING = resting_on("figures/blind.py", "figures/notes.py", "figures/imuarray.mplstyle")
BLIND_TABLES = resting_on("figures/blind_tables.py", "blind/criteria.py")


rule blind_diagnose:
    input:
        code=DIAGNOSING,
    output:
        "results/blind/{scale}/diagnoses/{batch}.json",
    log:
        "results/blind/{scale}/logs/diagnoses/{batch}.log",
    benchmark:
        "results/blind/{scale}/benchmarks/diagnoses/{batch}.tsv"
    threads: 1
    resources:
        mem_mb=4000,
        runtime=120,
    params:
        settings=lambda wc: blind_settings(config, wc.scale),
        batches=lambda wc: config["scales"][wc.scale]["blind_batches"],
    script:
        "../scripts/blind_diagnose.py"


rule blind_grade:
    input:
        batches=lambda wc: expand(
            "results/blind/{{scale}}/diagnoses/{batch}.json",
            batch=range(config["scales"][wc.scale]["blind_batches"]),
        ),
        code=GRADING,
    output:
        rows="results/blind/{scale}/graded.json",
        table="results/blind/{scale}/graded.csv",
    log:
        "results/blind/{scale}/logs/graded.log",
    benchmark:
        "results/blind/{scale}/benchmarks/graded.tsv"
    threads: 1
    resources:
        mem_mb=4000,
        runtime=20,
    params:
        settings=lambda wc: blind_settings(config, wc.scale),
    script:
        "../scripts/blind_grade.py"


rule figure_blind_detection:
    input:
        rows="results/blind/{scale}/graded.json",
        code=BLIND_DRAWING,
    output:
        pdf="results/blind/{scale}/figures/blind_detection_{against}.pdf",
        png=report(
            "results/blind/{scale}/figures/blind_detection_{against}.png",
            caption="../report/blind_detection.rst",
            category="Blind study",
        ),
        csv="results/blind/{scale}/figures/blind_detection_{against}.csv",
    log:
        "results/blind/{scale}/logs/figures/blind_detection_{against}.log",
    benchmark:
        "results/blind/{scale}/benchmarks/figures/blind_detection_{against}.tsv"
    wildcard_constraints:
        against="sigma|amplitude",
    threads: 1
    resources:
        mem_mb=2000,
        runtime=10,
    params:
        settings=lambda wc: blind_settings(config, wc.scale),
        against=lambda wc: wc.against,
    script:
        "../scripts/figure_blind_detection.py"


rule figure_blind_confusion:
    input:
        rows="results/blind/{scale}/graded.json",
        code=BLIND_DRAWING,
    output:
        pdf="results/blind/{scale}/figures/blind_confusion.pdf",
        png=report(
            "results/blind/{scale}/figures/blind_confusion.png",
            caption="../report/blind_confusion.rst",
            category="Blind study",
        ),
        csv="results/blind/{scale}/figures/blind_confusion.csv",
    log:
        "results/blind/{scale}/logs/figures/blind_confusion.log",
    benchmark:
        "results/blind/{scale}/benchmarks/figures/blind_confusion.tsv"
    threads: 1
    resources:
        mem_mb=2000,
        runtime=10,
    params:
        settings=lambda wc: blind_settings(config, wc.scale),
    script:
        "../scripts/figure_blind_confusion.py"


rule table_blind_bars:
    input:
        rows="results/blind/{scale}/graded.json",
        code=BLIND_TABLES,
    output:
        csv=report(
            "results/blind/{scale}/tables/blind_bars.csv",
            caption="../report/blind_bars.rst",
            category="Blind study",
        ),
        tex="results/blind/{scale}/tables/blind_bars.tex",
        md="results/blind/{scale}/tables/blind_bars.md",
    log:
        "results/blind/{scale}/logs/tables/blind_bars.log",
    benchmark:
        "results/blind/{scale}/benchmarks/tables/blind_bars.tsv"
    threads: 1
    resources:
        mem_mb=2000,
        runtime=10,
    params:
        settings=lambda wc: blind_settings(config, wc.scale),
    script:
        "../scripts/table_blind_bars.py"


rule table_blind_gain:
    input:
        rows="results/blind/{scale}/graded.json",
        code=BLIND_TABLES,
    output:
        csv=report(
            "results/blind/{scale}/tables/blind_gain.csv",
            caption="../report/blind_gain.rst",
            category="Blind study",
        ),
        tex="results/blind/{scale}/tables/blind_gain.tex",
        md="results/blind/{scale}/tables/blind_gain.md",
    log:
        "results/blind/{scale}/logs/tables/blind_gain.log",
    benchmark:
        "results/blind/{scale}/benchmarks/tables/blind_gain.tsv"
    threads: 1
    resources:
        mem_mb=2000,
        runtime=10,
    params:
        settings=lambda wc: blind_settings(config, wc.scale),
    script:
        "../scripts/table_blind_gain.py"
