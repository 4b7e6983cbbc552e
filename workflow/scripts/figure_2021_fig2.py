"""Paper 2021, figure 2: variance of log p-hat over N -> PDF, PNG, CSV."""

from job import job

with job(snakemake) as settings:  # noqa: F821
    import pandas as pd

    from imuarray.figures import tuning
    from imuarray.figures.notes import scale_line
    from imuarray.figures.style import write_figure

    table = tuning.fig2_table([pd.read_csv(path) for path in snakemake.input.variances])  # noqa: F821
    footer = [scale_line(settings, f"{table.realisations.max()} realisations per point")]
    target = settings["paper2021"]["variance_target"]
    write_figure(tuning.fig2(table, target, footer), table, **dict(snakemake.output.items()))  # noqa: F821
