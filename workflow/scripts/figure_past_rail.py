"""Withheld gyroscope readings predicted by several models -> table, PDF, PNG, CSV."""

from job import job

with job(snakemake):
    import json
    from pathlib import Path

    import numpy as np

    from imuarray.analysis.extension import diagnosed
    from imuarray.analysis.past_rail import ASSUMED, BINS, lead_of, past_rail
    from imuarray.figures.measured import figure_past_rail
    from imuarray.figures.style import write_figure
    from imuarray.recording import read_recording

    recording = read_recording(snakemake.input.recording)
    others = snakemake.params.others  # of the same board; the next one is asked
    found, elsewhere = diagnosed(snakemake.input.diagnosis, recording), None

    def base_of(path):
        base = np.array(json.loads(Path(path).read_text(encoding="utf-8"))["base"]["positions_m"])
        return base - base[0]

    if others:
        (path,) = snakemake.input.elsewhere
        elsewhere = base_of(path), lead_of(diagnosed(path, recording))
    table = past_rail(recording, found, base_of(snakemake.input.diagnosis), elsewhere=elsewhere)
    footer = [
        f"Recording {snakemake.wildcards.name}: gyroscope readings beyond a made-up rail of"
        f" {BINS[0]} deg/s are withheld and predicted from the rest, 150 samples a bin of their"
        f" fastest axis; papers' model with σa = {ASSUMED:g} m/s². Positions and effects are from"
        " the same recording's diagnosis"
        + (f"; 'another recording' is {others[0]}." if others else ".")
    ]
    figure = figure_past_rail(table, BINS[0], footer)
    write_figure(figure, table, **dict(snakemake.output.items()))
