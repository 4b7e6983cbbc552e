PAGES = [
    workflow.source_path(f"../scripts/{name}.typ") for name in ("findings", "findings_results")
]


# A paper of four pages; every number and figure in it is read from the published files.
rule findings:
    input:
        pages=PAGES,
        papers=workflow.source_path("../../CITATION.cff"),
        data=expand(
            "paper_figures/{name}", name=read_by(text_of("../scripts/findings_results.typ"))
        ),
    output:
        "paper_figures/findings.pdf",
    log:
        "results/logs/publish/findings.log",
    benchmark:
        "results/benchmarks/publish/findings.tsv"
    params:
        settings=config,
        code=code("findings"),
    message:
        "{output}"
    script:
        "../scripts/findings.py"
