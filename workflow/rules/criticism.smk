# The heart of it: what the papers' model gets wrong on the real board, and effects that are hidden
# in recordings, simulated and real, and must be found.


rule figure_criticism:
    input:
        summary=f"results/measured/residuals/{SHOWN}.csv",
        noise=f"results/measured/first_order/{SHOWN}_noise.csv",
        diagnosis=f"results/measured/diagnosis/{SHOWN}/diagnosis.json",
        causes=f"results/measured/causes_{MEASURED.group(SHOWN)}.csv",
        predicted=f"results/measured/predicted/{SHOWN}.csv",
    output:
        **figure("criticism", "Criticism", folder="results/measured"),
    log:
        "results/measured/logs/figures/criticism.log",
    benchmark:
        "results/measured/benchmarks/figures/criticism.tsv"
    params:
        **by("figures.criticism.figure_criticism"),
        name=SHOWN,
        group=MEASURED.group(SHOWN),
    message:
        "figure: what is wrong, why, and what the cause gains"
    script:
        "../scripts/publish.py"


rule table_criticism:
    input:
        **{key: path for key, path in rules.figure_criticism.input.items()},
        recordings=MEASURED.recording(SHOWN),
    output:
        **table("criticism_table", "Criticism", folder="results/measured"),
    log:
        "results/measured/logs/tables/criticism_table.log",
    benchmark:
        "results/measured/benchmarks/tables/criticism_table.tsv"
    params:
        **by("figures.criticism.table_criticism"),
        name=SHOWN,
        group=MEASURED.group(SHOWN),
    message:
        "table: what is wrong, why, and what the cause gains"
    script:
        "../scripts/publish.py"


rule hide:
    output:
        recording="results/measured/hidden/{hidden}.nc",
        truth="results/measured/hidden/{hidden}.json",
    log:
        "results/measured/logs/hidden/{hidden}.log",
    benchmark:
        "results/measured/benchmarks/hidden/{hidden}.tsv"
    wildcard_constraints:
        hidden="lever_arms|drawn|nothing",
    priority: 10
    params:
        settings={"seed": config["seed"]},
        code=code("hide"),
    message:
        "a simulated recording, hidden: {wildcards.hidden}"
    script:
        "../scripts/hide.py"


use rule hide as hide_measured with:
    input:
        recording=MEASURED.recording(SHOWN),
        diagnosis=f"results/measured/diagnosis/{SHOWN}/diagnosis.json",
    wildcard_constraints:
        hidden="measured",
    message:
        "an effect hidden in a real recording"


use rule diagnose_recording as diagnose_hidden with:
    input:
        recording="results/measured/hidden/{hidden}.nc",
    output:
        diagnosis="results/measured/hidden/{hidden}/diagnosis.json",
        report="results/measured/hidden/{hidden}/report.html",
    log:
        "results/measured/logs/hidden/{hidden}_diagnosis.log",
    benchmark:
        "results/measured/benchmarks/hidden/{hidden}_diagnosis.tsv"
    wildcard_constraints:
        hidden="[a-z_]+",
    message:
        "diagnosis, hidden: {wildcards.hidden}"


rule figure_criticism_hidden:
    input:
        diagnosis="results/measured/hidden/lever_arms/diagnosis.json",
        truth="results/measured/hidden/lever_arms.json",
        recordings="results/measured/hidden/lever_arms.nc",
    output:
        **figure("criticism_hidden", "Criticism", folder="results/measured"),
    log:
        "results/measured/logs/figures/criticism_hidden.log",
    benchmark:
        "results/measured/benchmarks/figures/criticism_hidden.tsv"
    params:
        **by("figures.hidden.figure_criticism_hidden"),
    message:
        "figure: an effect that was hidden, and found"
    script:
        "../scripts/publish.py"


rule table_criticism_hidden:
    input:
        diagnoses=expand(
            "results/measured/hidden/{hidden}/diagnosis.json", hidden=MEASURED.hidden()
        ),
        truths=expand("results/measured/hidden/{hidden}.json", hidden=MEASURED.hidden()),
        controls=[
            f"results/measured/{MEASURED.control(hidden)}/diagnosis.json"
            for hidden in MEASURED.hidden()
        ],
    output:
        **table("criticism_hidden_table", "Criticism", folder="results/measured"),
    log:
        "results/measured/logs/tables/criticism_hidden_table.log",
    benchmark:
        "results/measured/benchmarks/tables/criticism_hidden_table.tsv"
    params:
        **by("figures.hidden.table_criticism_hidden"),
        names=["simulated", "simulated", SHOWN][: len(MEASURED.hidden())],
    message:
        "table: effects that were hidden, and what was found"
    script:
        "../scripts/publish.py"
