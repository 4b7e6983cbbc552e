"""Readings past a made-up rail by the others' board -> CSV, LaTeX, Markdown."""

from job import job

with job(snakemake):
    from imuarray.figures.board import table_past_rail
    from imuarray.figures.publish import publish

    publish(table_past_rail, snakemake)
