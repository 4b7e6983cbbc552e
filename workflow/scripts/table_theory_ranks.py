"""Rank of the information over N, motion and geometry -> CSV, LaTeX, Markdown."""

from job import job

with job(snakemake):
    from imuarray.figures.publish import publish
    from imuarray.figures.theory import table_theory_ranks

    publish(table_theory_ranks, snakemake)
