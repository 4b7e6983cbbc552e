RECORDINGS = config["recordings"]


if not HOME.is_local:

    # Read from a repository afar, the workflow takes its recordings out of it.
    rule take_recording:
        output:
            "results/measured/data/{path}",
        log:
            "results/measured/logs/data/{path}.log",
        benchmark:
            "results/measured/benchmarks/data/{path}.tsv"
        wildcard_constraints:
            path="data/.*",
        params:
            blob=lambda wc: HOME.blob(wc.path),
        message:
            "{wildcards.path}"
        shell:
            "{params.blob} > {output:q} 2> {log:q}"


rule convert_recording:
    input:
        unpack(
            lambda wc: {
                key: HOME.recording(RECORDINGS[wc.name][key])
                for key in ("file", "columns", "positions")
                if key in RECORDINGS[wc.name]
            }
        ),
    output:
        "results/measured/recordings/{name}.nc",
    log:
        "results/measured/logs/recordings/{name}.log",
    benchmark:
        "results/measured/benchmarks/recordings/{name}.tsv"
    priority: 9
    params:
        code=code("convert_recording"),
    message:
        "recording {wildcards.name}, converted"
    script:
        "../scripts/convert_recording.py"


rule first_order:
    input:
        recording="results/measured/recordings/{name}.nc",
    output:
        recording="results/measured/corrected/{name}.nc",
        parameters="results/measured/first_order/{name}_parameters.csv",
        residuals="results/measured/first_order/{name}_residuals.csv",
        noise="results/measured/first_order/{name}_noise.csv",
        allan="results/measured/first_order/{name}_allan.csv",
    log:
        "results/measured/logs/corrected/{name}.log",
    benchmark:
        "results/measured/benchmarks/corrected/{name}.tsv"
    priority: 9
    params:
        entry=lambda wc: RECORDINGS[wc.name],
        code=code("first_order"),
    message:
        "first-order calibration of {wildcards.name}"
    script:
        "../scripts/first_order.py"


rule subset_recording:
    input:
        recording=lambda wc: MEASURED.recording(wc.name),
    output:
        measured=expand("results/measured/subsets/{{name}}_T{samples}.nc", samples=SAMPLES),
        simulated=expand(
            "results/measured/subsets/simulated_{{name}}_T{samples}.nc", samples=SAMPLES
        ),
        selection="results/measured/subsets/{name}_selection.csv",
    log:
        "results/measured/logs/subsets/{name}.log",
    benchmark:
        "results/measured/benchmarks/subsets/{name}.tsv"
    priority: 9
    params:
        settings=effective(config, "", "paper2021", "experiment"),
        code=code("subset_recording"),
    message:
        "moving samples of {wildcards.name}, chosen"
    script:
        "../scripts/subset_recording.py"


rule locate_positions:
    input:
        subsets=expand("results/measured/subsets/{{name}}_T{samples}.nc", samples=SAMPLES),
    output:
        "results/measured/positions/{name}.csv",
    log:
        "results/measured/logs/positions/{name}.log",
    benchmark:
        "results/measured/benchmarks/positions/{name}.tsv"
    params:
        settings=effective(config, "", "paper2021", "experiment"),
        code=code("locate_positions"),
    message:
        "positions from {wildcards.name}"
    script:
        "../scripts/locate_positions.py"


rule agreement:
    input:
        positions=lambda wc: expand(
            "results/measured/positions/{name}.csv", name=MEASURED.groups()[wc.group]
        ),
    output:
        summary="results/measured/agreement/{group}.csv",
        pairs="results/measured/agreement/{group}_pairs.csv",
    log:
        "results/measured/logs/agreement/{group}.log",
    benchmark:
        "results/measured/benchmarks/agreement/{group}.tsv"
    params:
        code=code("agreement"),
    message:
        "agreement between recordings of {wildcards.group}"
    script:
        "../scripts/agreement.py"


rule residuals:
    input:
        recording=lambda wc: MEASURED.recording(wc.name),
    output:
        "results/measured/residuals/{name}.csv",
    log:
        "results/measured/logs/residuals/{name}.log",
    benchmark:
        "results/measured/benchmarks/residuals/{name}.tsv"
    params:
        settings=effective(config, ""),
        code=code("residuals"),
    message:
        "residuals of {wildcards.name}"
    script:
        "../scripts/residuals.py"


use rule sample_experiment as sample_measured with:
    input:
        subsets=expand("results/measured/subsets/{{kind}}_T{samples}.nc", samples=SAMPLES),
    wildcard_constraints:
        kind=MEASURED_KINDS,
    priority: 9
    params:
        settings=sections("paper2017", "paper2021", "experiment"),
        lengths="measured_transitions",
        code=code("sample_experiment"),
    message:
        "chains of {wildcards.kind} ({wildcards.scale})"


use rule judge_experiment as judge_measured with:
    input:
        recordings=expand("results/measured/subsets/{{kind}}_T{samples}.nc", samples=SAMPLES),
        chains=of_samples("chains/{kind}_T{samples}.nc"),
    wildcard_constraints:
        kind=MEASURED_KINDS,


draw(
    "measured.figure_measured_noise",
    "figure: noise of {wildcards.name}",
    {"allan": "results/measured/first_order/{name}_allan.csv"},
    folder="results/measured",
    output="noise_{name}",
    category="Measured",
    settings=effective(config, ""),
)
draw(
    "measured.figure_measured_agreement",
    "figure: agreement within {wildcards.group}",
    {
        "summary": "results/measured/agreement/{group}.csv",
        "pairs": "results/measured/agreement/{group}_pairs.csv",
    },
    folder="results/measured",
    output="agreement_{group}",
    category="Measured",
    settings=effective(config, ""),
)
draw(
    "measured.table_measured_first_order",
    "table: first-order calibration of {wildcards.group}",
    {
        part: of_board(f"results/measured/first_order/{{name}}_{part}.csv")
        for part in ("residuals", "noise")
    },
    folder="results/measured",
    output="first_order_{group}",
    category="Measured",
    caption="measured_first_order_table",
    names=lambda wc: MEASURED.board(wc.group),
)
draw(
    "measured.table_measured_agreement",
    "table: agreement within {wildcards.group}",
    {"summary": "results/measured/agreement/{group}.csv"},
    folder="results/measured",
    output="agreement_{group}",
    category="Measured",
    caption="measured_agreement_table",
)
