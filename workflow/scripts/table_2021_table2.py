"""Paper 2021, table II: estimated standard deviations compared -> CSV, LaTeX, Markdown."""

from job import job

with job(snakemake) as settings:  # noqa: F821
    import json
    from pathlib import Path

    import pandas as pd

    from imuarray.figures import tables
    from imuarray.figures.notes import scale_line

    def read(paths, accelerometer_sd):
        """Per T: coordinates, verdict and the assumed noise; ``paths`` alternate CSV, JSON."""
        results = {}
        for csv, verdict in zip(paths[::2], paths[1::2], strict=True):
            verdict = json.loads(Path(verdict).read_text(encoding="utf-8"))
            results[verdict["samples"]] = (pd.read_csv(csv), verdict, accelerometer_sd)
        return results

    noise = [settings["experiment"]["accelerometer_sd"]] * 2
    noise.append(settings["noise"]["accelerometer_sd"])
    paths = [snakemake.input[name] for name in ("experiment", "simulation", "ideal")]  # noqa: F821
    names = tables.source_names(snakemake.params.kind)  # noqa: F821
    table = tables.table2(
        {name: read(one, sd) for name, one, sd in zip(names, paths, noise, strict=True)}
    )
    notes = [
        f"Experiment: {snakemake.params.source}. {tables.NOT_IN_TEXT}",  # noqa: F821
        tables.sizes(table),
        *tables.unfinished(table, settings["paper2021"]["rhat_threshold"]),
        scale_line(settings) + ".",
    ]
    caption = "Table II of 2021: estimated standard deviations of the positions"
    tables.write_table(table, tables.TABLE2, caption, notes, **dict(snakemake.output.items()))  # noqa: F821
