# Only `snakemake theory` asks for these: the Cramer-Rao bound and what follows from it.


for each, name, about in (
    ("bound_efficiency", "efficiency", "efficiency"),
    ("bound_convergence", "convergence", "convergence"),
    ("bound_size", "size", "size of the array"),
    ("bound_ranks", "ranks", "ranks"),
):

    rule:
        name:
            each
        output:
            f"results/{{scale}}/theory/{name}.csv",
        log:
            f"results/{{scale}}/logs/theory/{name}.log",
        benchmark:
            f"results/{{scale}}/benchmarks/theory/{name}.tsv"
        threads: lambda wc: CORES.threads(wc.scale)
        resources:
            mem_mb=3000,
            runtime=60,
        params:
            settings=sections("paper2017", "paper2021", "theory"),
            table=name,
            code=code("bound"),
        message:
            f"theory: {about} ({{wildcards.scale}})"
        script:
            "../scripts/bound.py"


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
