RECORDINGS = config["recordings"]
READING = library("measured")


# The published files may be out of reach: the rest is done without them, and one line says so.
# What was missing is tried again at the next run.
checkpoint fetch_recordings:
    output:
        "results/measured/available.json",
    log:
        "results/measured/logs/fetch_recordings.log",
    benchmark:
        "results/measured/benchmarks/fetch_recordings.tsv"
    priority: 9  # the second longest path
    threads: 1
    resources:
        mem_mb=500,
        runtime=30,
    params:
        recordings=RECORDINGS,
        attempt=attempt("results/measured/available.json"),
    script:
        "../scripts/fetch_recordings.py"


rule convert_recording:
    input:
        available="results/measured/available.json",
        code=READING,
    output:
        "results/measured/recordings/{name}.nc",
    log:
        "results/measured/logs/recordings/{name}.log",
    benchmark:
        "results/measured/benchmarks/recordings/{name}.tsv"
    priority: 9
    threads: 1
    resources:
        mem_mb=2000,
        runtime=10,
    params:
        entry=lambda wc: RECORDINGS[wc.name],
        own=lambda wc: contents(*own_files(RECORDINGS[wc.name])),
    script:
        "../scripts/convert_recording.py"


rule first_order:
    input:
        recording="results/measured/recordings/{name}.nc",
        code=READING,
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
    threads: 1
    resources:
        mem_mb=2000,
        runtime=10,
    params:
        entry=lambda wc: RECORDINGS[wc.name],
    script:
        "../scripts/first_order.py"


rule subset_recording:
    input:
        recording=lambda wc: "results/measured/{}/{}.nc".format(
            "corrected" if RECORDINGS[wc.name].get("first_order", True) else "recordings", wc.name
        ),
        code=READING,
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
    threads: 1
    resources:
        mem_mb=2000,
        runtime=10,
    params:
        settings=effective(config, config["scale"], "paper2021", "experiment", scaled=False),
    script:
        "../scripts/subset_recording.py"


rule locate_positions:
    input:
        subsets=expand("results/measured/subsets/{{name}}_T{samples}.nc", samples=SAMPLES),
        code=READING,
    output:
        "results/measured/positions/{name}.csv",
    log:
        "results/measured/logs/positions/{name}.log",
    benchmark:
        "results/measured/benchmarks/positions/{name}.tsv"
    threads: 1
    resources:
        mem_mb=2000,
        runtime=20,
    params:
        settings=effective(config, config["scale"], "paper2021", "experiment", scaled=False),
    script:
        "../scripts/locate_positions.py"


rule agreement:
    input:
        positions=lambda wc: expand(
            "results/measured/positions/{name}.csv", name=MEASURED.groups()[wc.group]
        ),
        code=READING,
    output:
        summary="results/measured/agreement/{group}.csv",
        pairs="results/measured/agreement/{group}_pairs.csv",
    log:
        "results/measured/logs/agreement/{group}.log",
    benchmark:
        "results/measured/benchmarks/agreement/{group}.tsv"
    threads: 1
    resources:
        mem_mb=1000,
        runtime=10,
    script:
        "../scripts/agreement.py"


rule residuals:
    input:
        recording=lambda wc: "results/measured/{}/{}.nc".format(
            "corrected" if RECORDINGS[wc.name].get("first_order", True) else "recordings", wc.name
        ),
        code=READING,
    output:
        summary="results/measured/residuals/{name}.csv",
        histogram="results/measured/residuals/{name}_histogram.csv",
    log:
        "results/measured/logs/residuals/{name}.log",
    benchmark:
        "results/measured/benchmarks/residuals/{name}.tsv"
    threads: 1
    resources:
        mem_mb=2000,
        runtime=20,
    params:
        settings=effective(config, config["scale"], scaled=False),
    script:
        "../scripts/residuals.py"


rule sample_measured:
    input:
        recordings=expand("results/measured/subsets/{{kind}}_T{samples}.nc", samples=SAMPLES),
        code=library("measured"),
    output:
        expand("results/{{scale}}/chains/{{kind}}_T{samples}.nc", samples=SAMPLES),
    log:
        "results/{scale}/logs/chains/{kind}.log",
    benchmark:
        "results/{scale}/benchmarks/chains/{kind}.tsv"
    wildcard_constraints:
        kind=MEASURED_KINDS,
    priority: 9
    threads: lambda wc: CREW.threads(wc.scale)
    resources:
        mem_mb=4000,
        runtime=60,
    params:
        settings=lambda wc: effective(config, wc.scale, "paper2017", "paper2021", "experiment"),
    script:
        "../scripts/sample_measured.py"


