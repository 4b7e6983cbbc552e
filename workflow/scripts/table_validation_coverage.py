"""How often intervals hold the truth, by method and T -> CSV, LaTeX, Markdown."""

from job import job

with job(snakemake) as settings:
    import pandas as pd

    from imuarray.figures import validation
    from imuarray.figures.notes import scale_line
    from imuarray.figures.tables import write_table
    from imuarray.studies.calibrated import coverage

    levels = pd.concat([pd.read_csv(path) for path in snakemake.input.levels])
    write_table(
        coverage(levels), validation.COVERAGE, "How often intervals hold the truth.",
        [*validation.NOTES, scale_line(settings)], **dict(snakemake.output.items()),
    )  # fmt: skip
