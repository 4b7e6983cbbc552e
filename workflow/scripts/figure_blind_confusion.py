"""What is named for what there is -> PDF, PNG, CSV."""

from job import job

with job(snakemake) as settings:
    import json
    from pathlib import Path

    from imuarray.blind.summary import confusion
    from imuarray.figures.blind import confusion_figure
    from imuarray.figures.notes import scale_line
    from imuarray.figures.style import write_figure

    rows = json.loads(Path(snakemake.input.rows).read_text(encoding="utf-8"))["rows"]
    table = confusion(rows)
    footer = scale_line(
        settings,
        "percent of the recordings (their number behind the effect) in which a name is given."
        " Blue: right by class; vermillion and bold: wrong, in all or some of them. A recording"
        " with several names is in several columns; unexplained: the flag, whatever is named.",
    )
    write_figure(confusion_figure(table, [footer]), table, **dict(snakemake.output.items()))
