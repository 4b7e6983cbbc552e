"""How often an effect is found, over its size in sigma or in its own unit -> PDF, PNG, CSV."""

from job import job

with job(snakemake) as settings:
    import json
    from pathlib import Path

    from imuarray.blind import summary
    from imuarray.figures.blind import detection_figure
    from imuarray.figures.notes import scale_line
    from imuarray.figures.style import write_figure

    rows = json.loads(Path(snakemake.input.rows).read_text(encoding="utf-8"))["rows"]
    effects = summary.effects(rows)
    bins = summary.detection(effects, snakemake.params.against)
    footer = [scale_line(settings, f"{(effects.kind == 'one').sum()} recordings of one effect")]
    write_figure(detection_figure(bins, effects, footer), bins, **dict(snakemake.output.items()))
