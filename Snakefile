# Entry point: `snakemake --cores 2` here runs the whole pipeline in workflow/.


include: "workflow/Snakefile"


rule default:
    default_target: True
    input:
        rules.all.input,
    message:
        "all figures, tables and claims"
