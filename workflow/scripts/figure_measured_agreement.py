"""Agreement between recordings of one board against the claimed widths -> PDF, PNG, CSV."""

from job import job

with job(snakemake):
    from imuarray.figures.measured import figure_measured_agreement
    from imuarray.figures.publish import publish

    publish(figure_measured_agreement, snakemake)
