"""The joint test of samplers and simulation -> CSV, LaTeX, Markdown."""

from job import job

with job(snakemake) as settings:
    import pandas as pd

    from imuarray.figures import validation
    from imuarray.figures.notes import scale_line
    from imuarray.figures.tables import write_table

    write_table(
        pd.read_csv(snakemake.input.rows), validation.JOINT,
        "Samplers and simulation by turns: do the positions keep their prior?",
        [*validation.JOINT_NOTES, scale_line(settings)], **dict(snakemake.output.items()),
    )  # fmt: skip
