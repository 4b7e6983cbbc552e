"""Paper 2021: tables I and II."""

import pandas as pd

from imuarray_papers.figures.style import columns, scale_line, unfinished


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
    table = pd.DataFrame(rows)[[column.name for column in columns("2021_table1")] + ["converged"]]
    return table, _chains(table, settings)


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
    words = {"recording": settings["experiment"]["recording"], "sizes": sizes}
    return table, words | _chains(table, settings)


def _chains(table, settings: dict) -> dict:
    threshold = settings["paper2021"]["rhat_threshold"]
    return {"unfinished": unfinished(table, threshold), "scale": scale_line(settings)}
