"""Paper 2021, table I: tuning parameters and what came of them -> CSV, LaTeX, Markdown."""

from job import job

with job(snakemake):
    from imuarray.figures.paper2021_tables import table_2021_table1
    from imuarray.figures.publish import publish

    publish(table_2021_table1, snakemake)
