from imuarray.figures.notes import SOURCES
from support import PACKAGE

DRAWING = [*library("figures"), str(PACKAGE / "figures" / "imuarray.mplstyle")]
MEASURED_SHOWN = [
    "measured_residuals",
    "measured_agreement",
    "measured_noise",
    "measured_first_order_table",
    "measured_agreement_table",
]
SHOWN = [*FIGURES, *TABLES, *MEASURED_SHOWN]
CAPTIONS = [workflow.source_path(f"../report/{name}.rst") for name in SHOWN]


rule figure_2017_fig3:
    input:
        rates="results/{scale}/calibration/rate_error.csv",
        code=DRAWING,
    output:
        pdf="results/{scale}/figures/2017_fig3.pdf",
        png=report(
            "results/{scale}/figures/2017_fig3.png",
            caption="../report/2017_fig3.rst",
            category="Paper 2017",
        ),
        csv="results/{scale}/figures/2017_fig3.csv",
    log:
        "results/{scale}/logs/figures/2017_fig3.log",
    benchmark:
        "results/{scale}/benchmarks/figures/2017_fig3.tsv"
    threads: 1
    resources:
        mem_mb=1000,
        runtime=10,
    params:
        settings=lambda wc: effective(config, wc.scale, "paper2017"),
    script:
        "../scripts/figure_2017_fig3.py"


rule figure_2017_fig4:
    input:
        errors="results/{scale}/calibration/position_error_samples.csv",
        code=DRAWING,
    output:
        pdf="results/{scale}/figures/2017_fig4.pdf",
        png=report(
            "results/{scale}/figures/2017_fig4.png",
            caption="../report/2017_fig4.rst",
            category="Paper 2017",
        ),
        csv="results/{scale}/figures/2017_fig4.csv",
    log:
        "results/{scale}/logs/figures/2017_fig4.log",
    benchmark:
        "results/{scale}/benchmarks/figures/2017_fig4.tsv"
    threads: 1
    resources:
        mem_mb=1000,
        runtime=10,
    params:
        settings=lambda wc: effective(config, wc.scale, "paper2017"),
    script:
        "../scripts/figure_2017_fig4.py"


rule figure_2017_fig5:
    input:
        errors="results/{scale}/calibration/position_error_motion.csv",
        code=DRAWING,
    output:
        pdf="results/{scale}/figures/2017_fig5.pdf",
        png=report(
            "results/{scale}/figures/2017_fig5.png",
            caption="../report/2017_fig5.rst",
            category="Paper 2017",
        ),
        csv="results/{scale}/figures/2017_fig5.csv",
    log:
        "results/{scale}/logs/figures/2017_fig5.log",
    benchmark:
        "results/{scale}/benchmarks/figures/2017_fig5.tsv"
    threads: 1
    resources:
        mem_mb=1000,
        runtime=10,
    params:
        settings=lambda wc: effective(config, wc.scale, "paper2017"),
    script:
        "../scripts/figure_2017_fig5.py"


rule figure_2021_fig1:
    input:
        code=DRAWING,
        geometry=library("simulation"),
    output:
        pdf="results/{scale}/figures/2021_fig1.pdf",
        png=report(
            "results/{scale}/figures/2021_fig1.png",
            caption="../report/2021_fig1.rst",
            category="Paper 2021",
        ),
        csv="results/{scale}/figures/2021_fig1.csv",
    log:
        "results/{scale}/logs/figures/2021_fig1.log",
    benchmark:
        "results/{scale}/benchmarks/figures/2021_fig1.tsv"
    threads: 1
    resources:
        mem_mb=1000,
        runtime=10,
    params:
        settings=lambda wc: effective(config, wc.scale),
    script:
        "../scripts/figure_2021_fig1.py"


