# Only `snakemake validate` asks for these: are the uncertainties right?
VALIDATED = resting_on("studies/calibrated.py", "studies/joint.py", "config.py", "provenance.py")
LEVELS = [
    f"results/{{scale}}/validation/levels_{name}_T{samples}_{{part}}.csv"
    for name, chosen in config["validation"]["settings"].items()
    for samples in chosen["samples"]
]
VALIDATION_DRAWING = resting_on(
    "figures/validation.py", "figures/notes.py", "figures/imuarray.mplstyle"
)


rule calibrated_levels:
    input:
        code=VALIDATED,
    output:
        "results/{scale}/validation/levels_{setting}_T{samples}_{part}.csv",
    log:
        "results/{scale}/logs/validation/levels_{setting}_T{samples}_{part}.log",
    benchmark:
        "results/{scale}/benchmarks/validation/levels_{setting}_T{samples}_{part}.tsv"
    threads: lambda wc: CREW.threads(wc.scale)
    resources:
        mem_mb=3000,
        runtime=240,
    params:
        settings=lambda wc: effective(
            config, wc.scale, "paper2021", "validation", own="validation_"
        ),
        parts=lambda wc: CREW.parts(wc.scale),
    script:
        "../scripts/calibrated_levels.py"


rule joint_test:
    input:
        code=VALIDATED,
    output:
        "results/{scale}/validation/joint.csv",
    log:
        "results/{scale}/logs/validation/joint.log",
    benchmark:
        "results/{scale}/benchmarks/validation/joint.tsv"
    threads: 1
    resources:
        mem_mb=3000,
        runtime=120,
    params:
        settings=lambda wc: effective(
            config, wc.scale, "paper2021", "validation", own="validation_"
        ),
    script:
        "../scripts/joint_test.py"


rule figure_validation_ranks:
    input:
        levels=lambda wc: expand(LEVELS, scale=wc.scale, part=range(CREW.parts(wc.scale))),
        code=VALIDATION_DRAWING,
    output:
        pdf="results/{scale}/figures/validation_ranks.pdf",
        png=report(
            "results/{scale}/figures/validation_ranks.png",
            caption="../report/validation_ranks.rst",
            category="Validation",
        ),
        csv="results/{scale}/figures/validation_ranks.csv",
    log:
        "results/{scale}/logs/figures/validation_ranks.log",
    benchmark:
        "results/{scale}/benchmarks/figures/validation_ranks.tsv"
    threads: 1
    resources:
        mem_mb=3000,
        runtime=10,
    params:
        settings=lambda wc: effective(
            config, wc.scale, "paper2021", "validation", own="validation_"
        ),
    script:
        "../scripts/figure_validation_ranks.py"


rule table_validation_coverage:
    input:
        levels=lambda wc: expand(LEVELS, scale=wc.scale, part=range(CREW.parts(wc.scale))),
        code=[*VALIDATED, *VALIDATION_DRAWING],
    output:
        csv="results/{scale}/tables/validation_coverage.csv",
        tex="results/{scale}/tables/validation_coverage.tex",
        md="results/{scale}/tables/validation_coverage.md",
    log:
        "results/{scale}/logs/tables/validation_coverage.log",
    benchmark:
        "results/{scale}/benchmarks/tables/validation_coverage.tsv"
    threads: 1
    resources:
        mem_mb=3000,
        runtime=10,
    params:
        settings=lambda wc: effective(
            config, wc.scale, "paper2021", "validation", own="validation_"
        ),
    script:
        "../scripts/table_validation_coverage.py"


rule table_validation_joint:
    input:
        rows="results/{scale}/validation/joint.csv",
        code=VALIDATION_DRAWING,
    output:
        csv="results/{scale}/tables/validation_joint.csv",
        tex="results/{scale}/tables/validation_joint.tex",
        md="results/{scale}/tables/validation_joint.md",
    log:
        "results/{scale}/logs/tables/validation_joint.log",
    benchmark:
        "results/{scale}/benchmarks/tables/validation_joint.tsv"
    threads: 1
    resources:
        mem_mb=3000,
        runtime=10,
    params:
        settings=lambda wc: effective(
            config, wc.scale, "paper2021", "validation", own="validation_"
        ),
    script:
        "../scripts/table_validation_joint.py"
