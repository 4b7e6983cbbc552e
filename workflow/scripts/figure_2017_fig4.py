"""Paper 2017, figure 4: RMSE of the positions over N and iterations -> PDF, PNG, CSV."""

from job import job

with job(snakemake) as settings:  # noqa: F821
    import pandas as pd

    from imuarray.figures import calibration
    from imuarray.figures.notes import scale_line
    from imuarray.figures.style import write_figure

    errors = pd.read_csv(snakemake.input.errors)  # noqa: F821
    table = calibration.fig4_table(errors)
    footer = [scale_line(settings, f"{errors.realisations.max()} realisations per point")]
    write_figure(calibration.fig4(table, footer), table, **dict(snakemake.output.items()))  # noqa: F821
