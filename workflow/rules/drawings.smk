# A rule for each figure and table that `draw` was told of.
for function, drawing in DRAWINGS.items():

    rule:
        name:
            function
        input:
            **drawing["input"],
        output:
            **drawing["output"],
        log:
            drawing["log"],
        benchmark:
            drawing["benchmark"]
        resources:
            mem_mb=3000,
        params:
            **drawing["params"],
        message:
            drawing["message"]
        script:
            "../scripts/publish.py"
