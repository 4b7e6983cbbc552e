"""Paper 2017, figure 3: RMSE of the angular rate over |omega| -> PDF, PNG, CSV."""

from job import job

with job(snakemake) as settings:  # noqa: F821
    import pandas as pd

    from imuarray.figures import calibration
    from imuarray.figures.notes import scale_line
    from imuarray.figures.style import write_figure
    from imuarray.geometry import array_from_config

    rates = pd.read_csv(snakemake.input.rates)  # noqa: F821
    gyroscopes = array_from_config(settings["array"]).gyroscopes
    table = calibration.fig3_table(rates, settings["noise"]["gyroscope_sd_dps"], gyroscopes)
    footer = [scale_line(settings, f"{rates.realisations.max()} realisations per point")]
    saturation = settings["paper2017"]["gyroscope_range_dps"]
    write_figure(
        calibration.fig3(table, saturation, footer),
        table,
        **dict(snakemake.output.items()),  # noqa: F821
    )
