"""A measured board under the sensor model: what each cause gains, prediction, past the rail.

And its recordings' diagnoses: do positions, and the causes' numbers, agree?
"""

import numpy as np
import pandas as pd

from imuarray.pictures.style import PAGE, logarithmic, look
from imuarray_papers.figures.style import columns, drawing, rms
from imuarray_papers.measured.positions import agreement, coordinate_table, pairwise

MODELS = ("base", "inflated", "extended")  # sections of a diagnosis that have positions
SERIES = {
    "clipped": "gyroscopes at the rail",
    "nominal": "papers' model, nominal positions",
    "calibrated": "papers' model, calibrated positions",
    "delayed": "the same and one delay",
    "board": "sensor model, board of the others",
}


def figure_past_rail(rail_dps: float, footer=()):
    """Median error and RMSE of the withheld readings over the angular rate; log-log."""
    return drawing(_draw_past_rail, footer, PAGE, rail_dps=rail_dps)


def _draw_past_rail(figure, table, rail_dps):
    panels = figure.subplots(1, 2, sharey=True)
    # a normal error of sd 1 has the median 0.674
    columns = (
        ("median_dps", "median |error|", "sd_dps", 0.674),
        ("rmse_dps", "RMSE", "rms_sd_dps", 1),
    )
    for axes, (column, title, claimed, factor) in zip(panels, columns, strict=True):
        for number, (name, label) in enumerate(SERIES.items()):
            rows = table[table.model == name]
            if len(rows):
                axes.plot(rows.rate_dps, rows[column], label=label, **look(number), markersize=4)
        rows = table[table.model == "board"]
        axes.plot(rows.rate_dps, factor * rows[claimed], color="0.4", linestyle=(0, (1, 1.5)),
                  linewidth=1, label="that, as claimed")  # fmt: skip
        axes.axvline(rail_dps, color="0.6", linewidth=0.8)
        logarithmic(axes, "angular rate of the withheld axis (deg/s)", None)
        axes.set_xticks([250, 500, 1000, 2000], ["250", "500", "1000", "2000"])
        axes.set_xticks([], minor=True)
        axes.set_title(title)
    panels[0].set_ylabel("error of the predicted reading (deg/s)")
    figure.legend(*panels[0].get_legend_handles_labels(), loc="outside upper center", ncols=3)


def table_causes(summary: pd.DataFrame, group: str):
    """Gain of each cause; ``summary``: `measured.causes.repeated` of the board ``group``."""
    return summary, {"recordings": summary.recordings.max(), "group": group}


def table_experiment(located: list, names: list[str], summary: pd.DataFrame, group: str):
    """Table II of 2021 once more: positions from T samples under the papers' and the sensor model.

    ``located``: `measured.left_out.located` of the recordings ``names`` of the board ``group``;
    ``summary``: `measured.agreement` under the papers' model.
    """
    assumed = summary.assumed.astype(str)
    noise = np.where(assumed == "residual", "the residual's", assumed + " m/s²")
    rows = [summary.assign(model=[f"papers', σa {each}" for each in noise])]
    for each in located[0].samples.to_numpy():
        tables = []
        for name, one in zip(names, located, strict=True):
            few = one.sel(samples=each)
            variance = np.einsum("aiai->ai", few.position_covariance.to_numpy())
            labels, positions = few.accelerometer.to_numpy()[1:], few.position.to_numpy()[1:]
            tables.append(
                coordinate_table(labels, positions, np.sqrt(variance)[1:], recording=name)
            )
        table = pd.concat(tables)
        found = agreement(pairwise(table), table)
        rows.append(pd.DataFrame([found | {"samples": int(each), "model": "sensors"}]))
    table = pd.concat(rows, ignore_index=True).sort_values("samples", kind="stable")
    words = {"recordings": table.recordings.max(), "group": group}
    return table[[column.name for column in columns("experiment")]], words


def table_past_rail(tables: list[pd.DataFrame], names: list[str], group: str):
    """Readings past a made-up rail by the others' board; `measured.left_out.past_rail` of each."""
    parts = [
        table[table.model == "board"].assign(recording=name)
        for name, table in zip(names, tables, strict=True)
    ]
    return pd.concat(parts), {"group": group}


