"""Paper 2021: tables I and II."""

import pandas as pd

from imuarray_papers.figures.style import Column, scale_line, unfinished

NOT_IN_TEXT = "The paper's values are not in the extracted text; these are ours."

TABLE1 = (
    Column("samples", "T", "$T$"),
    Column("draws", "N", "$N$"),
    Column("variance", "variance of log p-hat", r"$\mathrm{var}\log\hat p_N$", "{:.3f}"),
    Column("step_length_m", "σq (µm)", r"$\sigma_q$ ($\mu$m)", "{:.3g}", 1e6),
    Column("acceptance_1", "acceptance, chain 1", "acc. 1", "{:.3f}"),
    Column("acceptance_2", "acceptance, chain 2", "acc. 2", "{:.3f}"),
    Column("steps", "steps per chain", "steps"),
    Column("burn_in_steps", "burn-in (steps)", "burn-in"),
    Column("rhat_max", "max R-hat", r"max $\hat R$", "{:.3f}"),
    Column("ess_min", "min ESS", "min ESS", "{:.0f}"),
    Column("ess_median", "median ESS", "med. ESS", "{:.0f}"),
)

TABLE2 = (
    Column("samples", "T", "$T$"),
    Column("source", "data", "data"),
    Column("accelerometer_sd", "assumed σa (m/s²)", r"$\sigma_a$ (m/s$^2$)", "{:g}"),
    Column("sd_x_m", "sd x (µm)", r"$x$ ($\mu$m)", "{:.3g}", 1e6),
    Column("sd_y_m", "sd y (µm)", r"$y$ ($\mu$m)", "{:.3g}", 1e6),
    Column("sd_z_m", "sd z (µm)", r"$z$ ($\mu$m)", "{:.3g}", 1e6),
    Column("sd_median_m", "sd, median of all (µm)", r"median ($\mu$m)", "{:.3g}", 1e6),
    Column("sd_mean_m", "sd, mean of all (µm)", r"mean ($\mu$m)", "{:.3g}", 1e6),
    Column("ratio", "median / that of section IV-A", "ratio", "{:.3g}"),
    Column("rhat_max", "max R-hat", r"max $\hat R$", "{:.3f}"),
    Column("ess_min", "min ESS", "min ESS", "{:.0f}"),
)


def table_2021_table1(tunings: list[dict], verdicts: list[dict], settings: dict):
    """Tuning parameters and what came of them, one row for each T.

    ``tunings``: `tuning/T*.json`; ``verdicts``: `posterior/T*.json`, in the same order. The
    variance is that of the nearest N of the sweep at the prior mean. Units as in the names.
    """
    rows = []
    for tuning, verdict in zip(tunings, verdicts, strict=True):
        shares = enumerate(verdict["acceptance"], start=1)
        row = {f"acceptance_{number}": share for number, share in shares}
        rows.append(row | verdict | tuning)
    table = pd.DataFrame(rows)[[column.name for column in TABLE1] + ["converged"]]
    threshold = settings["paper2021"]["rhat_threshold"]
    notes = [NOT_IN_TEXT, *unfinished(table, threshold), scale_line(settings) + "."]
    return table, TABLE1, "Table I of 2021: values for the tuning parameters", notes


def table_2021_table2(experiment: list, simulation: list, ideal: list, settings: dict):
    """Estimated standard deviations of the positions, one row for each T and source.

    ``experiment``, its ``simulation`` and section IV-A's (``ideal``): `posterior/`, coordinates
    and verdict of each T in turn.
    Axes: medians over the triads; ``ratio``: the median over all coordinates by section IV-A's.
    """
    simulated = ("simulation, experiment's noise", "simulation, section IV-A")
    names = ("experiment (measured)", *simulated)
    noise = [settings[name]["accelerometer_sd"] for name in ("experiment", "experiment", "noise")]
    rows = []
    for turn in range(0, len(ideal), 2):
        reference = ideal[turn].sd_m.median()
        for name, results, sd in zip(names, (experiment, simulation, ideal), noise, strict=True):
            coordinates, verdict = results[turn : turn + 2]
            axes = coordinates.groupby("axis").sd_m.median()
            rows.append({
                "samples": verdict["samples"], "source": name,
                "accelerometers": len(coordinates) // 3 + 1, "accelerometer_sd": sd,
                **{f"sd_{axis}_m": axes[axis] for axis in "xyz"},
                "sd_median_m": coordinates.sd_m.median(), "sd_mean_m": coordinates.sd_m.mean(),
                "ratio": coordinates.sd_m.median() / reference,
                **{key: verdict[key] for key in ("rhat_max", "ess_min", "converged")},
            })  # fmt: skip
    table = pd.DataFrame(rows)
    counts = table.groupby("source", sort=False).accelerometers.first()
    sizes = ", ".join(f"{count} ({name})" for name, count in counts.items())
    notes = [
        f"Experiment: recording {settings['experiment']['recording']}. {NOT_IN_TEXT}",
        f"IMUs: {sizes}.",
        *unfinished(table, settings["paper2021"]["rhat_threshold"]), scale_line(settings) + ".",
    ]  # fmt: skip
    return table, TABLE2, "Table II of 2021: estimated standard deviations of the positions", notes
