# What the papers' model gets wrong on each measured recording; its own target, `diagnose`.


rule diagnose_recording:
    input:
        recording=lambda wc: MEASURED.recording(wc.name),
    output:
        diagnosis="results/measured/diagnosis/{name}/diagnosis.json",
        report=report(
            "results/measured/diagnosis/{name}/report.html",
            caption="../report/diagnosis.rst",
            category="Diagnosis",
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
        code=code("diagnose_recording"),
    message:
        "diagnosis of {wildcards.name}"
    script:
        "../scripts/diagnose_recording.py"


rule diagnosis_agreement:
    input:
        diagnoses=lambda wc: expand(
            "results/measured/diagnosis/{name}/diagnosis.json", name=MEASURED.groups()[wc.group]
        ),
    output:
        **figure("diagnosis_{group}", "Diagnosis", caption="diagnosis", folder="results/measured"),
        positions="results/measured/tables/diagnosis_positions_{group}.csv",
        parameters="results/measured/tables/diagnosis_parameters_{group}.csv",
        recordings="results/measured/tables/diagnosis_recordings_{group}.csv",
    log:
        "results/measured/logs/diagnosis_{group}.log",
    benchmark:
        "results/measured/benchmarks/diagnosis_{group}.tsv"
    params:
        code=code("diagnosis_agreement"),
    message:
        "diagnoses of {wildcards.group}, compared"
    script:
        "../scripts/diagnosis_agreement.py"


rule add_effect:
    input:
        recording=lambda wc: MEASURED.recording(wc.name),
    output:
        recording="results/measured/added/{name}/{effect}.nc",
        truth="results/measured/added/{name}/{effect}.json",
    log:
        "results/measured/logs/added/{name}_{effect}.log",
    benchmark:
        "results/measured/benchmarks/added/{name}_{effect}.tsv"
    wildcard_constraints:
        effect="[a-z_]+",
    params:
        settings=lambda wc: {"seed": config["seed"]},
        code=code("add_effect"),
    message:
        "{wildcards.effect} added to {wildcards.name}"
    script:
        "../scripts/add_effect.py"


use rule diagnose_recording as diagnose_added with:
    input:
        recording="results/measured/added/{name}/{effect}.nc",
    output:
        diagnosis="results/measured/added/{name}/{effect}/diagnosis.json",
        report="results/measured/added/{name}/{effect}/report.html",
    log:
        "results/measured/logs/added/{name}_{effect}_diagnosis.log",
    benchmark:
        "results/measured/benchmarks/added/{name}_{effect}_diagnosis.tsv"
    wildcard_constraints:
        effect="[a-z_]+",
    threads: 1
    message:
        "diagnosis of {wildcards.name} with {wildcards.effect} added"


rule table_added:
    input:
        before="results/measured/diagnosis/{name}/diagnosis.json",
        truths=lambda wc: expand(
            "results/measured/added/{{name}}/{effect}.json", effect=added_effects()
        ),
        after=lambda wc: expand(
            "results/measured/added/{{name}}/{effect}/diagnosis.json", effect=added_effects()
        ),
    output:
        **table("added_{name}", folder="results/measured"),
    log:
        "results/measured/logs/added/{name}.log",
    benchmark:
        "results/measured/benchmarks/added/{name}.tsv"
    params:
        **by("figures.blind.table_added"),
    message:
        "table: effects added to {wildcards.name}"
    script:
        "../scripts/publish.py"
