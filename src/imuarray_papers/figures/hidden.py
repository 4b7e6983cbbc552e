"""Effects that were hidden in recordings: what was found, and what it is worth."""

import numpy as np
import pandas as pd

from imuarray.geometry import Array
from imuarray.model.effects import known_effect
from imuarray.pictures.style import BLACK, PAGE
from imuarray_papers.blind.study import accuracy, classes
from imuarray_papers.figures.criticism import draw_gained, estimated, letter, three_digits
from imuarray_papers.figures.style import drawing, marks, panels, rms

MODELS = {"base": "papers'", "inflated": "noise inflated", "extended": "extended"}


def figure_criticism_hidden(diagnosis: tuple, truth: dict, recordings: Array):
    """Four panels where the truth is known: lever arms hidden in a simulated recording.

    ``diagnosis`` (diagnosis.json, tables); ``truth``: what `blind.cases.make` says;
    ``recordings``: the array as the recording declares it.
    """
    document, tables = diagnosis
    residual = tables["residual"]
    cause = next(table for key, table in tables.items() if key.startswith("cause_01"))
    cause = cause[cause.panel == cause.panel.min()]
    rows = []
    for model, name in MODELS.items():
        off = accuracy(document[model], truth["positions_m"])
        covered = off["covered"] / off["coordinates"]
        rows.append({"model": name, "rms_m": off["position_rmse_m"], "covered": covered})
    gain = document["gain"]
    nats = [gain[f"over_inflated_noise_nats_per_sample{end}"] for end in ("", "_se")]
    table = panels(
        wrong=residual[residual.axis == "all"][["model", "kind", "imu", "rms"]],
        cause=cause[["x", "y", "se", "model", "series"]].rename(columns={"model": "predicted"}),
        extended=_arms(document, truth, recordings.turns), gained=pd.DataFrame(rows),
        left_out=pd.DataFrame([nats], columns=["over_inflated", "over_inflated_error"]),
    )  # fmt: skip
    hidden = truth["effects"][0]
    named = ", ".join(f"{c['effect']} ({' '.join(c['sensors'])})" for c in document["causes"])
    size = 1e3 * hidden["amplitude"]["value"]
    footer = [
        f"Lever arms of all IMUs, {size:.2g} mm, hidden in a simulated recording by code that"
        f" shares nothing with the model; named: {named or 'nothing'}. (a) rms residual over the"
        " declared noise; open: under the extended model. (b) what the cause predicts, and what is"
        " back in the residual without it, in noise sds. (c) parameters less what motion and"
        " positions take up. (d) rms error of the positions, and how many of the 95 % intervals"
        " hold the truth."
    ]
    return drawing(_draw_hidden, footer, PAGE, 2.5), three_digits(table)


def _arms(document: dict, truth: dict, turns) -> pd.DataFrame:
    """Lever arms found and true, m, by the array's axes, less the means that nothing shows."""
    cause = next(c for c in document["causes"] if c["effect"] == "size_effect")
    found = np.array([item["value"] for item in cause["parameters"].values()]).reshape(-1, 3, 3)
    true = np.array(truth["effects"][0]["parameters"]["lever_arm"]["value"])
    # from each chip's axes to those of the array that they lie along
    found = np.einsum("kia,kxj,kaj->kix", np.abs(turns), turns, found)
    both = [x - x.mean(0) - x.mean(1, keepdims=True) + x.mean((0, 1)) for x in (found, true)]
    return pd.DataFrame({"found_m": both[0].ravel(), "true_m": both[1].ravel()})


