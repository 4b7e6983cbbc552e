"""Coverage and z-scores between recordings of a board -> CSV, LaTeX, Markdown."""

from job import job

with job(snakemake):
    import pandas as pd

    from imuarray.figures import measured_tables, tables

    table = pd.read_csv(snakemake.input.summary, dtype={"assumed": str})
    caption = "Do recordings of one board agree within their claimed widths?"
    notes = [
        f"{table.recordings.max()} recordings, differences of all pairs in all coordinates. Pairs"
        " share recordings and coordinates share a motion, so the shares have no simple error."
    ]
    tables.write_table(
        table, measured_tables.AGREEMENT, caption, notes, **dict(snakemake.output.items())
    )
