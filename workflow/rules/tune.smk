rule sweep_variance:
    input:
        recording="results/{scale}/recordings/T{samples}.nc",
        code=library("posterior"),
    output:
        "results/{scale}/tuning/variance_T{samples}.csv",
    log:
        "results/{scale}/logs/tuning/variance_T{samples}.log",
    benchmark:
        "results/{scale}/benchmarks/tuning/variance_T{samples}.tsv"
    threads: 1
    resources:
        mem_mb=2000,
        runtime=30,
    params:
        settings=lambda wc: effective(config, wc.scale, "paper2021"),
    script:
        "../scripts/sweep_variance.py"


rule sweep_acceptance:
    input:
        recording="results/{scale}/recordings/T{samples}.nc",
        variance="results/{scale}/tuning/variance_T{samples}.csv",
        code=library("posterior"),
    output:
        "results/{scale}/tuning/acceptance_T{samples}.csv",
    log:
        "results/{scale}/logs/tuning/acceptance_T{samples}.log",
    benchmark:
        "results/{scale}/benchmarks/tuning/acceptance_T{samples}.tsv"
    threads: 1
    resources:
        mem_mb=2000,
        runtime=30,
    params:
        settings=lambda wc: effective(config, wc.scale, "paper2021"),
    script:
        "../scripts/sweep_acceptance.py"


rule tune:
    input:
        variance="results/{scale}/tuning/variance_T{samples}.csv",
        acceptance="results/{scale}/tuning/acceptance_T{samples}.csv",
        code=library("posterior"),
    output:
        "results/{scale}/tuning/T{samples}.json",
    log:
        "results/{scale}/logs/tuning/T{samples}.log",
    benchmark:
        "results/{scale}/benchmarks/tuning/T{samples}.tsv"
    threads: 1
    resources:
        mem_mb=2000,
        runtime=30,
    params:
        settings=lambda wc: effective(config, wc.scale, "paper2021"),
    script:
        "../scripts/tune.py"
