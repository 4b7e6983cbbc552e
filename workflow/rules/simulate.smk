rule simulate_samples:
    output:
        of_samples("recordings/T{samples}.nc"),
    log:
        "results/{scale}/logs/recordings/samples.log",
    benchmark:
        "results/{scale}/benchmarks/recordings/samples.tsv"
    priority: 10
    params:
        settings=sections("paper2021"),
        code=code("simulate_samples"),
    message:
        "simulated recordings of 2021 ({wildcards.scale})"
    script:
        "../scripts/simulate_samples.py"


rule simulate_experiment:
    output:
        "results/{scale}/recordings/{kind}.nc",
    log:
        "results/{scale}/logs/recordings/{kind}.log",
    benchmark:
        "results/{scale}/benchmarks/recordings/{kind}.tsv"
    params:
        settings=sections("paper2017", "paper2021", "experiment"),
        code=code("simulate_experiment"),
    message:
        "simulated experiment of 2021: {wildcards.kind} ({wildcards.scale})"
    script:
        "../scripts/simulate_experiment.py"
