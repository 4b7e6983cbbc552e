from imuarray.figures.notes import SOURCES

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
    output:
        **figure("2017_fig3", "Paper 2017"),
    log:
        "results/{scale}/logs/figures/2017_fig3.log",
    benchmark:
        "results/{scale}/benchmarks/figures/2017_fig3.tsv"
    params:
        settings=lambda wc: effective(config, wc.scale, "paper2017"),
        code=CODE.digest("figure_2017_fig3"),
    message:
        "figure 3 of 2017 ({wildcards.scale})"
    script:
        "../scripts/figure_2017_fig3.py"


rule figure_2017_fig4:
    input:
        errors="results/{scale}/calibration/position_error_samples.csv",
    output:
        **figure("2017_fig4", "Paper 2017"),
    log:
        "results/{scale}/logs/figures/2017_fig4.log",
    benchmark:
        "results/{scale}/benchmarks/figures/2017_fig4.tsv"
    params:
        settings=lambda wc: effective(config, wc.scale, "paper2017"),
        code=CODE.digest("figure_2017_fig4"),
    message:
        "figure 4 of 2017 ({wildcards.scale})"
    script:
        "../scripts/figure_2017_fig4.py"


rule figure_2017_fig5:
    input:
        errors="results/{scale}/calibration/position_error_motion.csv",
    output:
        **figure("2017_fig5", "Paper 2017"),
    log:
        "results/{scale}/logs/figures/2017_fig5.log",
    benchmark:
        "results/{scale}/benchmarks/figures/2017_fig5.tsv"
    params:
        settings=lambda wc: effective(config, wc.scale, "paper2017"),
        code=CODE.digest("figure_2017_fig5"),
    message:
        "figure 5 of 2017 ({wildcards.scale})"
    script:
        "../scripts/figure_2017_fig5.py"


rule figure_2021_fig1:
    output:
        **figure("2021_fig1", "Paper 2021"),
    log:
        "results/{scale}/logs/figures/2021_fig1.log",
    benchmark:
        "results/{scale}/benchmarks/figures/2021_fig1.tsv"
    params:
        settings=lambda wc: effective(config, wc.scale),
        code=CODE.digest("figure_2021_fig1"),
    message:
        "figure 1 of 2021 ({wildcards.scale})"
    script:
        "../scripts/figure_2021_fig1.py"


rule figure_2021_fig2:
    input:
        variances=expand("results/{{scale}}/tuning/variance_T{samples}.csv", samples=SAMPLES),
    output:
        **figure("2021_fig2", "Paper 2021"),
    log:
        "results/{scale}/logs/figures/2021_fig2.log",
    benchmark:
        "results/{scale}/benchmarks/figures/2021_fig2.tsv"
    params:
        settings=lambda wc: effective(config, wc.scale, "paper2021"),
        code=CODE.digest("figure_2021_fig2"),
    message:
        "figure 2 of 2021 ({wildcards.scale})"
    script:
        "../scripts/figure_2021_fig2.py"


rule figure_2021_fig3:
    input:
        chains=expand("results/{{scale}}/chains/T{samples}.nc", samples=max(SAMPLES)),
        verdict=expand("results/{{scale}}/posterior/T{samples}.json", samples=max(SAMPLES)),
        coordinates=expand("results/{{scale}}/posterior/T{samples}.csv", samples=max(SAMPLES)),
    output:
        **figure("2021_fig3", "Paper 2021"),
    log:
        "results/{scale}/logs/figures/2021_fig3.log",
    benchmark:
        "results/{scale}/benchmarks/figures/2021_fig3.tsv"
    params:
        settings=lambda wc: effective(config, wc.scale, "paper2021"),
        code=CODE.digest("figure_2021_fig3"),
    message:
        "figure 3 of 2021 ({wildcards.scale})"
    script:
        "../scripts/figure_2021_fig3.py"


