rule sample_posterior:
    input:
        recording="results/{scale}/recordings/T{samples}.nc",
        tuning="results/{scale}/tuning/T{samples}.json",
        code=library("posterior"),
    output:
        "results/{scale}/chains/T{samples}.nc",
    log:
        "results/{scale}/logs/chains/T{samples}.log",
    benchmark:
        "results/{scale}/benchmarks/chains/T{samples}.tsv"
    priority: 10  # the longest path
    threads: lambda wc: CREW.threads(wc.scale)
    resources:
        mem_mb=4000,
        runtime=90,
    params:
        settings=lambda wc: effective(config, wc.scale, "paper2021"),
    script:
        "../scripts/sample_posterior.py"


rule judge_chains:
    input:
        recordings=expand("results/{{scale}}/recordings/T{samples}.nc", samples=SAMPLES),
        chains=expand("results/{{scale}}/chains/T{samples}.nc", samples=SAMPLES),
        code=library("posterior"),
    output:
        verdicts=expand("results/{{scale}}/posterior/T{samples}.json", samples=SAMPLES),
        coordinates=expand("results/{{scale}}/posterior/T{samples}.csv", samples=SAMPLES),
        burn_ins=expand("results/{{scale}}/posterior/burn_in_T{samples}.csv", samples=SAMPLES),
    log:
        "results/{scale}/logs/posterior/samples.log",
    benchmark:
        "results/{scale}/benchmarks/posterior/samples.tsv"
    threads: 1
    resources:
        mem_mb=4000,
        runtime=30,
    params:
        settings=lambda wc: effective(config, wc.scale, "paper2021"),
    script:
        "../scripts/judge_chains.py"
