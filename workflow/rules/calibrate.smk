# what each study of position errors depends on
STUDIES = {"samples": "paper2017.fig4", "motion": "paper2017.fig5", "force": "paper2017"}


rule position_error_part:
    output:
        "results/{scale}/calibration/parts/{study}_{part}.npz",
    log:
        "results/{scale}/logs/calibration/parts/{study}_{part}.log",
    benchmark:
        "results/{scale}/benchmarks/calibration/parts/{study}_{part}.tsv"
    priority: 8
    threads: lambda wc: CORES.threads(wc.scale)
    resources:
        runtime=90,
    params:
        settings=lambda wc: effective(config, wc.scale, STUDIES[wc.study]),
        parts=lambda wc: CORES.parts(wc.scale, wc.study),
        code=code("position_error_part"),
    message:
        "position error of 2017 over {wildcards.study}, part {wildcards.part} ({wildcards.scale})"
    script:
        "../scripts/position_error_part.py"


rule position_error:
    input:
        parts=lambda wc: expand(
            "results/{{scale}}/calibration/parts/{{study}}_{part}.npz",
            part=range(CORES.parts(wc.scale, wc.study)),
        ),
    output:
        "results/{scale}/calibration/position_error_{study}.csv",
    log:
        "results/{scale}/logs/calibration/position_error_{study}.log",
    benchmark:
        "results/{scale}/benchmarks/calibration/position_error_{study}.tsv"
    params:
        settings=lambda wc: effective(config, wc.scale, STUDIES[wc.study]),
        code=code("position_error"),
    message:
        "position error of 2017 over {wildcards.study} ({wildcards.scale})"
    script:
        "../scripts/position_error.py"


rule rate_error:
    output:
        "results/{scale}/calibration/rate_error.csv",
    log:
        "results/{scale}/logs/calibration/rate_error.log",
    benchmark:
        "results/{scale}/benchmarks/calibration/rate_error.tsv"
    threads: lambda wc: CORES.threads(wc.scale)
    resources:
        runtime=90,
    params:
        settings=sections("paper2017.fig3"),
        code=code("rate_error"),
    message:
        "angular rate error of 2017 ({wildcards.scale})"
    script:
        "../scripts/rate_error.py"