rule judge_measured:
    input:
        recordings=expand("results/measured/subsets/{{kind}}_T{samples}.nc", samples=SAMPLES),
        chains=expand("results/{{scale}}/chains/{{kind}}_T{samples}.nc", samples=SAMPLES),
        code=library("posterior"),
    output:
        verdicts=expand("results/{{scale}}/posterior/{{kind}}_T{samples}.json", samples=SAMPLES),
        coordinates=expand("results/{{scale}}/posterior/{{kind}}_T{samples}.csv", samples=SAMPLES),
        burn_ins=expand(
            "results/{{scale}}/posterior/burn_in_{{kind}}_T{samples}.csv", samples=SAMPLES
        ),
    log:
        "results/{scale}/logs/posterior/{kind}.log",
    benchmark:
        "results/{scale}/benchmarks/posterior/{kind}.tsv"
    wildcard_constraints:
        kind=MEASURED_KINDS,
    threads: 1
    resources:
        mem_mb=4000,
        runtime=30,
    params:
        settings=lambda wc: effective(config, wc.scale, "paper2017", "paper2021", "experiment"),
    script:
        "../scripts/judge_chains.py"


rule figure_residuals:
    input:
        summary="results/measured/residuals/{name}.csv",
        histogram="results/measured/residuals/{name}_histogram.csv",
        code=DRAWING,
    output:
        pdf="results/measured/figures/residuals_{name}.pdf",
        png=report(
            "results/measured/figures/residuals_{name}.png",
            caption="../report/measured_residuals.rst",
            category="Measured",
        ),
        csv="results/measured/figures/residuals_{name}.csv",
    log:
        "results/measured/logs/figures/residuals_{name}.log",
    benchmark:
        "results/measured/benchmarks/figures/residuals_{name}.tsv"
    threads: 1
    resources:
        mem_mb=1000,
        runtime=10,
    params:
        settings=effective(config, config["scale"], scaled=False),
    script:
        "../scripts/figure_residuals.py"


rule figure_noise:
    input:
        allan="results/measured/first_order/{name}_allan.csv",
        code=DRAWING,
    output:
        pdf="results/measured/figures/noise_{name}.pdf",
        png=report(
            "results/measured/figures/noise_{name}.png",
            caption="../report/measured_noise.rst",
            category="Measured",
        ),
        csv="results/measured/figures/noise_{name}.csv",
    log:
        "results/measured/logs/figures/noise_{name}.log",
    benchmark:
        "results/measured/benchmarks/figures/noise_{name}.tsv"
    threads: 1
    resources:
        mem_mb=1000,
        runtime=10,
    params:
        settings=effective(config, config["scale"], scaled=False),
    script:
        "../scripts/figure_noise.py"


rule figure_agreement:
    input:
        summary="results/measured/agreement/{group}.csv",
        pairs="results/measured/agreement/{group}_pairs.csv",
        code=DRAWING,
    output:
        pdf="results/measured/figures/agreement_{group}.pdf",
        png=report(
            "results/measured/figures/agreement_{group}.png",
            caption="../report/measured_agreement.rst",
            category="Measured",
        ),
        csv="results/measured/figures/agreement_{group}.csv",
    log:
        "results/measured/logs/figures/agreement_{group}.log",
    benchmark:
        "results/measured/benchmarks/figures/agreement_{group}.tsv"
    threads: 1
    resources:
        mem_mb=1000,
        runtime=10,
    params:
        settings=effective(config, config["scale"], scaled=False),
    script:
        "../scripts/figure_agreement.py"


rule table_first_order:
    input:
        residuals=lambda wc: expand(
            "results/measured/first_order/{name}_residuals.csv", name=MEASURED.board(wc.group)
        ),
        noise=lambda wc: expand(
            "results/measured/first_order/{name}_noise.csv", name=MEASURED.board(wc.group)
        ),
        code=library("figures"),
    output:
        csv=report(
            "results/measured/tables/first_order_{group}.csv",
            caption="../report/measured_first_order_table.rst",
            category="Measured",
        ),
        tex="results/measured/tables/first_order_{group}.tex",
        md="results/measured/tables/first_order_{group}.md",
    log:
        "results/measured/logs/tables/first_order_{group}.log",
    benchmark:
        "results/measured/benchmarks/tables/first_order_{group}.tsv"
    threads: 1
    resources:
        mem_mb=1000,
        runtime=10,
    params:
        names=lambda wc: MEASURED.board(wc.group),
    script:
        "../scripts/table_first_order.py"


rule table_agreement:
    input:
        summary="results/measured/agreement/{group}.csv",
        code=library("figures"),
    output:
        csv=report(
            "results/measured/tables/agreement_{group}.csv",
            caption="../report/measured_agreement_table.rst",
            category="Measured",
        ),
        tex="results/measured/tables/agreement_{group}.tex",
        md="results/measured/tables/agreement_{group}.md",
    log:
        "results/measured/logs/tables/agreement_{group}.log",
    benchmark:
        "results/measured/benchmarks/tables/agreement_{group}.tsv"
    threads: 1
    resources:
        mem_mb=1000,
        runtime=10,
    script:
        "../scripts/table_agreement.py"
