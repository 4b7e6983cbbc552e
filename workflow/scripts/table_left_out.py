"""What recordings of a board gain by the others' board -> CSV, LaTeX, Markdown."""

from job import job

with job(snakemake):
    from imuarray.figures.board import table_left_out
    from imuarray.figures.publish import publish

    publish(table_left_out, snakemake)
