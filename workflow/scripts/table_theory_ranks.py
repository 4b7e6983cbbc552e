"""Rank of the information over N, motion and geometry -> CSV, LaTeX, Markdown."""

from job import job

with job(snakemake) as settings:
    import pandas as pd

    from imuarray.figures import theory
    from imuarray.figures.notes import scale_line
    from imuarray.figures.tables import write_table

    write_table(
        pd.read_csv(snakemake.input.rows), theory.RANKS,
        "Which motion and geometry tell the positions.",
        [*theory.RANKS_NOTES, scale_line(settings)], **dict(snakemake.output.items()),
    )  # fmt: skip
