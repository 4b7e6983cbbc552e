# Only `snakemake theory` asks for these: the Cramer-Rao bound and what follows from it.
BOUND = resting_on("studies/bound.py", "studies/settings2017.py", "provenance.py")
THEORY_DRAWING = resting_on("figures/theory.py", "figures/notes.py", "figures/imuarray.mplstyle")


rule bound_efficiency:
    input:
        code=BOUND,
    output:
        "results/{scale}/theory/efficiency.csv",
    log:
        "results/{scale}/logs/theory/efficiency.log",
    benchmark:
        "results/{scale}/benchmarks/theory/efficiency.tsv"
    threads: lambda wc: CREW.threads(wc.scale)
    resources:
        mem_mb=3000,
        runtime=60,
    params:
        settings=lambda wc: effective(config, wc.scale, "paper2017", "theory", own="theory_"),
    script:
        "../scripts/bound_efficiency.py"


rule bound_convergence:
    input:
        code=BOUND,
    output:
        "results/{scale}/theory/convergence.csv",
    log:
        "results/{scale}/logs/theory/convergence.log",
    benchmark:
        "results/{scale}/benchmarks/theory/convergence.tsv"
    threads: lambda wc: CREW.threads(wc.scale)
    resources:
        mem_mb=3000,
        runtime=60,
    params:
        settings=lambda wc: effective(config, wc.scale, "paper2017", "theory", own="theory_"),
    script:
        "../scripts/bound_convergence.py"


rule bound_size:
    input:
        code=BOUND,
    output:
        "results/{scale}/theory/size.csv",
    log:
        "results/{scale}/logs/theory/size.log",
    benchmark:
        "results/{scale}/benchmarks/theory/size.tsv"
    threads: 1
    resources:
        mem_mb=3000,
        runtime=60,
    params:
        settings=lambda wc: effective(config, wc.scale, "paper2017", "theory", own="theory_"),
    script:
        "../scripts/bound_size.py"


rule bound_ranks:
    input:
        code=BOUND,
    output:
        "results/{scale}/theory/ranks.csv",
    log:
        "results/{scale}/logs/theory/ranks.log",
    benchmark:
        "results/{scale}/benchmarks/theory/ranks.tsv"
    threads: 1
    resources:
        mem_mb=3000,
        runtime=60,
    params:
        settings=lambda wc: effective(
            config, wc.scale, "paper2017", "paper2021", "theory", own="theory_"
        ),
    script:
        "../scripts/bound_ranks.py"


rule figure_theory_efficiency:
    input:
        rows="results/{scale}/theory/efficiency.csv",
        code=THEORY_DRAWING,
    output:
        pdf="results/{scale}/figures/theory_efficiency.pdf",
        png=report(
            "results/{scale}/figures/theory_efficiency.png",
            caption="../report/theory_efficiency.rst",
            category="Estimation theory",
        ),
        csv="results/{scale}/figures/theory_efficiency.csv",
    log:
        "results/{scale}/logs/figures/theory_efficiency.log",
    benchmark:
        "results/{scale}/benchmarks/figures/theory_efficiency.tsv"
    threads: 1
    resources:
        mem_mb=3000,
        runtime=10,
    params:
        settings=lambda wc: effective(config, wc.scale, "paper2017", "theory", own="theory_"),
    script:
        "../scripts/figure_theory_efficiency.py"


rule figure_theory_convergence:
    input:
        rows="results/{scale}/theory/convergence.csv",
        code=THEORY_DRAWING,
    output:
        pdf="results/{scale}/figures/theory_convergence.pdf",
        png=report(
            "results/{scale}/figures/theory_convergence.png",
            caption="../report/theory_convergence.rst",
            category="Estimation theory",
        ),
        csv="results/{scale}/figures/theory_convergence.csv",
    log:
        "results/{scale}/logs/figures/theory_convergence.log",
    benchmark:
        "results/{scale}/benchmarks/figures/theory_convergence.tsv"
    threads: 1
    resources:
        mem_mb=3000,
        runtime=10,
    params:
        settings=lambda wc: effective(config, wc.scale, "paper2017", "theory", own="theory_"),
    script:
        "../scripts/figure_theory_convergence.py"


rule figure_theory_size:
    input:
        rows="results/{scale}/theory/size.csv",
        code=THEORY_DRAWING,
    output:
        pdf="results/{scale}/figures/theory_size.pdf",
        png=report(
            "results/{scale}/figures/theory_size.png",
            caption="../report/theory_size.rst",
            category="Estimation theory",
        ),
        csv="results/{scale}/figures/theory_size.csv",
    log:
        "results/{scale}/logs/figures/theory_size.log",
    benchmark:
        "results/{scale}/benchmarks/figures/theory_size.tsv"
    threads: 1
    resources:
        mem_mb=3000,
        runtime=10,
    params:
        settings=lambda wc: effective(config, wc.scale, "paper2017", "theory", own="theory_"),
    script:
        "../scripts/figure_theory_size.py"


rule table_theory_ranks:
    input:
        rows="results/{scale}/theory/ranks.csv",
        code=THEORY_DRAWING,
    output:
        csv="results/{scale}/tables/theory_ranks.csv",
        tex="results/{scale}/tables/theory_ranks.tex",
        md="results/{scale}/tables/theory_ranks.md",
    log:
        "results/{scale}/logs/tables/theory_ranks.log",
    benchmark:
        "results/{scale}/benchmarks/tables/theory_ranks.tsv"
    threads: 1
    resources:
        mem_mb=3000,
        runtime=10,
    params:
        settings=lambda wc: effective(config, wc.scale, "paper2017", "theory", own="theory_"),
    script:
        "../scripts/table_theory_ranks.py"
