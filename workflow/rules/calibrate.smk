rule position_error_part:
    input:
        code=library("estimation"),
    output:
        "results/{scale}/calibration/parts/{study}_{part}.npz",
    log:
        "results/{scale}/logs/calibration/parts/{study}_{part}.log",
    benchmark:
        "results/{scale}/benchmarks/calibration/parts/{study}_{part}.tsv"
    priority: 8
    threads: lambda wc: CREW.threads(wc.scale)
    resources:
        mem_mb=2000,
        runtime=90,
    params:
        settings=lambda wc: effective(config, wc.scale, "paper2017"),
        parts=lambda wc: CREW.parts(wc.scale, wc.study),
    script:
        "../scripts/position_error_part.py"


rule position_error:
    input:
        parts=lambda wc: expand(
            "results/{{scale}}/calibration/parts/{{study}}_{part}.npz",
            part=range(CREW.parts(wc.scale, wc.study)),
        ),
        code=library("estimation"),
    output:
        "results/{scale}/calibration/position_error_{study}.csv",
    log:
        "results/{scale}/logs/calibration/position_error_{study}.log",
    benchmark:
        "results/{scale}/benchmarks/calibration/position_error_{study}.tsv"
    threads: 1
    resources:
        mem_mb=2000,
        runtime=10,
    params:
        settings=lambda wc: effective(config, wc.scale, "paper2017"),
    script:
        "../scripts/position_error.py"


rule rate_error:
    input:
        code=library("estimation"),
    output:
        "results/{scale}/calibration/rate_error.csv",
    log:
        "results/{scale}/logs/calibration/rate_error.log",
    benchmark:
        "results/{scale}/benchmarks/calibration/rate_error.tsv"
    threads: lambda wc: CREW.threads(wc.scale)
    resources:
        mem_mb=2000,
        runtime=90,
    params:
        settings=lambda wc: effective(config, wc.scale, "paper2017"),
    script:
        "../scripts/rate_error.py"
