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
        settings=sections("paper2021", "validation"),
        parts=lambda wc: CORES.parts(wc.scale),
        code=code("pit_values"),
    message:
        "validation: {wildcards.setting}, T = {wildcards.samples}, part {wildcards.part} ({wildcards.scale})"
    script:
        "../scripts/pit_values.py"


ALL_PIT_VALUES = {
    "pit_values": lambda wc: expand(PIT_VALUES, scale=wc.scale, part=range(CORES.parts(wc.scale)))
}
draw(
    "uncertainty.figure_validation_ranks",
    "figure: validation, ranks ({wildcards.scale})",
    ALL_PIT_VALUES,
    category="Validation",
    settings=sections("paper2021", "validation"),
)
draw(
    "uncertainty.table_validation_coverage",
    "table: validation, coverage ({wildcards.scale})",
    ALL_PIT_VALUES,
    settings=sections("paper2021", "validation"),
)
