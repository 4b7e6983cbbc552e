"""Paper 2021, figure 3: trace, histogram, autocorrelation of r_2's x -> PDF, PNG, CSV."""

from job import job

with job(snakemake) as settings:  # noqa: F821
    import json

    import pandas as pd

    from imuarray.figures import chains as drawing
    from imuarray.figures.notes import chain_lines, scale_line
    from imuarray.figures.style import write_figure
    from imuarray.posterior.store import read_chains

    chains, tree = read_chains(snakemake.input.chains[0])  # noqa: F821
    with open(snakemake.input.verdict[0], encoding="utf-8") as handle:  # noqa: F821
        verdict = json.load(handle)
    truth = pd.read_csv(snakemake.input.coordinates[0]).truth_m[0]  # noqa: F821
    first = tree["posterior"]["accelerometer"].to_numpy()[0]
    table = drawing.fig3_table(chains.draws[..., 0], verdict["burn_in_draws"], chains.thin, truth)
    samples = verdict["samples"]
    footer = [scale_line(settings), *chain_lines({samples: verdict})]
    name = f"x of IMU {first}, $T = {samples}$"
    figure = drawing.fig3(table, verdict["burn_in_steps"], name, footer)
    write_figure(figure, table, **dict(snakemake.output.items()))  # noqa: F821