rule figure_2021_fig2:
    input:
        variances=expand("results/{{scale}}/tuning/variance_T{samples}.csv", samples=SAMPLES),
        code=DRAWING,
    output:
        pdf="results/{scale}/figures/2021_fig2.pdf",
        png=report(
            "results/{scale}/figures/2021_fig2.png",
            caption="../report/2021_fig2.rst",
            category="Paper 2021",
        ),
        csv="results/{scale}/figures/2021_fig2.csv",
    log:
        "results/{scale}/logs/figures/2021_fig2.log",
    benchmark:
        "results/{scale}/benchmarks/figures/2021_fig2.tsv"
    threads: 1
    resources:
        mem_mb=1000,
        runtime=10,
    params:
        settings=lambda wc: effective(config, wc.scale, "paper2021"),
    script:
        "../scripts/figure_2021_fig2.py"


rule figure_2021_fig3:
    input:
        chains=expand("results/{{scale}}/chains/T{samples}.nc", samples=max(SAMPLES)),
        verdict=expand("results/{{scale}}/posterior/T{samples}.json", samples=max(SAMPLES)),
        coordinates=expand("results/{{scale}}/posterior/T{samples}.csv", samples=max(SAMPLES)),
        code=DRAWING,
    output:
        pdf="results/{scale}/figures/2021_fig3.pdf",
        png=report(
            "results/{scale}/figures/2021_fig3.png",
            caption="../report/2021_fig3.rst",
            category="Paper 2021",
        ),
        csv="results/{scale}/figures/2021_fig3.csv",
    log:
        "results/{scale}/logs/figures/2021_fig3.log",
    benchmark:
        "results/{scale}/benchmarks/figures/2021_fig3.tsv"
    threads: 1
    resources:
        mem_mb=2000,
        runtime=10,
    params:
        settings=lambda wc: effective(config, wc.scale, "paper2021"),
    script:
        "../scripts/figure_2021_fig3.py"


rule figure_2021_fig4:
    input:
        chains=expand("results/{{scale}}/chains/T{samples}.nc", samples=SAMPLES),
        verdicts=expand("results/{{scale}}/posterior/T{samples}.json", samples=SAMPLES),
        coordinates=expand("results/{{scale}}/posterior/T{samples}.csv", samples=SAMPLES),
        code=DRAWING,
    output:
        pdf="results/{scale}/figures/2021_fig4.pdf",
        png=report(
            "results/{scale}/figures/2021_fig4.png",
            caption="../report/2021_fig4.rst",
            category="Paper 2021",
        ),
        csv="results/{scale}/figures/2021_fig4.csv",
    log:
        "results/{scale}/logs/figures/2021_fig4.log",
    benchmark:
        "results/{scale}/benchmarks/figures/2021_fig4.tsv"
    threads: 1
    resources:
        mem_mb=2000,
        runtime=10,
    params:
        settings=lambda wc: effective(config, wc.scale, "paper2021"),
    script:
        "../scripts/figure_2021_fig4.py"


rule figure_2021_fig5:
    input:
        chains=lambda wc: MEASURED.posterior(
            wc.scale, MEASURED.experiment(wc.scale), "chains", ["nc"]
        ),
        verdicts=lambda wc: MEASURED.posterior(
            wc.scale, MEASURED.experiment(wc.scale), "posterior", ["json"]
        ),
        coordinates=lambda wc: MEASURED.posterior(
            wc.scale, MEASURED.experiment(wc.scale), "posterior", ["csv"]
        ),
        recordings=lambda wc: MEASURED.recordings(wc.scale),
        code=DRAWING,
    output:
        pdf="results/{scale}/figures/2021_fig5.pdf",
        png=report(
            "results/{scale}/figures/2021_fig5.png",
            caption="../report/2021_fig5.rst",
            category="Paper 2021",
        ),
        csv="results/{scale}/figures/2021_fig5.csv",
    log:
        "results/{scale}/logs/figures/2021_fig5.log",
    benchmark:
        "results/{scale}/benchmarks/figures/2021_fig5.tsv"
    threads: 1
    resources:
        mem_mb=2000,
        runtime=10,
    params:
        settings=lambda wc: effective(config, wc.scale, "paper2021", "experiment"),
        kind=lambda wc: MEASURED.source(wc.scale),
        source=lambda wc: MEASURED.label(wc.scale, SOURCES),
    script:
        "../scripts/figure_2021_fig5.py"


