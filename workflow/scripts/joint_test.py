"""Samplers and simulation by turns: do the positions keep their prior? -> CSV."""

from imuarray_papers.pipeline.job import job

with job(snakemake) as settings:
    from imuarray.provenance import write_csv
    from imuarray_papers.studies.joint import joint_test

    rounds = settings["scale"]["validation_rounds"]
    write_csv(joint_test(settings["seed"], rounds), snakemake.output[0])
