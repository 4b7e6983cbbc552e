"""Paper 2021, table II: estimated standard deviations compared -> CSV, LaTeX, Markdown."""

from job import job

with job(snakemake):
    from imuarray.figures.paper2021_tables import table_2021_table2
    from imuarray.figures.publish import publish

    publish(table_2021_table2, snakemake)
