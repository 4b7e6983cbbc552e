SHOWN_CAPTIONS = [
    workflow.source_path(f"../report/{name}.rst")
    for name in [*FIGURES, *TABLES, *MEASURED.published()]
]


draw(
    "paper2021_array.figure_2017_fig2",
    "figure 2 of 2017 ({wildcards.scale})",
    category="Paper 2017",
    settings=sections(),
)
draw(
    "paper2017.figure_2017_fig3",
    "figure 3 of 2017 ({wildcards.scale})",
    {"rates": "results/{scale}/calibration/rate_error.csv"},
    category="Paper 2017",
    settings=sections("paper2017.fig3"),
)
draw(
    "paper2017.figure_2017_fig4",
    "figure 4 of 2017 ({wildcards.scale})",
    {"errors": "results/{scale}/calibration/position_error_samples.csv"},
    category="Paper 2017",
    settings=sections("paper2017.fig4"),
)
draw(
    "paper2017.figure_2017_fig5",
    "figure 5 of 2017 ({wildcards.scale})",
    {"errors": "results/{scale}/calibration/position_error_motion.csv"},
    category="Paper 2017",
    settings=sections("paper2017.fig5"),
)
draw(
    "paper2021_array.figure_2021_fig1",
    "figure 1 of 2021 ({wildcards.scale})",
    category="Paper 2021",
    settings=sections(),
)
draw(
    "paper2021.figure_2021_fig2",
    "figure 2 of 2021 ({wildcards.scale})",
    {"variances": of_samples("tuning/variance_T{samples}.csv")},
    category="Paper 2021",
    settings=sections("paper2021"),
)
draw(
    "paper2021.figure_2021_fig3",
    "figure 3 of 2021 ({wildcards.scale})",
    {
        "chains": of_samples("chains/T{samples}.nc", max(SAMPLES)),
        "verdict": of_samples("posterior/T{samples}.json", max(SAMPLES)),
        "coordinates": of_samples("posterior/T{samples}.csv", max(SAMPLES)),
    },
    category="Paper 2021",
    settings=sections("paper2021"),
)
draw(
    "paper2021.figure_2021_fig4",
    "figure 4 of 2021 ({wildcards.scale})",
    {
        "chains": of_samples("chains/T{samples}.nc"),
        "verdicts": of_samples("posterior/T{samples}.json"),
        "coordinates": of_samples("posterior/T{samples}.csv"),
    },
    category="Paper 2021",
    settings=sections("paper2021"),
)
draw(
    "paper2021_array.figure_2021_fig5",
    "figure 5 of 2021 ({wildcards.scale})",
    {
        "chains": lambda wc: MEASURED.posterior(wc.scale, SHOWN, "chains", ["nc"]),
        "verdicts": lambda wc: MEASURED.posterior(wc.scale, SHOWN, "posterior", ["json"]),
        "coordinates": lambda wc: MEASURED.posterior(wc.scale, SHOWN, "posterior", ["csv"]),
        "recordings": MEASURED.subsets(),
    },
    category="Paper 2021",
    settings=sections("paper2021", "experiment"),
)
draw(
    "paper2021_tables.table_2021_table1",
    "table I of 2021 ({wildcards.scale})",
    {
        "tunings": of_samples("tuning/T{samples}.json"),
        "verdicts": of_samples("posterior/T{samples}.json"),
    },
    category="Paper 2021",
    settings=sections("paper2021"),
)
draw(
    "paper2021_tables.table_2021_table2",
    "table II of 2021 ({wildcards.scale})",
    {
        name: lambda wc, kind=kind: MEASURED.posterior(wc.scale, kind, "posterior", ["csv", "json"])
        for name, kind in (("experiment", SHOWN), ("simulation", f"simulated_{SHOWN}"))
    }
    | {"ideal": of_samples("posterior/T{samples}.{form}", form=["csv", "json"])},
    category="Paper 2021",
    settings=sections("paper2021", "experiment"),
)


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
