"""First-order calibration of a board: residuals and noise of each IMU -> CSV, LaTeX, Markdown."""

from job import job

with job(snakemake):
    import pandas as pd

    from imuarray.figures import measured_tables, tables

    names, given = snakemake.params.names, snakemake.input
    sources = {
        name: (pd.read_csv(residuals), pd.read_csv(noise))
        for name, residuals, noise in zip(names, given.residuals, given.noise, strict=True)
    }
    table = measured_tables.first_order_table(sources)
    caption = "First-order calibration from still poses: residual and noise of each IMU"
    notes = [
        "Noise: root mean square over the axes, from differences of neighbouring readings in the"
        " still poses, beside the noise the recording declared (the papers')."
    ]
    columns = [column for column in measured_tables.FIRST_ORDER if column.name in table]
    tables.write_table(table, columns, caption, notes, **dict(snakemake.output.items()))
