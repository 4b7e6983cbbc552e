rule sample_experiment:
    input:
        recording="results/{scale}/recordings/{kind}.nc",
    output:
        of_samples("chains/{kind}_T{samples}.nc"),
    log:
        "results/{scale}/logs/chains/{kind}.log",
    benchmark:
        "results/{scale}/benchmarks/chains/{kind}.tsv"
    priority: 8
    threads: lambda wc: CORES.threads(wc.scale)
    resources:
        mem_mb=4000,
        runtime=60,
    params:
        settings=sections("paper2017", "paper2021", "experiment"),
        lengths="experiment_transitions",
        code=code("sample_experiment"),
    message:
        "chains of the experiment: {wildcards.kind} ({wildcards.scale})"
    script:
        "../scripts/sample_experiment.py"


rule judge_experiment:
    input:
        recordings="results/{scale}/recordings/{kind}.nc",
        chains=of_samples("chains/{kind}_T{samples}.nc"),
    output:
        verdicts=of_samples("posterior/{kind}_T{samples}.json"),
        coordinates=of_samples("posterior/{kind}_T{samples}.csv"),
        burn_ins=of_samples("posterior/burn_in_{kind}_T{samples}.csv"),
    log:
        "results/{scale}/logs/posterior/{kind}.log",
    benchmark:
        "results/{scale}/benchmarks/posterior/{kind}.tsv"
    resources:
        mem_mb=4000,
    params:
        settings=sections("paper2017", "paper2021", "experiment"),
        code=code("judge_chains"),
    message:
        "chains of {wildcards.kind}: burn-in, R-hat, effective sample size ({wildcards.scale})"
    script:
        "../scripts/judge_chains.py"
