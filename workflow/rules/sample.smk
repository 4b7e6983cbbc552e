rule sample_posterior:
    input:
        recording="results/{scale}/recordings/T{samples}.nc",
        tuning="results/{scale}/tuning/T{samples}.json",
    output:
        "results/{scale}/chains/T{samples}.nc",
    log:
        "results/{scale}/logs/chains/T{samples}.log",
    benchmark:
        "results/{scale}/benchmarks/chains/T{samples}.tsv"
    priority: 10  # the longest path
    threads: lambda wc: CORES.threads(wc.scale)
    resources:
        mem_mb=4000,
        runtime=90,
    params:
        settings=sections("paper2021"),
        code=code("sample_posterior"),
    message:
        "chains, T = {wildcards.samples} ({wildcards.scale})"
    script:
        "../scripts/sample_posterior.py"


rule judge_chains:
    input:
        recordings=of_samples("recordings/T{samples}.nc"),
        chains=of_samples("chains/T{samples}.nc"),
    output:
        verdicts=of_samples("posterior/T{samples}.json"),
        coordinates=of_samples("posterior/T{samples}.csv"),
        burn_ins=of_samples("posterior/burn_in_T{samples}.csv"),
    log:
        "results/{scale}/logs/posterior/samples.log",
    benchmark:
        "results/{scale}/benchmarks/posterior/samples.tsv"
    resources:
        mem_mb=4000,
    params:
        settings=sections("paper2021"),
        code=code("judge_chains"),
    message:
        "chains of the simulation: burn-in, R-hat, effective sample size ({wildcards.scale})"
    script:
        "../scripts/judge_chains.py"
