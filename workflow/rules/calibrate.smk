rule position_error_samples:
    input:
        code=library("estimation"),
    output:
        "results/{scale}/calibration/position_error_samples.csv",
    log:
        "results/{scale}/logs/calibration/position_error_samples.log",
    benchmark:
        "results/{scale}/benchmarks/calibration/position_error_samples.tsv"
    threads: lambda wc: heavy(wc.scale)
    resources:
        mem_mb=2000,
        runtime=90,
    params:
        settings=lambda wc: effective(config, wc.scale, "paper2017"),
    script:
        "../scripts/position_error_samples.py"


rule position_error_motion:
    input:
        code=library("estimation"),
    output:
        "results/{scale}/calibration/position_error_motion.csv",
    log:
        "results/{scale}/logs/calibration/position_error_motion.log",
    benchmark:
        "results/{scale}/benchmarks/calibration/position_error_motion.tsv"
    threads: lambda wc: heavy(wc.scale)
    resources:
        mem_mb=2000,
        runtime=90,
    params:
        settings=lambda wc: effective(config, wc.scale, "paper2017"),
    script:
        "../scripts/position_error_motion.py"


rule position_error_force:
    input:
        code=library("estimation"),
    output:
        "results/{scale}/calibration/position_error_force.csv",
    log:
        "results/{scale}/logs/calibration/position_error_force.log",
    benchmark:
        "results/{scale}/benchmarks/calibration/position_error_force.tsv"
    threads: lambda wc: heavy(wc.scale)
    resources:
        mem_mb=2000,
        runtime=90,
    params:
        settings=lambda wc: effective(config, wc.scale, "paper2017"),
    script:
        "../scripts/position_error_force.py"


rule rate_error:
    input:
        code=library("estimation"),
    output:
        "results/{scale}/calibration/rate_error.csv",
    log:
        "results/{scale}/logs/calibration/rate_error.log",
    benchmark:
        "results/{scale}/benchmarks/calibration/rate_error.tsv"
    threads: lambda wc: heavy(wc.scale)
    resources:
        mem_mb=2000,
        runtime=90,
    params:
        settings=lambda wc: effective(config, wc.scale, "paper2017"),
    script:
        "../scripts/rate_error.py"
