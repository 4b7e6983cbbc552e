from support import PACKAGE

# Apart from library(): the chains must not be sampled again for an edited check.
CHECKS = sorted(map(str, (PACKAGE / "studies" / "checks").glob("*.py")))
SIMULATED = [*KINDS, *expand("T{samples}", samples=SAMPLES)]
POSTERIORS = [
    *expand("T{samples}", samples=SAMPLES),
    *expand("{kind}_T{samples}", kind=KINDS, samples=SAMPLES),
]


rule claims_identifiability:
    input:
        code=[*library("estimation"), *CHECKS],
    output:
        checks="results/{scale}/claims/identifiability.json",
        ranks="results/{scale}/claims/ranks.csv",
        work="results/{scale}/claims/inner_steps.csv",
    log:
        "results/{scale}/logs/claims/identifiability.log",
    benchmark:
        "results/{scale}/benchmarks/claims/identifiability.tsv"
    threads: 1
    resources:
        mem_mb=2000,
        runtime=30,
    params:
        settings=lambda wc: effective(config, wc.scale, "paper2017"),
    script:
        "../scripts/claims_identifiability.py"


rule claims_position_bound:
    input:
        code=[*library("estimation"), *CHECKS],
    output:
        "results/{scale}/claims/position_bound.csv",
    log:
        "results/{scale}/logs/claims/position_bound.log",
    benchmark:
        "results/{scale}/benchmarks/claims/position_bound.tsv"
    threads: 1
    resources:
        mem_mb=2000,
        runtime=30,
    params:
        settings=lambda wc: effective(config, wc.scale, "paper2017"),
    script:
        "../scripts/claims_position_bound.py"


rule claims_accelerometers_only:
    input:
        code=[*library("estimation"), *CHECKS],
    output:
        "results/{scale}/claims/accelerometers_only.csv",
    log:
        "results/{scale}/logs/claims/accelerometers_only.log",
    benchmark:
        "results/{scale}/benchmarks/claims/accelerometers_only.tsv"
    threads: 1
    resources:
        mem_mb=2000,
        runtime=30,
    params:
        settings=lambda wc: effective(config, wc.scale, "paper2017"),
    script:
        "../scripts/claims_accelerometers_only.py"


rule claims_marginalisation:
    input:
        recording=expand("results/{{scale}}/recordings/T{samples}.nc", samples=min(SAMPLES)),
        code=[*library("posterior"), *CHECKS],
    output:
        "results/{scale}/claims/marginalisation.json",
    log:
        "results/{scale}/logs/claims/marginalisation.log",
    benchmark:
        "results/{scale}/benchmarks/claims/marginalisation.tsv"
    threads: 1
    resources:
        mem_mb=2000,
        runtime=30,
    params:
        settings=lambda wc: effective(config, wc.scale, "paper2021"),
    script:
        "../scripts/claims_marginalisation.py"


rule claims_linearised:
    input:
        recordings=expand("results/{{scale}}/recordings/{name}.nc", name=SIMULATED),
        code=[*library("posterior"), *CHECKS],
    output:
        coordinates="results/{scale}/claims/linearised.csv",
        determinant="results/{scale}/claims/determinant.csv",
    log:
        "results/{scale}/logs/claims/linearised.log",
    benchmark:
        "results/{scale}/benchmarks/claims/linearised.tsv"
    threads: 1
    resources:
        mem_mb=2000,
        runtime=30,
    params:
        settings=lambda wc: effective(config, wc.scale, "paper2021", "experiment"),
        names=SIMULATED,
        kinds=KINDS,
    script:
        "../scripts/claims_linearised.py"


rule claims_timing:
    input:
        recordings=expand("results/{{scale}}/recordings/T{samples}.nc", samples=SAMPLES),
        tuning=expand("results/{{scale}}/tuning/T{samples}.json", samples=SAMPLES),
        code=[*library("posterior"), *CHECKS],
    output:
        timing="results/{scale}/claims/timing.csv",
        acceptance="results/{scale}/claims/acceptance_variance.csv",
    log:
        "results/{scale}/logs/claims/timing.log",
    benchmark:
        "results/{scale}/benchmarks/claims/timing.tsv"
    threads: 1
    resources:
        mem_mb=2000,
        runtime=30,
    params:
        settings=lambda wc: effective(config, wc.scale, "paper2017", "paper2021"),
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
        tuned=expand("results/{{scale}}/tuning/T{samples}.json", samples=SAMPLES),
        posterior=expand(
            "results/{{scale}}/posterior/{name}.{kind}", name=POSTERIORS, kind=["csv", "json"]
        ),
        chains=expand("results/{{scale}}/chains/{name}.nc", name=POSTERIORS),
        benchmarks=expand("results/{{scale}}/benchmarks/chains/T{samples}.tsv", samples=SAMPLES),
        burn_in=expand("results/{{scale}}/posterior/burn_in_T{samples}.csv", samples=SAMPLES),
        identifiability="results/{scale}/claims/identifiability.json",
        ranks="results/{scale}/claims/ranks.csv",
        work="results/{scale}/claims/inner_steps.csv",
        bound="results/{scale}/claims/position_bound.csv",
        accelerometers="results/{scale}/claims/accelerometers_only.csv",
        marginalisation="results/{scale}/claims/marginalisation.json",
        linearised="results/{scale}/claims/linearised.csv",
        determinant="results/{scale}/claims/determinant.csv",
        timing="results/{scale}/claims/timing.csv",
        acceptance="results/{scale}/claims/acceptance_variance.csv",
        experiment=lambda wc: MEASURED.claims(wc.scale),
        code=[*library("claims"), str(PACKAGE / "claims" / "register.yaml")],
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
    threads: 1
    resources:
        mem_mb=4000,
        runtime=30,
    params:
        settings=lambda wc: effective(
            config, wc.scale, "paper2017", "paper2021", "experiment", "recordings"
        ),
        experiment=lambda wc: MEASURED.experiment(wc.scale),
        simulation=lambda wc: MEASURED.simulation(wc.scale),
    script:
        "../scripts/claims.py"
