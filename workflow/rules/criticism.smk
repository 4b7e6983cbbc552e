# The heart of it: what the papers' model gets wrong on the real board, and effects that are hidden
# in recordings, simulated and real, and must be found.


CRITICISED = {
    "summary": f"results/measured/residuals/{SHOWN}.csv",
    "noise": f"results/measured/first_order/{SHOWN}_noise.csv",
    "diagnosis": f"results/measured/diagnosis/{SHOWN}/diagnosis.json",
    "causes": f"results/measured/causes_{MEASURED.group(SHOWN)}.csv",
    "predicted": f"results/measured/predicted/{SHOWN}.csv",
}
draw(
    "criticism.figure_criticism",
    "figure: what is wrong, why, and what the cause gains",
    CRITICISED,
    folder="results/measured",
    category="Criticism",
    name=SHOWN,
    group=MEASURED.group(SHOWN),
)
draw(
    "criticism.table_criticism",
    "table: what is wrong, why, and what the cause gains",
    CRITICISED | {"recordings": MEASURED.recording(SHOWN)},
    folder="results/measured",
    output="criticism_table",
    category="Criticism",
    caption="criticism_table",
    name=SHOWN,
    group=MEASURED.group(SHOWN),
)


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


draw(
    "hidden.figure_criticism_hidden",
    "figure: an effect that was hidden, and found",
    {
        "diagnosis": "results/measured/hidden/lever_arms/diagnosis.json",
        "truth": "results/measured/hidden/lever_arms.json",
        "recordings": "results/measured/hidden/lever_arms.nc",
    },
    folder="results/measured",
    category="Criticism",
)
draw(
    "hidden.table_criticism_hidden",
    "table: effects that were hidden, and what was found",
    {
        "diagnoses": expand(
            "results/measured/hidden/{hidden}/diagnosis.json", hidden=MEASURED.hidden()
        ),
        "truths": expand("results/measured/hidden/{hidden}.json", hidden=MEASURED.hidden()),
        "controls": [
            f"results/measured/{MEASURED.control(hidden)}/diagnosis.json"
            for hidden in MEASURED.hidden()
        ],
    },
    folder="results/measured",
    output="criticism_hidden_table",
    category="Criticism",
    caption="criticism_hidden_table",
    names=["simulated", "simulated", SHOWN][: len(MEASURED.hidden())],
)
