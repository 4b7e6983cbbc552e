"""Paper 2021, figure 5: ellipses of the positions on the board -> PDF, PNG, CSV."""

from job import job

with job(snakemake) as settings:  # noqa: F821
    import json
    from pathlib import Path

    import pandas as pd

    from imuarray.figures import ellipses
    from imuarray.figures.notes import chain_lines, scale_line
    from imuarray.figures.style import write_figure
    from imuarray.geometry import array_from_config
    from imuarray.posterior.store import read_chains
    from imuarray.recording import array_of, read_recording

    array, kind = array_from_config(settings["array"]), snakemake.params.kind  # noqa: F821
    if snakemake.input.recordings:  # noqa: F821
        array = array_of(read_recording(snakemake.input.recordings[0]))  # noqa: F821
    posteriors, verdicts = {}, {}
    for path, verdict in zip(snakemake.input.chains, snakemake.input.verdicts, strict=True):  # noqa: F821
        _, tree = read_chains(path)
        verdict = json.loads(Path(verdict).read_text(encoding="utf-8"))
        draws = tree["posterior"]["position"].to_numpy()[:, verdict["burn_in_draws"] :]
        posteriors[verdict["samples"]] = draws.reshape(-1, *draws.shape[2:])
        verdicts[verdict["samples"]] = verdict
    prior = [tree["prior"][f"position_{name}"].to_numpy() for name in ("mean", "sd")]
    coordinates = pd.read_csv(snakemake.input.coordinates[0])  # noqa: F821
    known = "truth_m" in coordinates
    truth = coordinates.truth_m.to_numpy().reshape(-1, 3) if known else None
    table = ellipses.fig5_table(array, posteriors, prior, truth)
    footer = [scale_line(settings, snakemake.params.source), *chain_lines(verdicts)]  # noqa: F821
    level = settings["experiment"]["ellipse_level"]
    figure = ellipses.fig5(table, array, level, kind, footer)
    write_figure(figure, table, **dict(snakemake.output.items()))  # noqa: F821
