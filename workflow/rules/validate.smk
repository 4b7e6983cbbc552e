# Only `snakemake validate` asks for these: are the uncertainties right?
PIT_VALUES = [
    f"results/{{scale}}/validation/pit_{name}_T{samples}_{{part}}.csv"
    for name, chosen in config["validation"]["settings"].items()
    for samples in chosen["samples"]
]


rule pit_values:
    output:
        "results/{scale}/validation/pit_{setting}_T{samples}_{part}.csv",
    log:
        "results/{scale}/logs/validation/pit_{setting}_T{samples}_{part}.log",
    benchmark:
        "results/{scale}/benchmarks/validation/pit_{setting}_T{samples}_{part}.tsv"
    threads: lambda wc: CORES.threads(wc.scale)
    resources:
        mem_mb=3000,
        runtime=240,
    params:
        settings=lambda wc: effective(config, wc.scale, "paper2021", "validation"),
        parts=lambda wc: CORES.parts(wc.scale),
        code=code("pit_values"),
    message:
        "validation: {wildcards.setting}, T = {wildcards.samples}, part {wildcards.part} ({wildcards.scale})"
    script:
        "../scripts/pit_values.py"


rule joint_test:
    output:
        "results/{scale}/validation/joint.csv",
    log:
        "results/{scale}/logs/validation/joint.log",
    benchmark:
        "results/{scale}/benchmarks/validation/joint.tsv"
    resources:
        mem_mb=3000,
        runtime=120,
    params:
        settings=lambda wc: effective(config, wc.scale, "paper2021", "validation"),
        code=code("joint_test"),
    message:
        "validation: joint distribution test ({wildcards.scale})"
    script:
        "../scripts/joint_test.py"


rule figure_validation_ranks:
    input:
        pit_values=lambda wc: expand(PIT_VALUES, scale=wc.scale, part=range(CORES.parts(wc.scale))),
    output:
        **figure("validation_ranks", "Validation"),
    log:
        "results/{scale}/logs/figures/validation_ranks.log",
    benchmark:
        "results/{scale}/benchmarks/figures/validation_ranks.tsv"
    resources:
        mem_mb=3000,
    params:
        **by("figures.uncertainty.figure_validation_ranks"),
        settings=lambda wc: effective(config, wc.scale, "paper2021", "validation"),
    message:
        "figure: validation, ranks ({wildcards.scale})"
    script:
        "../scripts/publish.py"


rule table_validation_coverage:
    input:
        pit_values=lambda wc: expand(PIT_VALUES, scale=wc.scale, part=range(CORES.parts(wc.scale))),
    output:
        **table("validation_coverage"),
    log:
        "results/{scale}/logs/tables/validation_coverage.log",
    benchmark:
        "results/{scale}/benchmarks/tables/validation_coverage.tsv"
    resources:
        mem_mb=3000,
    params:
        **by("figures.uncertainty.table_validation_coverage"),
        settings=lambda wc: effective(config, wc.scale, "paper2021", "validation"),
    message:
        "table: validation, coverage ({wildcards.scale})"
    script:
        "../scripts/publish.py"


rule table_validation_joint:
    input:
        rows="results/{scale}/validation/joint.csv",
    output:
        **table("validation_joint"),
    log:
        "results/{scale}/logs/tables/validation_joint.log",
    benchmark:
        "results/{scale}/benchmarks/tables/validation_joint.tsv"
    resources:
        mem_mb=3000,
    params:
        **by("figures.uncertainty.table_validation_joint"),
        settings=lambda wc: effective(config, wc.scale, "paper2021", "validation"),
    message:
        "table: validation, joint distribution test ({wildcards.scale})"
    script:
        "../scripts/publish.py"
