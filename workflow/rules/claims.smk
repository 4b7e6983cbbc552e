SIMULATED = [*KINDS, *expand("T{samples}", samples=SAMPLES)]
POSTERIORS = [
    *expand("T{samples}", samples=SAMPLES),
    *expand("{kind}_T{samples}", kind=KINDS, samples=SAMPLES),
]


rule claims_identifiability:
    output:
        checks="results/{scale}/claims/identifiability.json",
        ranks="results/{scale}/claims/ranks.csv",
        work="results/{scale}/claims/inner_steps.csv",
    log:
        "results/{scale}/logs/claims/identifiability.log",
    benchmark:
        "results/{scale}/benchmarks/claims/identifiability.tsv"
    params:
        settings=sections("paper2017"),
        code=code("claims_identifiability"),
    message:
        "claims: identifiability ({wildcards.scale})"
    script:
        "../scripts/claims_identifiability.py"


rule claims_position_bound:
    output:
        "results/{scale}/claims/position_bound.csv",
    log:
        "results/{scale}/logs/claims/position_bound.log",
    benchmark:
        "results/{scale}/benchmarks/claims/position_bound.tsv"
    params:
        settings=sections("paper2017"),
        code=code("claims_position_bound"),
    message:
        "claims: bound of the positions ({wildcards.scale})"
    script:
        "../scripts/claims_position_bound.py"


rule claims_accelerometers_only:
    output:
        "results/{scale}/claims/accelerometers_only.csv",
    log:
        "results/{scale}/logs/claims/accelerometers_only.log",
    benchmark:
        "results/{scale}/benchmarks/claims/accelerometers_only.tsv"
    params:
        settings=sections("paper2017"),
        code=code("claims_accelerometers_only"),
    message:
        "claims: accelerometers only ({wildcards.scale})"
    script:
        "../scripts/claims_accelerometers_only.py"


rule claims_marginalisation:
    input:
        recording=expand("results/{{scale}}/recordings/T{samples}.nc", samples=min(SAMPLES)),
    output:
        "results/{scale}/claims/marginalisation.json",
    log:
        "results/{scale}/logs/claims/marginalisation.log",
    benchmark:
        "results/{scale}/benchmarks/claims/marginalisation.tsv"
    params:
        settings=sections("paper2021"),
        code=code("claims_marginalisation"),
    message:
        "claims: marginalisation ({wildcards.scale})"
    script:
        "../scripts/claims_marginalisation.py"


rule claims_linearised:
    input:
        recordings=expand("results/{{scale}}/recordings/{name}.nc", name=SIMULATED),
    output:
        coordinates="results/{scale}/claims/linearised.csv",
        determinant="results/{scale}/claims/determinant.csv",
    log:
        "results/{scale}/logs/claims/linearised.log",
    benchmark:
        "results/{scale}/benchmarks/claims/linearised.tsv"
    params:
        settings=sections("paper2021", "experiment"),
        names=SIMULATED,
        kinds=KINDS,
        code=code("claims_linearised"),
    message:
        "claims: linearised model ({wildcards.scale})"
    script:
        "../scripts/claims_linearised.py"


rule claims_statements:
    input:
        recording=MEASURED.recording(MEASURED.shown),
    output:
        dependence="results/{scale}/claims/dependence.csv",
        checks="results/{scale}/claims/statements.json",
    log:
        "results/{scale}/logs/claims/statements.log",
    benchmark:
        "results/{scale}/benchmarks/claims/statements.tsv"
    params:
        settings=sections("paper2017", "paper2021", "experiment"),
        code=code("claims_statements"),
    message:
        "claims: what accuracy rests on ({wildcards.scale})"
    script:
        "../scripts/claims_statements.py"


rule claims_timing:
    input:
        recordings=of_samples("recordings/T{samples}.nc"),
        tuning=of_samples("tuning/T{samples}.json"),
    output:
        timing="results/{scale}/claims/timing.csv",
        acceptance="results/{scale}/claims/acceptance_variance.csv",
    log:
        "results/{scale}/logs/claims/timing.log",
    benchmark:
        "results/{scale}/benchmarks/claims/timing.tsv"
    params:
        settings=sections("paper2017", "paper2021"),
        code=code("claims_timing"),
    message:
        "claims: timing ({wildcards.scale})"
    script:
        "../scripts/claims_timing.py"


rule claims:
    input:
        calibration=expand(
            "results/{{scale}}/calibration/{name}.csv",
            name=[
                "position_error_samples",
                "position_error_motion",
                "position_error_force",
                "rate_error",
            ],
        ),
        tuning=expand(
            "results/{{scale}}/tuning/{name}_T{samples}.csv",
            name=["variance", "acceptance"],
            samples=SAMPLES,
        ),
        tuned=of_samples("tuning/T{samples}.json"),
        posterior=expand(
            "results/{{scale}}/posterior/{name}.{kind}", name=POSTERIORS, kind=["csv", "json"]
        ),
        chains=expand("results/{{scale}}/chains/{name}.nc", name=POSTERIORS),
        burn_in=of_samples("posterior/burn_in_T{samples}.csv"),
        identifiability="results/{scale}/claims/identifiability.json",
        ranks="results/{scale}/claims/ranks.csv",
        work="results/{scale}/claims/inner_steps.csv",
        bound="results/{scale}/claims/position_bound.csv",
        accelerometers="results/{scale}/claims/accelerometers_only.csv",
        marginalisation="results/{scale}/claims/marginalisation.json",
        linearised="results/{scale}/claims/linearised.csv",
        determinant="results/{scale}/claims/determinant.csv",
        dependence="results/{scale}/claims/dependence.csv",
        statements="results/{scale}/claims/statements.json",
        timing="results/{scale}/claims/timing.csv",
        acceptance="results/{scale}/claims/acceptance_variance.csv",
        experiment=lambda wc: MEASURED.claims(wc.scale),
    output:
        table=report(
            "results/{scale}/claims/claims.csv",
            caption="../report/claims.rst",
            category="Claims",
        ),
        page="results/{scale}/claims/claims.md",
    log:
        "results/{scale}/logs/claims/claims.log",
    benchmark:
        "results/{scale}/benchmarks/claims/claims.tsv"
    resources:
        mem_mb=4000,
    params:
        settings=sections("paper2017", "paper2021", "experiment", "recordings"),
        code=code("claims"),
    message:
        "claims: verdicts ({wildcards.scale})"
    script:
        "../scripts/claims.py"