def _draw_hidden(figure, table):
    axes = figure.subplots(1, 4)
    part = dict(list(table.groupby("panel")))
    sizes = part["wrong"].groupby("model").rms.max()
    _draw_residuals(axes[0], part["wrong"])
    axes[0].set_title(f"Wrong: {sizes.base:.1f} × the noise")
    _draw_seen(axes[1], part["cause"])
    arms = 1e3 * part["extended"][["true_m", "found_m"]]
    axes[2].plot(arms.true_m, arms.found_m, **marks(2, markersize=3))
    axes[2].axline((0, 0), slope=1, color=BLACK, linewidth=0.8)
    said = f"Extended: {sizes.extended:.1f} × the noise"
    axes[2].set(xlabel="true (mm)", ylabel="found (mm)", title=said)
    gain, error = part["left_out"][["over_inflated", "over_inflated_error"]].iloc[0]
    said = f"held out: +{gain:.1f} ± {error:.1f} nats"
    draw_gained(axes[3], part["gained"], said, "error of positions (µm)")
    letter(axes)


def _draw_residuals(axes, rows) -> None:
    for number, (kind, each) in enumerate(rows.groupby("kind")):
        for model, fill in (("base", {}), ("extended", {"markerfacecolor": "none", "zorder": 4})):
            some = each[each.model == model]
            label = f"{kind}s" if model == "base" else None
            axes.plot(some.imu.astype(str), some.rms, label=label, **marks(number), **fill)
    axes.set(xlabel="IMU", ylabel="residual / noise", ylim=(0, 1.4 * rows.rms.max()))
    axes.legend(fontsize=6)


def _draw_seen(axes, rows) -> None:
    for number, (kind, each) in enumerate(rows.groupby("series")):
        axes.errorbar(each.x, each.y, 2 * each.se, label=kind, **marks(number, markersize=3))
    ends = rows.x.min(), rows.x.max()
    axes.plot(ends, ends, color=BLACK, linewidth=0.8)
    axes.set(xlabel="predicted (noise sds)", ylabel="seen (noise sds)", title="Cause: lever arms")
    axes.legend(fontsize=6)


def table_criticism_hidden(diagnoses: list, truths: list, controls: list, names: list):
    """Hidden effects, and what the diagnosis says of them, a row a recording.

    ``diagnoses``, ``controls`` (diagnosis.json, tables) with the effect and without;
    ``truths``: what was hidden in the recordings ``names``.
    """
    rows = []
    for name, truth, (document, _), (control, _) in zip(
        names, truths, diagnoses, controls, strict=True
    ):
        hidden, before = truth["effects"][0], classes(control["causes"])
        new = [cause for cause in document["causes"] if cause["effect"] not in before]
        of = [(c, {*c["indistinguishable_from"], *known_effect(c["effect"]).contains}) for c in new]
        mine = [c for c, parts in of if hidden["effect"] in {c["effect"], *parts}]
        size, true_size = _sizes(mine, hidden)
        too = "this too" if hidden["effect"] in set().union(*before.values()) else "not this"
        rows.append({
            "recording": name, "hidden": hidden["effect"], "sensors": " ".join(hidden["sensors"]),
            "named": ", ".join(cause["effect"] for cause in new) or "nothing",
            "named_sensors": ", ".join(" ".join(cause["sensors"]) for cause in new),
            "size": size, "true_size": true_size,
            "gain": f"{mine[0]['heldout_gain_nats']:.3g}" if mine else "",
            "control": f"{len(before)} of its own, {too}" if before else "nothing",
        })  # fmt: skip
    return pd.DataFrame(rows), {}


def _sizes(causes: list, hidden: dict) -> tuple[str, str]:
    """(found ± its sd, true) along the true parameters; rms of both where these are others."""
    parameters = [np.ravel(p["value"]) for p in hidden["parameters"].values()]
    true = max(parameters, key=len).astype(float)
    unit, size = hidden["amplitude"]["unit"], float(np.linalg.norm(true))
    if not causes:
        return "", f"{size:.3g} {unit}"
    values, sds, _ = estimated(causes[0])
    if len(values) != len(true) or hidden["effect"] != causes[0]["effect"] or len(true) > 9:
        return f"{rms(values):.3g} {unit} rms", f"{rms(true):.3g} {unit} rms"
    found, sd = values @ true / size, np.linalg.norm(sds * true) / size
    return f"{found:.4g} ± {sd:.1g} {unit}", f"{size:.4g} {unit}"
