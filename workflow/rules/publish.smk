# paper_figures/ holds the configured scale's figures; every scale keeps its own in results/. Beside
# each is the configuration that it was made from.
rule copy_published:
    input:
        made=lambda wc: PUBLISHED.origin(wc.name, wc.kind),
        settings=lambda wc: PUBLISHED.stated(wc.name, asked()),
    output:
        "paper_figures/{name}.{kind}",
    log:
        "results/logs/publish/{name}.{kind}.log",
    wildcard_constraints:
        name="|".join(PLACES),
        kind="pdf|png|csv|tex|md",
    params:
        made=lambda wc, input: Path(input.made).with_suffix(""),
    message:
        "{output}"
    shell:
        # all kinds of it: one JSON file speaks for them; jobs of several kinds write the same files
        "part=paper_figures/.{wildcards.name}.{wildcards.kind}.part; for made in {params.made}.*"
        " {input.settings:q}; do cp $made $part && mv -f $part"
        " paper_figures/{wildcards.name}.${{made##*.}} || exit 1; done 2> {log:q}"


# A cause of a diagnosis, asked for by name.
rule publish_cause:
    input:
        made="results/measured/diagnosis/{name}/diagnosis.json",
        settings=lambda wc: PUBLISHED.stated(f"cause_{wc.effect}_{wc.name}", asked()),
    output:
        **{kind: f"paper_figures/cause_{{effect}}_{{name}}.{kind}" for kind in FIGURE},
    log:
        "results/logs/publish/cause_{effect}_{name}.log",
    wildcard_constraints:
        effect="[a-z_]+",
        name="|".join(RECORDINGS),
    params:
        code=code("publish_cause"),
    message:
        "paper_figures/cause_{wildcards.effect}_{wildcards.name}"
    script:
        "../scripts/publish_cause.py"
