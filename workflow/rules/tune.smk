rule sweep_variance:
    input:
        recordings=of_samples("recordings/T{samples}.nc"),
    output:
        of_samples("tuning/variance_T{samples}.csv"),
    log:
        "results/{scale}/logs/tuning/variance.log",
    benchmark:
        "results/{scale}/benchmarks/tuning/variance.tsv"
    priority: 10
    threads: lambda wc: CORES.threads(wc.scale)
    params:
        settings=sections("paper2021"),
        code=code("sweep_variance"),
    message:
        "variance of the log-likelihood estimate over N ({wildcards.scale})"
    script:
        "../scripts/sweep_variance.py"


rule sweep_acceptance:
    input:
        recordings=of_samples("recordings/T{samples}.nc"),
        variances=of_samples("tuning/variance_T{samples}.csv"),
    output:
        of_samples("tuning/acceptance_T{samples}.csv"),
    log:
        "results/{scale}/logs/tuning/acceptance.log",
    benchmark:
        "results/{scale}/benchmarks/tuning/acceptance.tsv"
    priority: 10
    threads: lambda wc: CORES.threads(wc.scale)
    params:
        settings=sections("paper2021"),
        code=code("sweep_acceptance"),
    message:
        "acceptance over the step length ({wildcards.scale})"
    script:
        "../scripts/sweep_acceptance.py"


rule tune:
    input:
        acceptances=of_samples("tuning/acceptance_T{samples}.csv"),
    output:
        of_samples("tuning/T{samples}.json"),
    log:
        "results/{scale}/logs/tuning/tune.log",
    benchmark:
        "results/{scale}/benchmarks/tuning/tune.tsv"
    priority: 10
    params:
        settings=sections("paper2021"),
        code=code("tune"),
    message:
        "tuning: N and the step length ({wildcards.scale})"
    script:
        "../scripts/tune.py"
