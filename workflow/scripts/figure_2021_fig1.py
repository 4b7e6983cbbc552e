"""Paper 2021, figure 1: layout and dimensions of the array -> PDF, PNG, CSV."""

from job import job

with job(snakemake) as settings:  # noqa: F821
    from imuarray.figures import layout
    from imuarray.figures.notes import scale_line
    from imuarray.figures.style import write_figure
    from imuarray.geometry import array_from_config

    array = array_from_config(settings["array"])
    table = layout.layout_table(array)
    footer = [scale_line(settings, f"array {array.name}, nominal")]
    write_figure(layout.fig1(table, footer), table, **dict(snakemake.output.items()))  # noqa: F821
