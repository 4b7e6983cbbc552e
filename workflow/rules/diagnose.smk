from imuarray.blind.added import ADDED

# What the papers' model gets wrong on each measured recording; its own target, `diagnose`.
DIAGNOSED = resting_on(
    "diagnosis/document.py",
    "report/write.py",
    "figures/imuarray.mplstyle",
    "provenance.py",
)


rule diagnose_recording:
    input:
        recording=lambda wc: "results/measured/{}/{}.nc".format(
            "corrected" if RECORDINGS[wc.name].get("first_order", True) else "recordings", wc.name
        ),
        code=DIAGNOSED,
    output:
        diagnosis="results/measured/diagnosis/{name}/diagnosis.json",
        report=report(
            "results/measured/diagnosis/{name}/report.html",
            caption="../report/diagnosis.rst",
            category="Model criticism",
        ),
    log:
        "results/measured/logs/diagnosis/{name}.log",
    benchmark:
        "results/measured/benchmarks/diagnosis/{name}.tsv"
    threads: 2
    resources:
        mem_mb=8000,
        runtime=60,
    params:
        settings=lambda wc: {"seed": config["seed"]},
    script:
        "../scripts/diagnose_recording.py"


rule diagnosis_agreement:
    input:
        diagnoses=lambda wc: expand(
            "results/measured/diagnosis/{name}/diagnosis.json", name=MEASURED.groups()[wc.group]
        ),
        code=resting_on(
            "diagnosis/repeatability.py",
            "report/repeatability.py",
            "figures/imuarray.mplstyle",
            "provenance.py",
        ),
    output:
        positions="results/measured/tables/diagnosis_positions_{group}.csv",
        parameters="results/measured/tables/diagnosis_parameters_{group}.csv",
        recordings="results/measured/tables/diagnosis_recordings_{group}.csv",
        pdf="results/measured/figures/diagnosis_{group}.pdf",
        png=report(
            "results/measured/figures/diagnosis_{group}.png",
            caption="../report/diagnosis.rst",
            category="Model criticism",
        ),
        csv="results/measured/figures/diagnosis_{group}.csv",
    log:
        "results/measured/logs/diagnosis_{group}.log",
    benchmark:
        "results/measured/benchmarks/diagnosis_{group}.tsv"
    threads: 1
    resources:
        mem_mb=1000,
        runtime=10,
    script:
        "../scripts/diagnosis_agreement.py"


rule past_rail:
    input:
        recording=lambda wc: "results/measured/{}/{}.nc".format(
            "corrected" if RECORDINGS[wc.name].get("first_order", True) else "recordings", wc.name
        ),
        diagnosis="results/measured/diagnosis/{name}/diagnosis.json",
        elsewhere=lambda wc: [
            f"results/measured/diagnosis/{other}/diagnosis.json"
            for other in MEASURED.others(wc.name)[:1]
        ],
        code=resting_on(
            "analysis/past_rail.py",
            "analysis/extension.py",
            "figures/past_rail.py",
            "figures/imuarray.mplstyle",
            "provenance.py",
        ),
    output:
        pdf="results/measured/figures/past_rail_{name}.pdf",
        png=report(
            "results/measured/figures/past_rail_{name}.png",
            caption="../report/past_rail.rst",
            category="Model criticism",
        ),
        csv="results/measured/figures/past_rail_{name}.csv",
    log:
        "results/measured/logs/past_rail_{name}.log",
    benchmark:
        "results/measured/benchmarks/past_rail_{name}.tsv"
    threads: 1
    resources:
        mem_mb=4000,
        runtime=20,
    params:
        others=lambda wc: MEASURED.others(wc.name),
    script:
        "../scripts/past_rail.py"


rule add_effect:
    input:
        recording=lambda wc: "results/measured/{}/{}.nc".format(
            "corrected" if RECORDINGS[wc.name].get("first_order", True) else "recordings", wc.name
        ),
        code=resting_on("blind/added.py", "recording/format.py", "provenance.py"),
    output:
        recording="results/measured/added/{name}/{effect}.nc",
        truth="results/measured/added/{name}/{effect}.json",
    log:
        "results/measured/logs/added/{name}_{effect}.log",
    benchmark:
        "results/measured/benchmarks/added/{name}_{effect}.tsv"
    wildcard_constraints:
        effect="|".join(ADDED),
    threads: 1
    resources:
        mem_mb=2000,
        runtime=10,
    params:
        settings=lambda wc: {"seed": config["seed"]},
    script:
        "../scripts/add_effect.py"


rule diagnose_added:
    input:
        recording="results/measured/added/{name}/{effect}.nc",
        code=DIAGNOSED,
    output:
        diagnosis="results/measured/added/{name}/{effect}/diagnosis.json",
        report="results/measured/added/{name}/{effect}/report.html",
    log:
        "results/measured/logs/added/{name}_{effect}_diagnosis.log",
    benchmark:
        "results/measured/benchmarks/added/{name}_{effect}_diagnosis.tsv"
    wildcard_constraints:
        effect="|".join(ADDED),
    threads: 1
    resources:
        mem_mb=8000,
        runtime=60,
    params:
        settings=lambda wc: {"seed": config["seed"]},
    script:
        "../scripts/diagnose_recording.py"


rule grade_added:
    input:
        before="results/measured/diagnosis/{name}/diagnosis.json",
        truths=expand("results/measured/added/{{name}}/{effect}.json", effect=ADDED),
        after=expand("results/measured/added/{{name}}/{effect}/diagnosis.json", effect=ADDED),
        code=resting_on("blind/added.py", "figures/blind_tables.py", "provenance.py"),
    output:
        csv="results/measured/tables/added_{name}.csv",
        tex="results/measured/tables/added_{name}.tex",
        md="results/measured/tables/added_{name}.md",
    log:
        "results/measured/logs/added/{name}.log",
    benchmark:
        "results/measured/benchmarks/added/{name}.tsv"
    threads: 1
    resources:
        mem_mb=1000,
        runtime=10,
    script:
        "../scripts/grade_added.py"
