"""Agreement between recordings of one board against the claimed widths -> PDF, PNG, CSV."""

from job import job

with job(snakemake) as settings:
    import pandas as pd

    from imuarray.figures.measured import agreement_figure
    from imuarray.figures.style import write_figure

    summary, pairs = (
        pd.read_csv(path) for path in (snakemake.input.summary, snakemake.input.pairs)
    )
    footer = [
        f"{summary.recordings.max()} recordings of board {snakemake.wildcards.group}; differences"
        " of all pairs in all coordinates, over their claimed sd. Pairs share recordings, and a"
        " recording's coordinates share its motion."
    ]
    write_figure(
        agreement_figure(summary, pairs, footer), summary, **dict(snakemake.output.items())
    )
