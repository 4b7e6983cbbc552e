"""One cause of a diagnosis, drawn from its numbers as they are published -> PDF, PNG, CSV."""

from imuarray_papers.pipeline.job import job

with job(snakemake):
    import json
    import shutil
    from functools import partial
    from pathlib import Path

    import pandas as pd

    from imuarray.report.drawings import cause_figure
    from imuarray.report.write import footer
    from imuarray_papers.figures.style import write_figure

    made, output = Path(snakemake.input.made), dict(snakemake.output.items())
    (numbers,) = made.parent.glob(f"cause_*_{snakemake.wildcards.effect}.csv")
    document = json.loads(made.read_text(encoding="utf-8"))
    write_figure(partial(cause_figure, footer=footer(document)), pd.read_csv(numbers), **output)
    shutil.copy(snakemake.input.settings, Path(output["csv"]).with_suffix(".json"))