rule figure_2021_fig4:
    input:
        chains=expand("results/{{scale}}/chains/T{samples}.nc", samples=SAMPLES),
        verdicts=expand("results/{{scale}}/posterior/T{samples}.json", samples=SAMPLES),
        coordinates=expand("results/{{scale}}/posterior/T{samples}.csv", samples=SAMPLES),
    output:
        **figure("2021_fig4", "Paper 2021"),
    log:
        "results/{scale}/logs/figures/2021_fig4.log",
    benchmark:
        "results/{scale}/benchmarks/figures/2021_fig4.tsv"
    params:
        settings=lambda wc: effective(config, wc.scale, "paper2021"),
        code=CODE.digest("figure_2021_fig4"),
    message:
        "figure 4 of 2021 ({wildcards.scale})"
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
    output:
        **figure("2021_fig5", "Paper 2021"),
    log:
        "results/{scale}/logs/figures/2021_fig5.log",
    benchmark:
        "results/{scale}/benchmarks/figures/2021_fig5.tsv"
    params:
        settings=lambda wc: effective(config, wc.scale, "paper2021", "experiment"),
        kind=lambda wc: MEASURED.source(wc.scale),
        source=lambda wc: MEASURED.label(wc.scale, SOURCES),
        code=CODE.digest("figure_2021_fig5"),
    message:
        "figure 5 of 2021 ({wildcards.scale})"
    script:
        "../scripts/figure_2021_fig5.py"


rule table_2021_table1:
    input:
        tunings=expand("results/{{scale}}/tuning/T{samples}.json", samples=SAMPLES),
        verdicts=expand("results/{{scale}}/posterior/T{samples}.json", samples=SAMPLES),
    output:
        **table("2021_table1", "Paper 2021"),
    log:
        "results/{scale}/logs/tables/2021_table1.log",
    benchmark:
        "results/{scale}/benchmarks/tables/2021_table1.tsv"
    params:
        settings=lambda wc: effective(config, wc.scale, "paper2021"),
        code=CODE.digest("table_2021_table1"),
    message:
        "table I of 2021 ({wildcards.scale})"
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
    output:
        **table("2021_table2", "Paper 2021"),
    log:
        "results/{scale}/logs/tables/2021_table2.log",
    benchmark:
        "results/{scale}/benchmarks/tables/2021_table2.tsv"
    params:
        settings=lambda wc: effective(config, wc.scale, "paper2021", "experiment"),
        kind=lambda wc: MEASURED.source(wc.scale),
        source=lambda wc: MEASURED.label(wc.scale, SOURCES),
        code=CODE.digest("table_2021_table2"),
    message:
        "table II of 2021 ({wildcards.scale})"
    script:
        "../scripts/table_2021_table2.py"


rule gallery:
    input:
        figures=expand("paper_figures/{name}.{kind}", name=FIGURES, kind=FIGURE),
        tables=expand("paper_figures/{name}.{kind}", name=TABLES, kind=TABLE),
        claims=["paper_figures/claims.csv", "paper_figures/claims.md"],
        verdicts=expand(
            "results/{scale}/posterior/T{samples}.json", scale=config["scale"], samples=SAMPLES
        ),
        experiment=lambda wc: MEASURED.posterior(
            config["scale"], MEASURED.experiment(config["scale"]), "posterior", ["json"]
        ),
        measured=lambda wc: MEASURED.published_files(config["scale"]),
        captions=CAPTIONS,
    output:
        "paper_figures/README.md",
    log:
        "results/logs/publish/README.log",
    benchmark:
        "results/benchmarks/publish/README.tsv"
    params:
        settings=effective(config, config["scale"], "paper2017", "paper2021", "experiment"),
        figures=FIGURES,
        tables=TABLES,
        measured=lambda wc: MEASURED.published_names(config["scale"], "figures"),
        measured_tables=lambda wc: MEASURED.published_names(config["scale"], "tables"),
        source=lambda wc: MEASURED.label(config["scale"], SOURCES),
        code=CODE.digest("gallery"),
    message:
        "paper_figures/README.md"
    script:
        "../scripts/gallery.py"
