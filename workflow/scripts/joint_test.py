"""Samplers and simulation by turns: do the positions keep their prior? -> CSV."""

from imuarray.pipeline.job import job

with job(snakemake) as settings:
    from imuarray.provenance import write_csv
    from imuarray.studies.joint import joint_test

    rounds = settings["scale"]["validation_rounds"]
    write_csv(joint_test(settings["seed"], rounds), snakemake.output[0])