def table_left_out(tables: list[pd.DataFrame], names: list[str], group: str):
    """Gain of each recording by the others' board; `measured.left_out.predicted` of each."""
    rows = []
    for name, table in zip(names, tables, strict=True):
        by = table.set_index("model")
        rows.append({
            "recording": name, "samples": int(by.samples.iloc[0]),
            "heavy": by.over_inflated.heavy, "heavy_error": by.over_inflated_error.heavy,
            "board": by.over_inflated.board, "board_error": by.over_inflated_error.board,
            "beyond": by.over_board.own, "beyond_error": by.over_board_error.own,
        })  # fmt: skip
    return pd.DataFrame(rows), {"group": group}


def positions_agreement(documents: dict[str, dict]) -> pd.DataFrame:
    """One row a model: how far apart recordings are, what they claim, what the intervals cover.

    ``documents``: diagnosis.json by recording, two or more of one board. Differences of all
    pairs in all coordinates but the reference triad's; metres.
    """
    rows = []
    for model in MODELS:
        tables = []
        for name, document in documents.items():
            means, sds = (document[model][key][1:] for key in ("positions_m", "positions_sd_m"))
            tables.append(coordinate_table(range(len(means)), means, sds, recording=name))
        table = pd.concat(tables)
        pairs = pairwise(table)
        found = agreement(pairs, table)
        rows.append({
            "model": model, "recordings": len(documents), "differences": len(pairs),
            "apart_rms_m": rms(pairs.difference_m),
            "apart_median_m": float(pairs.difference_m.abs().median()),
            "claimed_rms_m": rms(pairs.sd_m),
            "z_rms": found["z_rms"], "coverage_95": found["coverage_95"],
        })  # fmt: skip
    return pd.DataFrame(rows)


def parameters_agreement(documents: dict[str, dict]) -> pd.DataFrame:
    """One row an effect: in how many recordings it was adopted, and how its numbers repeat.

    ``spread``: rms between recordings around each parameter's mean; ``size``: rms of the means;
    ``correlation`` of the parameters between pairs of recordings, averaged. A parameter counts
    where two or more recordings have it.
    """
    values: dict[str, dict[str, dict[str, float]]] = {}
    for name, document in documents.items():
        for cause in document["causes"]:
            for key, item in cause["parameters"].items():
                if item["sd"] is not None:
                    values.setdefault(cause["effect"], {}).setdefault(key, {})[name] = item["value"]
    rows = []
    for effect, table in values.items():
        frame = pd.DataFrame(table).T
        having = frame.shape[1]
        shared = frame.dropna()
        row = {"effect": effect, "recordings": having, "parameters": len(frame)}
        if having > 1 and len(shared):
            middle = shared.mean(axis=1)
            row |= {"size": rms(middle), "spread": rms(shared.sub(middle, axis=0).to_numpy())}
            if len(shared) > 2:
                pairs = shared.corr().to_numpy()[np.triu_indices(having, 1)]
                row["correlation"] = float(np.mean(pairs))
        rows.append(row)
    order = ["effect", "recordings", "parameters", "size", "spread", "correlation"]
    return pd.DataFrame(rows).reindex(columns=order)


def recordings_table(documents: dict[str, dict]) -> pd.DataFrame:
    """One row a recording: what the papers' model leaves, what the causes leave, and the gain.

    ``force`` and ``rate`` columns are residuals in m/s^2 and rad/s (rms, less what the motion
    takes up); gains are nats a sample on held-out time over the papers' model with inflated noise.
    """
    rows = []
    for name, document in documents.items():
        before, after = (document[model]["residual_sd"] for model in ("base", "extended"))
        gain = document["gain"]
        named = [cause["effect"] for cause in document["causes"]]
        parameters = [x for cause in document["causes"] for x in cause["parameters"].values()]
        rows.append({
            "recording": name, "samples": document["samples"],
            "force_before": before["specific_force"], "force_after": after["specific_force"],
            "rate_before": before["angular_rate"], "rate_after": after["angular_rate"],
            "gain": gain["over_inflated_noise_nats_per_sample"],
            "gain_se": gain["over_inflated_noise_nats_per_sample_se"],
            "unexplained": document["unexplained"], "causes": " ".join(named),
            "parameters_with_sd": sum(each["sd"] is not None for each in parameters),
        })  # fmt: skip
    return pd.DataFrame(rows)
