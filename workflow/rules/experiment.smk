rule sample_experiment:
    input:
        recording="results/{scale}/recordings/{kind}.nc",
        code=library("posterior"),
    output:
        "results/{scale}/chains/{kind}_T{samples}.nc",
    log:
        "results/{scale}/logs/chains/{kind}_T{samples}.log",
    benchmark:
        "results/{scale}/benchmarks/chains/{kind}_T{samples}.tsv"
    threads: 2
    resources:
        mem_mb=4000,
        runtime=60,
    params:
        settings=lambda wc: effective(config, wc.scale, "paper2017", "paper2021", "experiment"),
    script:
        "../scripts/sample_experiment.py"


rule judge_experiment:
    input:
        recording="results/{scale}/recordings/{kind}.nc",
        chains="results/{scale}/chains/{kind}_T{samples}.nc",
        code=library("posterior"),
    output:
        verdict="results/{scale}/posterior/{kind}_T{samples}.json",
        coordinates="results/{scale}/posterior/{kind}_T{samples}.csv",
        burn_in="results/{scale}/posterior/burn_in_{kind}_T{samples}.csv",
    log:
        "results/{scale}/logs/posterior/{kind}_T{samples}.log",
    benchmark:
        "results/{scale}/benchmarks/posterior/{kind}_T{samples}.tsv"
    threads: 1
    resources:
        mem_mb=4000,
        runtime=30,
    params:
        settings=lambda wc: effective(config, wc.scale, "paper2017", "paper2021", "experiment"),
    script:
        "../scripts/judge_chains.py"
