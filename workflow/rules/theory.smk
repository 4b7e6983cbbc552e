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
        settings=lambda wc: effective(config, wc.scale, "paper2017", "theory"),
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
        settings=lambda wc: effective(config, wc.scale, "paper2017", "theory"),
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
        settings=lambda wc: effective(config, wc.scale, "paper2017", "theory"),
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
        settings=lambda wc: effective(config, wc.scale, "paper2017", "paper2021", "theory"),
        code=code("bound_ranks"),
    message:
        "theory: ranks ({wildcards.scale})"
    script:
        "../scripts/bound_ranks.py"


rule figure_theory_efficiency:
    input:
        rows="results/{scale}/theory/efficiency.csv",
    output:
        **figure("theory_efficiency", "Estimation theory"),
    log:
        "results/{scale}/logs/figures/theory_efficiency.log",
    benchmark:
        "results/{scale}/benchmarks/figures/theory_efficiency.tsv"
    resources:
        mem_mb=3000,
    params:
        **by("figures.uncertainty.figure_theory_efficiency"),
        settings=lambda wc: effective(config, wc.scale, "paper2017", "theory"),
    message:
        "figure: theory, efficiency ({wildcards.scale})"
    script:
        "../scripts/publish.py"


rule figure_theory_convergence:
    input:
        rows="results/{scale}/theory/convergence.csv",
    output:
        **figure("theory_convergence", "Estimation theory"),
    log:
        "results/{scale}/logs/figures/theory_convergence.log",
    benchmark:
        "results/{scale}/benchmarks/figures/theory_convergence.tsv"
    resources:
        mem_mb=3000,
    params:
        **by("figures.uncertainty.figure_theory_convergence"),
        settings=lambda wc: effective(config, wc.scale, "paper2017", "theory"),
    message:
        "figure: theory, convergence ({wildcards.scale})"
    script:
        "../scripts/publish.py"


rule figure_theory_size:
    input:
        rows="results/{scale}/theory/size.csv",
    output:
        **figure("theory_size", "Estimation theory"),
    log:
        "results/{scale}/logs/figures/theory_size.log",
    benchmark:
        "results/{scale}/benchmarks/figures/theory_size.tsv"
    resources:
        mem_mb=3000,
    params:
        **by("figures.uncertainty.figure_theory_size"),
        settings=lambda wc: effective(config, wc.scale, "paper2017", "theory"),
    message:
        "figure: theory, size of the array ({wildcards.scale})"
    script:
        "../scripts/publish.py"


rule table_theory_ranks:
    input:
        rows="results/{scale}/theory/ranks.csv",
    output:
        **table("theory_ranks"),
    log:
        "results/{scale}/logs/tables/theory_ranks.log",
    benchmark:
        "results/{scale}/benchmarks/tables/theory_ranks.tsv"
    resources:
        mem_mb=3000,
    params:
        **by("figures.uncertainty.table_theory_ranks"),
        settings=lambda wc: effective(config, wc.scale, "paper2017", "theory"),
    message:
        "table: theory, ranks ({wildcards.scale})"
    script:
        "../scripts/publish.py"
