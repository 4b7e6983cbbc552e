"""Recordings of one board: do their positions, and the causes' numbers, agree?"""

import numpy as np
import pandas as pd

from imuarray.recording.record import AXES
from imuarray_papers.measured.positions import agreement, pairwise

MODELS = ("base", "inflated", "extended")


def positions_agreement(documents: dict[str, dict]) -> pd.DataFrame:
    """One row a model: how far apart recordings are, what they claim, what the intervals cover.

    ``documents``: diagnosis.json by recording, two or more of one board. Differences of all
    pairs in all coordinates but the reference triad's; metres.
    """
    rows = []
    for model in MODELS:
        table = pd.concat([coordinates(d[model], name) for name, d in documents.items()])
        pairs = pairwise(table)
        found = agreement(pairs, table)
        rows.append({
            "model": model, "recordings": len(documents), "differences": len(pairs),
            "apart_rms_m": float(np.sqrt(np.mean(pairs.difference_m**2))),
            "apart_median_m": float(pairs.difference_m.abs().median()),
            "claimed_rms_m": float(np.sqrt(np.mean(pairs.sd_m**2))),
            "z_rms": found["z_rms"], "coverage_95": found["coverage_95"],
        })  # fmt: skip
    return pd.DataFrame(rows)


def coordinates(section: dict, recording: str) -> pd.DataFrame:
    """A model's positions as `imuarray_papers.measured.positions.pairwise` takes them, m."""
    means, sds = (np.array(section[key])[1:] for key in ("positions_m", "positions_sd_m"))
    rows = [(number, axis) for number in range(len(means)) for axis in AXES]
    table = pd.DataFrame(rows, columns=["accelerometer", "axis"])
    return table.assign(recording=recording, mean_m=means.ravel(), sd_m=sds.ravel())


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
            row["size"] = float(np.sqrt(np.mean(middle**2)))
            row["spread"] = float(np.sqrt(np.mean(shared.sub(middle, axis=0).to_numpy() ** 2)))
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
        free = sum(
            item["sd"] is not None
            for cause in document["causes"] for item in cause["parameters"].values()
        )  # fmt: skip
        rows.append({
            "recording": name, "samples": document["samples"],
            "force_before": before["specific_force"], "force_after": after["specific_force"],
            "rate_before": before["angular_rate"], "rate_after": after["angular_rate"],
            "gain": gain["over_inflated_noise_nats_per_sample"],
            "gain_se": gain["over_inflated_noise_nats_per_sample_se"],
            "unexplained": document["unexplained"], "causes": " ".join(named),
            "parameters_with_sd": free,
        })  # fmt: skip
    return pd.DataFrame(rows)
