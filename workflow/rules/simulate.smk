rule simulate_samples:
    input:
        code=library("simulation"),
    output:
        expand("results/{{scale}}/recordings/T{samples}.nc", samples=SAMPLES),
    log:
        "results/{scale}/logs/recordings/samples.log",
    benchmark:
        "results/{scale}/benchmarks/recordings/samples.tsv"
    priority: 10
    threads: 1
    resources:
        mem_mb=2000,
        runtime=30,
    params:
        settings=lambda wc: effective(config, wc.scale, "paper2021"),
    script:
        "../scripts/simulate_samples.py"


rule simulate_experiment:
    input:
        code=library("simulation"),
    output:
        "results/{scale}/recordings/{kind}.nc",
    log:
        "results/{scale}/logs/recordings/{kind}.log",
    benchmark:
        "results/{scale}/benchmarks/recordings/{kind}.tsv"
    threads: 1
    resources:
        mem_mb=2000,
        runtime=30,
    params:
        settings=lambda wc: effective(config, wc.scale, "paper2017", "paper2021", "experiment"),
    script:
        "../scripts/simulate_experiment.py"
