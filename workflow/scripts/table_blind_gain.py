"""Gain, position error and coverage before and after, by effect -> CSV, LaTeX, Markdown."""

from job import job

with job(snakemake):
    from imuarray.figures.blind_tables import table_blind_gain
    from imuarray.figures.publish import publish

    publish(table_blind_gain, snakemake)
