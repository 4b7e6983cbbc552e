# All that is published, and what made each file: commit, command, code. `make stale` compares the
# code with the tree's.
rule manifest:
    input:
        rules.all.input,
        rules.theory.input,
        rules.validate.input,
        rules.blind.input,
        expand("paper_figures/claims_paper.{kind}", kind=["csv", "md"]),
        "paper_figures/findings.pdf",
        lambda wc: MEASURED.studied(),
    output:
        "paper_figures/published.csv",
    log:
        "results/logs/publish/published.log",
    benchmark:
        "results/benchmarks/publish/published.tsv"
    params:
        tool=f"{ROOT}/workflow/published.py",
        snakefile=workflow.main_snakefile,
        scale=config["scale"],
        files=lambda wc, input: [name for name in input if name.startswith("paper_figures/")],
    message:
        "{output}"
    shell:
        "python {params.tool:q} write --snakefile {params.snakefile:q} --scale {params.scale}"
        " {params.files:q} 2> {log:q}"
