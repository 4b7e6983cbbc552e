"""Paper 2017, figure 5: RMSE of the positions over |omega|, |omega_dot| -> PDF, PNG, CSV."""

from job import job

with job(snakemake) as settings:  # noqa: F821
    import pandas as pd

    from imuarray.figures import calibration
    from imuarray.figures.notes import scale_line
    from imuarray.figures.style import write_figure

    errors = pd.read_csv(snakemake.input.errors)  # noqa: F821
    table = calibration.fig5_table(errors)
    counts = f"N = {errors.samples.max()} time samples, {errors.iterations.max()} iterations"
    footer = [scale_line(settings, f"{errors.realisations.max()} realisations per point"), counts]
    start = settings["paper2017"]["position_sd"]
    write_figure(calibration.fig5(table, start, footer), table, **dict(snakemake.output.items()))  # noqa: F821