rule table_2021_table1:
    input:
        tunings=expand("results/{{scale}}/tuning/T{samples}.json", samples=SAMPLES),
        verdicts=expand("results/{{scale}}/posterior/T{samples}.json", samples=SAMPLES),
        code=library("figures"),
    output:
        csv=report(
            "results/{scale}/tables/2021_table1.csv",
            caption="../report/2021_table1.rst",
            category="Paper 2021",
        ),
        tex="results/{scale}/tables/2021_table1.tex",
        md="results/{scale}/tables/2021_table1.md",
    log:
        "results/{scale}/logs/tables/2021_table1.log",
    benchmark:
        "results/{scale}/benchmarks/tables/2021_table1.tsv"
    threads: 1
    resources:
        mem_mb=1000,
        runtime=10,
    params:
        settings=lambda wc: effective(config, wc.scale, "paper2021"),
    script:
        "../scripts/table_2021_table1.py"


rule table_2021_table2:
    input:
        experiment=lambda wc: MEASURED.posterior(
            wc.scale, MEASURED.experiment(wc.scale), "posterior", ["csv", "json"]
        ),
        simulation=lambda wc: MEASURED.posterior(
            wc.scale, MEASURED.simulation(wc.scale), "posterior", ["csv", "json"]
        ),
        ideal=expand(
            "results/{{scale}}/posterior/T{samples}.{form}", samples=SAMPLES, form=["csv", "json"]
        ),
        code=library("figures"),
    output:
        csv=report(
            "results/{scale}/tables/2021_table2.csv",
            caption="../report/2021_table2.rst",
            category="Paper 2021",
        ),
        tex="results/{scale}/tables/2021_table2.tex",
        md="results/{scale}/tables/2021_table2.md",
    log:
        "results/{scale}/logs/tables/2021_table2.log",
    benchmark:
        "results/{scale}/benchmarks/tables/2021_table2.tsv"
    threads: 1
    resources:
        mem_mb=1000,
        runtime=10,
    params:
        settings=lambda wc: effective(config, wc.scale, "paper2021", "experiment"),
        kind=lambda wc: MEASURED.source(wc.scale),
        source=lambda wc: MEASURED.label(wc.scale, SOURCES),
    script:
        "../scripts/table_2021_table2.py"


rule gallery:
    input:
        figures=expand("paper_figures/{name}.{kind}", name=FIGURES, kind=["pdf", "png", "csv"]),
        tables=expand("paper_figures/{name}.{kind}", name=TABLES, kind=["csv", "tex", "md"]),
        claims=["paper_figures/claims.csv", "paper_figures/claims.md"],
        verdicts=expand(
            "results/{scale}/posterior/T{samples}.json", scale=config["scale"], samples=SAMPLES
        ),
        experiment=lambda wc: MEASURED.posterior(
            config["scale"], MEASURED.experiment(config["scale"]), "posterior", ["json"]
        ),
        measured=lambda wc: expand(
            "paper_figures/{name}.png", name=MEASURED.published(config["scale"])
        ),
        measured_tables=lambda wc: expand(
            "paper_figures/{name}.md", name=MEASURED.published_tables(config["scale"])
        ),
        captions=CAPTIONS,
        code=library("figures"),
    output:
        "paper_figures/README.md",
    log:
        "results/logs/publish/README.log",
    benchmark:
        "results/benchmarks/publish/README.tsv"
    threads: 1
    resources:
        mem_mb=500,
        runtime=5,
    params:
        settings=effective(config, config["scale"], "paper2017", "paper2021", "experiment"),
        figures=FIGURES,
        tables=TABLES,
        measured=lambda wc: list(MEASURED.published(config["scale"])),
        measured_tables=lambda wc: list(MEASURED.published_tables(config["scale"])),
        source=lambda wc: MEASURED.label(config["scale"], SOURCES),
    script:
        "../scripts/gallery.py"
