# What the papers' model gets wrong on each measured recording; all of them: the target `diagnose`.


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
    priority: 10
    threads: 1
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
