# A rule for each figure and table that `draw` was told of.
for function, drawn in DRAWINGS.items():

    rule:
        name:
            function
        input:
            **drawn["input"],
        output:
            **drawn["output"],
        log:
            drawn["log"],
        benchmark:
            drawn["benchmark"]
        resources:
            mem_mb=3000,
        params:
            **drawn["params"],
        message:
            drawn["message"]
        script:
            "../scripts/publish.py"
