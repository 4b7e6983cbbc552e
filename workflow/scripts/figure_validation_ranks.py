"""Rank histograms of the simulation-based calibration -> PDF, PNG, CSV."""

from job import job

with job(snakemake) as settings:
    import pandas as pd

    from imuarray.figures import validation
    from imuarray.figures.notes import scale_line
    from imuarray.figures.style import write_figure

    levels = pd.concat([pd.read_csv(path) for path in snakemake.input.levels])
    table = validation.histogram(levels)
    footer = [
        scale_line(settings, "n: truths from the prior, those without intervals left out"),
        "Histograms of all positions' coordinates; band: 95 % for all bins of a panel together.",
    ]
    figure = validation.rank_figure(table, footer)
    write_figure(figure, table, **dict(snakemake.output.items()))
