SHOWN_CAPTIONS = [
    workflow.source_path(f"../report/{name}.rst")
    for name in [*FIGURES, *TABLES, *MEASURED.published()]
]


rule figure_2017_fig2:
    output:
        **figure("2017_fig2", "Paper 2017"),
    log:
        "results/{scale}/logs/figures/2017_fig2.log",
    benchmark:
        "results/{scale}/benchmarks/figures/2017_fig2.tsv"
    params:
        **by("figures.paper2021_array.figure_2017_fig2"),
        settings=lambda wc: effective(config, wc.scale),
    message:
        "figure 2 of 2017 ({wildcards.scale})"
    script:
        "../scripts/publish.py"


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
        **by("figures.paper2017.figure_2017_fig3"),
        settings=lambda wc: effective(config, wc.scale, "paper2017.fig3"),
    message:
        "figure 3 of 2017 ({wildcards.scale})"
    script:
        "../scripts/publish.py"


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
        **by("figures.paper2017.figure_2017_fig4"),
        settings=lambda wc: effective(config, wc.scale, "paper2017.fig4"),
    message:
        "figure 4 of 2017 ({wildcards.scale})"
    script:
        "../scripts/publish.py"


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
        **by("figures.paper2017.figure_2017_fig5"),
        settings=lambda wc: effective(config, wc.scale, "paper2017.fig5"),
    message:
        "figure 5 of 2017 ({wildcards.scale})"
    script:
        "../scripts/publish.py"


rule figure_2021_fig1:
    output:
        **figure("2021_fig1", "Paper 2021"),
    log:
        "results/{scale}/logs/figures/2021_fig1.log",
    benchmark:
        "results/{scale}/benchmarks/figures/2021_fig1.tsv"
    params:
        **by("figures.paper2021_array.figure_2021_fig1"),
        settings=lambda wc: effective(config, wc.scale),
    message:
        "figure 1 of 2021 ({wildcards.scale})"
    script:
        "../scripts/publish.py"


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
        **by("figures.paper2021.figure_2021_fig2"),
        settings=lambda wc: effective(config, wc.scale, "paper2021"),
    message:
        "figure 2 of 2021 ({wildcards.scale})"
    script:
        "../scripts/publish.py"


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
        **by("figures.paper2021.figure_2021_fig3"),
        settings=lambda wc: effective(config, wc.scale, "paper2021"),
    message:
        "figure 3 of 2021 ({wildcards.scale})"
    script:
        "../scripts/publish.py"


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
        **by("figures.paper2021.figure_2021_fig4"),
        settings=lambda wc: effective(config, wc.scale, "paper2021"),
    message:
        "figure 4 of 2021 ({wildcards.scale})"
    script:
        "../scripts/publish.py"


rule figure_2021_fig5:
    input:
        chains=lambda wc: MEASURED.posterior(wc.scale, SHOWN, "chains", ["nc"]),
        verdicts=lambda wc: MEASURED.posterior(wc.scale, SHOWN, "posterior", ["json"]),
        coordinates=lambda wc: MEASURED.posterior(wc.scale, SHOWN, "posterior", ["csv"]),
        recordings=MEASURED.subsets(),
    output:
        **figure("2021_fig5", "Paper 2021"),
    log:
        "results/{scale}/logs/figures/2021_fig5.log",
    benchmark:
        "results/{scale}/benchmarks/figures/2021_fig5.tsv"
    params:
        **by("figures.paper2021_array.figure_2021_fig5"),
        settings=lambda wc: effective(config, wc.scale, "paper2021", "experiment"),
    message:
        "figure 5 of 2021 ({wildcards.scale})"
    script:
        "../scripts/publish.py"


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
        **by("figures.paper2021_tables.table_2021_table1"),
        settings=lambda wc: effective(config, wc.scale, "paper2021"),
    message:
        "table I of 2021 ({wildcards.scale})"
    script:
        "../scripts/publish.py"


rule table_2021_table2:
    input:
        experiment=lambda wc: MEASURED.posterior(wc.scale, SHOWN, "posterior", ["csv", "json"]),
        simulation=lambda wc: MEASURED.posterior(
            wc.scale, f"simulated_{SHOWN}", "posterior", ["csv", "json"]
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
        **by("figures.paper2021_tables.table_2021_table2"),
        settings=lambda wc: effective(config, wc.scale, "paper2021", "experiment"),
    message:
        "table II of 2021 ({wildcards.scale})"
    script:
        "../scripts/publish.py"


rule gallery:
    input:
        figures=expand("paper_figures/{name}.{kind}", name=FIGURES, kind=FIGURE),
        tables=expand("paper_figures/{name}.{kind}", name=TABLES, kind=TABLE),
        claims=["paper_figures/claims.csv", "paper_figures/claims.md"],
        verdicts=expand(
            "results/{scale}/posterior/T{samples}.json", scale=config["scale"], samples=SAMPLES
        ),
        experiment=MEASURED.posterior(config["scale"], SHOWN, "posterior", ["json"]),
        measured=[
            f"paper_figures/{name}.{kind}"
            for folder, kinds in (("figures", FIGURE), ("tables", TABLE))
            for name in MEASURED.published_names(folder)
            for kind in kinds
        ],
        captions=SHOWN_CAPTIONS,
    output:
        "paper_figures/README.md",
    log:
        "results/logs/publish/README.log",
    benchmark:
        "results/benchmarks/publish/README.tsv"
    params:
        settings=effective(config, config["scale"], "paper2017", "paper2021", "experiment"),
        figures=[*FIGURES, *MEASURED.published_names("figures")],
        tables=[*TABLES, *MEASURED.published_names("tables")],
        code=code("gallery"),
    message:
        "paper_figures/README.md"
    script:
        "../scripts/gallery.py"
