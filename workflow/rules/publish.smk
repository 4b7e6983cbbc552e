# paper_figures/ holds the configured scale's figures; every scale keeps its own in results/.
rule copy_published:
    input:
        lambda wc: "{}.{}".format(MEASURED.origin(wc.name), wc.kind),
    output:
        "paper_figures/{name}.{kind}",
    log:
        "results/logs/publish/{name}.{kind}.log",
    wildcard_constraints:
        name="|".join([*PLACES, "measured_.*"]),
        kind="pdf|png|csv|tex|md",
    message:
        "{output}"
    shell:
        "cp {input:q} {output:q} 2> {log:q}"


# Drawings of one cause of a diagnosis, asked for by name.
rule copy_cause:
    input:
        "results/measured/diagnosis/{name}/diagnosis.json",
    output:
        "paper_figures/cause_{effect}_{name}.{kind}",
    log:
        "results/logs/publish/cause_{effect}_{name}.{kind}.log",
    wildcard_constraints:
        effect="[a-z_]+",
        name="|".join(RECORDINGS) or "none",
        kind="pdf|png|csv",
    message:
        "{output}"
    shell:
        "cp $(dirname {input:q})/cause_*_{wildcards.effect}.{wildcards.kind} {output:q} 2> {log:q}"
