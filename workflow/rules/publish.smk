# paper_figures/ holds the configured scale's figures; every scale keeps its own in results/.
PUBLISHED = "results/{}/{{}}/{{{{name}}}}.{{{{kind}}}}".format(config["scale"])


rule publish_figure:
    input:
        PUBLISHED.format("figures"),
    output:
        "paper_figures/{name}.{kind}",
    log:
        "results/logs/publish/{name}.{kind}.log",
    wildcard_constraints:
        name=r"\d{4}_fig\d|theory_(efficiency|convergence|size)|validation_ranks",
        kind="pdf|png|csv",
    shell:
        "cp {input:q} {output:q} 2> {log:q}"


rule publish_table:
    input:
        PUBLISHED.format("tables"),
    output:
        "paper_figures/{name}.{kind}",
    log:
        "results/logs/publish/{name}.{kind}.log",
    wildcard_constraints:
        name=r"\d{4}_table\d|theory_ranks|validation_(coverage|joint)",
        kind="csv|tex|md",
    shell:
        "cp {input:q} {output:q} 2> {log:q}"


rule publish_claims:
    input:
        "results/{}/claims/claims.{{kind}}".format(config["scale"]),
    output:
        "paper_figures/claims.{kind}",
    log:
        "results/logs/publish/claims.{kind}.log",
    wildcard_constraints:
        kind="csv|md",
    shell:
        "cp {input:q} {output:q} 2> {log:q}"


rule publish_measured:
    input:
        lambda wc: "results/measured/figures/{}.{}".format(
            MEASURED.published(config["scale"])[wc.name], wc.kind
        ),
    output:
        "paper_figures/{name}.{kind}",
    log:
        "results/logs/publish/{name}.{kind}.log",
    wildcard_constraints:
        name="measured_(residuals|noise|agreement)",
        kind="pdf|png|csv",
    shell:
        "cp {input:q} {output:q} 2> {log:q}"


rule publish_measured_table:
    input:
        lambda wc: "results/measured/tables/{}.{}".format(
            MEASURED.published_tables(config["scale"])[wc.name], wc.kind
        ),
    output:
        "paper_figures/{name}.{kind}",
    log:
        "results/logs/publish/{name}.{kind}.log",
    wildcard_constraints:
        name="measured_[a-z_]+_table",
        kind="csv|tex|md",
    shell:
        "cp {input:q} {output:q} 2> {log:q}"


# Only `snakemake blind` asks for these two.
rule publish_blind_figure:
    input:
        "results/blind/{}/figures/{{name}}.{{kind}}".format(config["scale"]),
    output:
        "paper_figures/{name}.{kind}",
    log:
        "results/logs/publish/{name}.{kind}.log",
    wildcard_constraints:
        name="blind_confusion",
        kind="pdf|png|csv",
    shell:
        "cp {input:q} {output:q} 2> {log:q}"


rule publish_blind_table:
    input:
        "results/blind/{}/tables/{{name}}.{{kind}}".format(config["scale"]),
    output:
        "paper_figures/{name}.{kind}",
    log:
        "results/logs/publish/{name}.{kind}.log",
    wildcard_constraints:
        name="blind_bars",
        kind="csv|tex|md",
    shell:
        "cp {input:q} {output:q} 2> {log:q}"


# And only `snakemake diagnose`, or asking for one by name, for these.
rule publish_diagnosis:
    input:
        "results/measured/figures/diagnosis_{group}.{kind}",
    output:
        "paper_figures/diagnosis_{group}.{kind}",
    log:
        "results/logs/publish/diagnosis_{group}.{kind}.log",
    wildcard_constraints:
        group="(?!(positions|parameters|recordings)_).*",
        kind="pdf|png|csv",
    shell:
        "cp {input:q} {output:q} 2> {log:q}"


rule publish_diagnosis_table:
    input:
        "results/measured/tables/diagnosis_{table}_{group}.csv",
    output:
        "paper_figures/diagnosis_{table}_{group}.csv",
    log:
        "results/logs/publish/diagnosis_{table}_{group}.log",
    wildcard_constraints:
        table="positions|parameters|recordings",
    shell:
        "cp {input:q} {output:q} 2> {log:q}"


rule publish_past_rail:
    input:
        "results/measured/figures/past_rail_{name}.{kind}",
    output:
        "paper_figures/past_rail_{name}.{kind}",
    log:
        "results/logs/publish/past_rail_{name}.{kind}.log",
    wildcard_constraints:
        name="|".join(RECORDINGS) or "none",
        kind="pdf|png|csv",
    shell:
        "cp {input:q} {output:q} 2> {log:q}"


rule publish_cause:
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
    shell:
        "cp $(dirname {input:q})/cause_*_{wildcards.effect}.{wildcards.kind} {output:q} 2> {log:q}"


rule publish_added:
    input:
        "results/measured/tables/added_{name}.{kind}",
    output:
        "paper_figures/added_{name}.{kind}",
    log:
        "results/logs/publish/added_{name}.{kind}.log",
    wildcard_constraints:
        kind="csv|tex|md",
    shell:
        "cp {input:q} {output:q} 2> {log:q}"
