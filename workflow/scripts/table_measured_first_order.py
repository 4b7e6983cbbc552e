"""First-order calibration of a board: residuals and noise of each IMU -> CSV, LaTeX, Markdown."""

from job import job

with job(snakemake):
    from imuarray.figures.measured import table_measured_first_order
    from imuarray.figures.publish import publish

    publish(table_measured_first_order, snakemake)
