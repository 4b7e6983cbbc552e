"""Paper 2021, table II, under the papers' and the sensor model -> CSV, LaTeX, Markdown."""

from job import job

with job(snakemake):
    from imuarray.figures.board import table_experiment
    from imuarray.figures.publish import publish
    from imuarray.recording import load_dataset

    publish(table_experiment, snakemake, located=load_dataset)
