"""Withheld gyroscope readings predicted by several models -> table, PDF, PNG, CSV."""

from imuarray_papers.pipeline.job import job

with job(snakemake):
    from imuarray.recording import load_dataset, read_recording
    from imuarray_papers.figures.board import figure_past_rail
    from imuarray_papers.figures.style import write_figure
    from imuarray_papers.measured.left_out import ASSUMED, BINS, past_rail

    recording = read_recording(snakemake.input.recording)
    table = past_rail(recording, load_dataset(snakemake.input.calibration))
    footer = [
        f"Recording {snakemake.wildcards.name}: gyroscope readings beyond a made-up rail of"
        f" {BINS[0]} deg/s are withheld and predicted from the rest, 150 samples a bin of their"
        f" fastest axis; papers' model with σa = {ASSUMED:g} m/s². Positions, delay and all other"
        " parameters of the board are from the other recordings."
    ]
    write_figure(figure_past_rail(BINS[0], footer), table, **dict(snakemake.output.items()))
