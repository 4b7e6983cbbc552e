"""What the simulation gets wrong: residuals beside the simulation's -> PDF, PNG, CSV."""

from job import job

with job(snakemake) as settings:
    import pandas as pd

    from imuarray.figures.measured import residual_figure
    from imuarray.figures.style import write_figure

    table, shape = (
        pd.read_csv(path) for path in (snakemake.input.summary, snakemake.input.histogram)
    )
    noise = settings["noise"]
    footer = [
        f"Recording {snakemake.wildcards.name}, seed {settings['seed']}. Papers' model with"
        f" σa = {noise['accelerometer_sd']:g} m/s² and σg = {noise['gyroscope_sd_dps']:g} deg/s,"
        " positions and motion fitted; the simulation has the fitted motion, this noise and the"
        " same rails, and is fitted likewise."
    ]
    figure = residual_figure(table, shape, footer)
    write_figure(figure, table, **dict(snakemake.output.items()))
