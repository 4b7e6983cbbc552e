# Only `snakemake theory` asks for these: the Cramer-Rao bound and what follows from it.


rule bound_efficiency:
    output:
        "results/{scale}/theory/efficiency.csv",
    log:
        "results/{scale}/logs/theory/efficiency.log",
    benchmark:
        "results/{scale}/benchmarks/theory/efficiency.tsv"
    threads: lambda wc: CORES.threads(wc.scale)
    resources:
        mem_mb=3000,
        runtime=60,
    params:
        settings=sections("paper2017", "theory"),
        code=code("bound_efficiency"),
    message:
        "theory: efficiency ({wildcards.scale})"
    script:
        "../scripts/bound_efficiency.py"


rule bound_convergence:
    output:
        "results/{scale}/theory/convergence.csv",
    log:
        "results/{scale}/logs/theory/convergence.log",
    benchmark:
        "results/{scale}/benchmarks/theory/convergence.tsv"
    threads: lambda wc: CORES.threads(wc.scale)
    resources:
        mem_mb=3000,
        runtime=60,
    params:
        settings=sections("paper2017", "theory"),
        code=code("bound_convergence"),
    message:
        "theory: convergence ({wildcards.scale})"
    script:
        "../scripts/bound_convergence.py"


rule bound_size:
    output:
        "results/{scale}/theory/size.csv",
    log:
        "results/{scale}/logs/theory/size.log",
    benchmark:
        "results/{scale}/benchmarks/theory/size.tsv"
    resources:
        mem_mb=3000,
        runtime=60,
    params:
        settings=sections("paper2017", "theory"),
        code=code("bound_size"),
    message:
        "theory: size of the array ({wildcards.scale})"
    script:
        "../scripts/bound_size.py"


rule bound_ranks:
    output:
        "results/{scale}/theory/ranks.csv",
    log:
        "results/{scale}/logs/theory/ranks.log",
    benchmark:
        "results/{scale}/benchmarks/theory/ranks.tsv"
    resources:
        mem_mb=3000,
        runtime=60,
    params:
        settings=sections("paper2017", "paper2021", "theory"),
        code=code("bound_ranks"),
    message:
        "theory: ranks ({wildcards.scale})"
    script:
        "../scripts/bound_ranks.py"


draw(
    "uncertainty.figure_theory_efficiency",
    "figure: theory, efficiency ({wildcards.scale})",
    {"rows": "results/{scale}/theory/efficiency.csv"},
    category="Estimation theory",
    settings=sections("paper2017", "theory"),
)
draw(
    "uncertainty.figure_theory_convergence",
    "figure: theory, convergence ({wildcards.scale})",
    {"rows": "results/{scale}/theory/convergence.csv"},
    category="Estimation theory",
    settings=sections("paper2017", "theory"),
)
draw(
    "uncertainty.figure_theory_size",
    "figure: theory, size of the array ({wildcards.scale})",
    {"rows": "results/{scale}/theory/size.csv"},
    category="Estimation theory",
    settings=sections("paper2017", "theory"),
)
draw(
    "uncertainty.table_theory_ranks",
    "table: theory, ranks ({wildcards.scale})",
    {"rows": "results/{scale}/theory/ranks.csv"},
    settings=sections("paper2017", "theory"),
)
