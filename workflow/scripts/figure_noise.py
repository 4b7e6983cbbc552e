"""Allan deviation of the still poses beside the papers' noise -> PDF, PNG, CSV."""

from job import job

with job(snakemake) as settings:
    import numpy as np
    import pandas as pd

    from imuarray.figures.measured import noise_figure
    from imuarray.figures.style import write_figure

    table, noise = pd.read_csv(snakemake.input.allan), settings["noise"]
    papers = {
        "specific_force": noise["accelerometer_sd"],
        "angular_rate": np.radians(noise["gyroscope_sd_dps"]),
    }
    footer = [
        f"Still poses of recording {snakemake.wildcards.name}. Black: the papers' σa ="
        f" {noise['accelerometer_sd']:g} m/s² and σg = {noise['gyroscope_sd_dps']:g} deg/s."
    ]
    write_figure(noise_figure(table, papers, footer), table, **dict(snakemake.output.items()))
