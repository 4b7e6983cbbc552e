"""Iterations that ML-BCD and Gauss-Newton need -> PDF, PNG, CSV."""

from job import job

with job(snakemake) as settings:
    import pandas as pd

    from imuarray.figures import theory
    from imuarray.figures.notes import scale_line
    from imuarray.figures.style import write_figure

    table = pd.read_csv(snakemake.input.rows)
    footer = [scale_line(settings, f"N = {table.samples.max()}")]
    figure = theory.convergence_figure(table, settings["paper2017"]["position_sd"], footer)
    write_figure(figure, table, **dict(snakemake.output.items()))
