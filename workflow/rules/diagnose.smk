# What the papers' model gets wrong on each measured recording; its own target, `diagnose`.
DIAGNOSED = resting_on(
    "criticism/diagnosis.py",
    "report/write.py",
    "criticism/thresholds.json",
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
            "criticism/repeatability.py", "figures/criticism_repeatability.py", "provenance.py"
        ),
    output:
        positions="results/measured/tables/diagnosis_positions_{group}.csv",
        parameters="results/measured/tables/diagnosis_parameters_{group}.csv",
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
