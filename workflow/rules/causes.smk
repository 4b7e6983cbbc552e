# What each cause gains on a board of several recordings, and what the others say of one that is left
# out; its own target, `causes`.


rule correct_together:
    input:
        of_board("results/measured/recordings/{name}.nc"),
    output:
        directory("results/measured/together/{group}"),
    log:
        "results/measured/logs/together/{group}.log",
    benchmark:
        "results/measured/benchmarks/together/{group}.tsv"
    priority: 10
    params:
        entries=lambda wc: {name: RECORDINGS[name] for name in MEASURED.board(wc.group)},
        code=code("correct_together"),
    message:
        "all recordings of {wildcards.group}, corrected by the poses of them all"
    script:
        "../scripts/correct_together.py"


rule fit_stepwise:
    input:
        lambda wc: f"results/measured/together/{MEASURED.group(wc.name)}",
    output:
        "results/measured/causes/{name}.csv",
    log:
        "results/measured/logs/causes/{name}.log",
    benchmark:
        "results/measured/benchmarks/causes/{name}.tsv"
    priority: 9
    threads: 1
    resources:
        mem_mb=4000,
    params:
        code=code("fit_stepwise"),
    message:
        "{wildcards.name}, fitted cause after cause"
    script:
        "../scripts/fit_stepwise.py"


rule repeat_causes:
    input:
        of_board("results/measured/causes/{name}.csv"),
    output:
        "results/measured/causes_{group}.csv",
    log:
        "results/measured/logs/causes_{group}.log",
    benchmark:
        "results/measured/benchmarks/causes_{group}.tsv"
    params:
        names=lambda wc: MEASURED.board(wc.group),
        code=code("repeat_causes"),
    message:
        "how positions of {wildcards.group} repeat under each model"
    script:
        "../scripts/repeat_causes.py"


draw(
    "board.table_causes",
    "table: what each cause gains on {wildcards.group}",
    {"summary": "results/measured/causes_{group}.csv"},
    folder="results/measured",
    output="causes_table_{group}",
)


# Leave one recording out: what the others say of the board, and of this one.
rule leave_out:
    input:
        recording="results/measured/recordings/{name}.nc",
        others=lambda wc: expand(
            "results/measured/recordings/{name}.nc", name=MEASURED.others(wc.name)
        ),
    output:
        recording="results/measured/left_out/{name}.nc",
        calibration="results/measured/left_out/{name}_others.nc",
    log:
        "results/measured/logs/left_out/{name}.log",
    benchmark:
        "results/measured/benchmarks/left_out/{name}.tsv"
    priority: 9
    threads: 1
    resources:
        mem_mb=4000,
    params:
        entry=lambda wc: RECORDINGS[wc.name],
        code=code("leave_out"),
    message:
        "the board of {wildcards.name} as the other recordings show it"
    script:
        "../scripts/leave_out.py"


rule predict_left_out:
    input:
        recording="results/measured/left_out/{name}.nc",
        calibration="results/measured/left_out/{name}_others.nc",
    output:
        "results/measured/predicted/{name}.csv",
    log:
        "results/measured/logs/predicted/{name}.log",
    benchmark:
        "results/measured/benchmarks/predicted/{name}.tsv"
    priority: 9
    threads: 1
    resources:
        mem_mb=4000,
    params:
        code=code("predict_left_out"),
    message:
        "what the other recordings say of {wildcards.name}"
    script:
        "../scripts/predict_left_out.py"


draw(
    "board.table_left_out",
    "table: recordings of {wildcards.group} predicted by the others",
    {"tables": of_board("results/measured/predicted/{name}.csv")},
    folder="results/measured",
    output="left_out_{group}",
    names=lambda wc: MEASURED.board(wc.group),
)


# Paper 2021's experiment once more, with the sensors as the other recordings show them.
rule locate_experiment:
    input:
        recording="results/measured/left_out/{name}.nc",
        calibration="results/measured/left_out/{name}_others.nc",
    output:
        "results/measured/located/{name}.nc",
    log:
        "results/measured/logs/located/{name}.log",
    benchmark:
        "results/measured/benchmarks/located/{name}.tsv"
    threads: 1
    resources:
        mem_mb=4000,
    params:
        samples=SAMPLES,
        code=code("locate_experiment"),
    message:
        "positions from few samples of {wildcards.name}, sensors known"
    script:
        "../scripts/locate_experiment.py"


draw(
    "paper2021_array.figure_experiment",
    "figure 5 of 2021 once more, from {wildcards.name} with sensors known",
    {
        "located": "results/measured/located/{name}.nc",
        "recordings": ["results/measured/left_out/{name}.nc"],
    },
    folder="results/measured",
    output="experiment_{name}",
    category="Measured",
    settings=effective(config, config["scale"], "paper2021", "experiment"),
)
draw(
    "board.table_experiment",
    "table II of 2021 once more, {wildcards.group}",
    {
        "located": of_board("results/measured/located/{name}.nc"),
        "summary": "results/measured/agreement/{group}.csv",
    },
    folder="results/measured",
    output="experiment_table_{group}",
    names=lambda wc: MEASURED.board(wc.group),
)


rule figure_past_rail:
    input:
        recording="results/measured/left_out/{name}.nc",
        calibration="results/measured/left_out/{name}_others.nc",
    output:
        **drawn("figure", "past_rail_{name}", "Diagnosis", "past_rail", folder="results/measured"),
    log:
        "results/measured/logs/past_rail_{name}.log",
    benchmark:
        "results/measured/benchmarks/past_rail_{name}.tsv"
    resources:
        mem_mb=4000,
    params:
        code=code("figure_past_rail"),
    message:
        "motion of {wildcards.name} past the rail"
    script:
        "../scripts/figure_past_rail.py"


draw(
    "board.table_past_rail",
    "table: recordings of {wildcards.group} past the rail",
    {"tables": of_board("results/measured/figures/past_rail_{name}.csv")},
    folder="results/measured",
    output="past_rail_table_{group}",
    names=lambda wc: MEASURED.board(wc.group),
)
