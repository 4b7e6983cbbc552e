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
    threads: 2
    resources:
        mem_mb=4000,
        runtime=90,
    params:
        settings=lambda wc: effective(config, wc.scale, "paper2021"),
    script:
        "../scripts/sample_posterior.py"


rule judge_chains:
    input:
        recording="results/{scale}/recordings/T{samples}.nc",
        chains="results/{scale}/chains/T{samples}.nc",
        code=library("posterior"),
    output:
        verdict="results/{scale}/posterior/T{samples}.json",
        coordinates="results/{scale}/posterior/T{samples}.csv",
        burn_in="results/{scale}/posterior/burn_in_T{samples}.csv",
    log:
        "results/{scale}/logs/posterior/T{samples}.log",
    benchmark:
        "results/{scale}/benchmarks/posterior/T{samples}.tsv"
    threads: 1
    resources:
        mem_mb=4000,
        runtime=30,
    params:
        settings=lambda wc: effective(config, wc.scale, "paper2021"),
    script:
        "../scripts/judge_chains.py"
