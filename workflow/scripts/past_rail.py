"""Hidden gyroscope readings foretold by several models -> table, PDF, PNG, CSV."""

from job import job

with job(snakemake):
    import json
    from pathlib import Path

    import numpy as np

    from imuarray.analysis.extension import diagnosed
    from imuarray.analysis.past_rail import ASSUMED, BINS, past_rail
    from imuarray.figures.past_rail import past_rail_figure
    from imuarray.figures.style import write_figure
    from imuarray.recording import read_recording

    recording = read_recording(snakemake.input.recording)
    path = Path(snakemake.input.diagnosis)
    base = np.array(json.loads(path.read_text(encoding="utf-8"))["base"]["positions_m"])
    table = past_rail(recording, diagnosed(path, recording), base - base[0])
    footer = [
        f"Recording {snakemake.wildcards.name}: gyroscope readings beyond a made-up rail of"
        f" {BINS[0]} deg/s are hidden and foretold from the rest, 150 samples a bin of their"
        f" fastest axis; papers' model with σa = {ASSUMED:g} m/s². Positions and effects are from"
        " the same recording's diagnosis."
    ]
    figure = past_rail_figure(table, BINS[0], footer)
    write_figure(figure, table, **dict(snakemake.output.items()))
