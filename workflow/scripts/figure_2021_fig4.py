"""Paper 2021, figure 4: posterior of IMU 2's position for each T -> PDF, PNG, CSV."""

from job import job

with job(snakemake) as settings:  # noqa: F821
    import json
    from pathlib import Path

    import pandas as pd

    from imuarray.figures import chains as drawing
    from imuarray.figures.notes import chain_lines, scale_line
    from imuarray.figures.style import write_figure
    from imuarray.posterior.store import read_chains

    posteriors, verdicts = {}, {}
    for path, verdict in zip(snakemake.input.chains, snakemake.input.verdicts, strict=True):  # noqa: F821
        chains, tree = read_chains(path)
        verdict = json.loads(Path(verdict).read_text(encoding="utf-8"))
        posteriors[verdict["samples"]] = chains.draws[:, verdict["burn_in_draws"] :, :3]
        verdicts[verdict["samples"]] = verdict
    prior = [tree["prior"][f"position_{name}"].to_numpy()[0] for name in ("mean", "sd")]
    truth = pd.read_csv(snakemake.input.coordinates[0]).truth_m[:3].to_numpy()  # noqa: F821
    table = drawing.fig4_table(posteriors, prior, truth)
    name = f"IMU {tree['posterior']['accelerometer'].to_numpy()[0]}"
    figure = drawing.fig4(table, name, [scale_line(settings), *chain_lines(verdicts)])
    write_figure(figure, table, **dict(snakemake.output.items()))  # noqa: F821
