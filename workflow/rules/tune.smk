rule sweep_variance:
    input:
        recordings=expand("results/{{scale}}/recordings/T{samples}.nc", samples=SAMPLES),
    output:
        expand("results/{{scale}}/tuning/variance_T{samples}.csv", samples=SAMPLES),
    log:
        "results/{scale}/logs/tuning/variance.log",
    benchmark:
        "results/{scale}/benchmarks/tuning/variance.tsv"
    priority: 10
    threads: lambda wc: CORES.threads(wc.scale)
    params:
        settings=lambda wc: effective(config, wc.scale, "paper2021"),
        code=code("sweep_variance"),
    message:
        "variance of the log-likelihood estimate over N ({wildcards.scale})"
    script:
        "../scripts/sweep_variance.py"


rule sweep_acceptance:
    input:
        recordings=expand("results/{{scale}}/recordings/T{samples}.nc", samples=SAMPLES),
        variances=expand("results/{{scale}}/tuning/variance_T{samples}.csv", samples=SAMPLES),
    output:
        expand("results/{{scale}}/tuning/acceptance_T{samples}.csv", samples=SAMPLES),
    log:
        "results/{scale}/logs/tuning/acceptance.log",
    benchmark:
        "results/{scale}/benchmarks/tuning/acceptance.tsv"
    priority: 10
    threads: lambda wc: CORES.threads(wc.scale)
    params:
        settings=lambda wc: effective(config, wc.scale, "paper2021"),
        code=code("sweep_acceptance"),
    message:
        "acceptance over the step length ({wildcards.scale})"
    script:
        "../scripts/sweep_acceptance.py"


rule tune:
    input:
        acceptances=expand("results/{{scale}}/tuning/acceptance_T{samples}.csv", samples=SAMPLES),
    output:
        expand("results/{{scale}}/tuning/T{samples}.json", samples=SAMPLES),
    log:
        "results/{scale}/logs/tuning/tune.log",
    benchmark:
        "results/{scale}/benchmarks/tuning/tune.tsv"
    priority: 10
    params:
        settings=lambda wc: effective(config, wc.scale, "paper2021"),
        code=code("tune"),
    message:
        "tuning: N and the step length ({wildcards.scale})"
    script:
        "../scripts/tune.py"
