PAGES = [f"{ROOT}/workflow/scripts/{name}.typ" for name in ("findings", "findings_results")]


# A paper of four pages; every number and figure in it is read from the published files.
rule findings:
    input:
        pages=PAGES,
        data=read_by(PAGES[1]),
    output:
        "paper_figures/findings.pdf",
    log:
        "results/logs/publish/findings.log",
    benchmark:
        "results/benchmarks/publish/findings.tsv"
    params:
        code=CODE.digest("findings"),
    message:
        "{output}"
    script:
        "../scripts/findings.py"
