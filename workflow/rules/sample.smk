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
        settings=lambda wc: effective(config, wc.scale, "paper2021"),
        code=code("sample_posterior"),
    message:
        "chains, T = {wildcards.samples} ({wildcards.scale})"
    script:
        "../scripts/sample_posterior.py"


rule judge_chains:
    input:
        recordings=expand("results/{{scale}}/recordings/T{samples}.nc", samples=SAMPLES),
        chains=expand("results/{{scale}}/chains/T{samples}.nc", samples=SAMPLES),
    output:
        verdicts=expand("results/{{scale}}/posterior/T{samples}.json", samples=SAMPLES),
        coordinates=expand("results/{{scale}}/posterior/T{samples}.csv", samples=SAMPLES),
        burn_ins=expand("results/{{scale}}/posterior/burn_in_T{samples}.csv", samples=SAMPLES),
    log:
        "results/{scale}/logs/posterior/samples.log",
    benchmark:
        "results/{scale}/benchmarks/posterior/samples.tsv"
    resources:
        mem_mb=4000,
    params:
        settings=lambda wc: effective(config, wc.scale, "paper2021"),
        code=code("judge_chains"),
    message:
        "chains of the simulation: burn-in, R-hat, effective sample size ({wildcards.scale})"
    script:
        "../scripts/judge_chains.py"
