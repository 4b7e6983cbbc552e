"""Recordings of one board: do their positions, and the causes' numbers, agree?"""

from __future__ import annotations

from itertools import combinations

import numpy as np
import pandas as pd

MODELS = ("base", "inflated", "extended")
WITHIN = 1.959964  # sds of a 95 % interval


def positions_agreement(documents: dict[str, dict]) -> pd.DataFrame:
    """One row a model: how far apart recordings are, what they claim, what the intervals cover.

    ``documents``: diagnosis.json by recording, two or more of one board. Differences of all
    pairs in all coordinates but the reference triad's; metres.
    """
    rows = []
    for model in MODELS:
        apart, claimed = [], []
        for one, other in combinations(documents.values(), 2):
            found = [np.array(d[model]["positions_m"])[1:] for d in (one, other)]
            sds = [np.array(d[model]["positions_sd_m"])[1:] for d in (one, other)]
            apart.append((found[0] - found[1]).ravel())
            claimed.append(np.hypot(*sds).ravel())
        apart, claimed = np.concatenate(apart), np.concatenate(claimed)
        rows.append({
            "model": model, "recordings": len(documents), "differences": len(apart),
            "apart_rms_m": float(np.sqrt(np.mean(apart**2))),
            "apart_median_m": float(np.median(np.abs(apart))),
            "claimed_rms_m": float(np.sqrt(np.mean(claimed**2))),
            "z_rms": float(np.sqrt(np.mean((apart / claimed) ** 2))),
            "coverage_95": float(np.mean(np.abs(apart) < WITHIN * claimed)),
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
            row["size"] = float(np.sqrt(np.mean(middle**2)))
            row["spread"] = float(np.sqrt(np.mean(shared.sub(middle, axis=0).to_numpy() ** 2)))
            if len(shared) > 2:
                pairs = shared.corr().to_numpy()[np.triu_indices(having, 1)]
                row["correlation"] = float(np.mean(pairs))
        rows.append(row)
    order = ["effect", "recordings", "parameters", "size", "spread", "correlation"]
    return pd.DataFrame(rows).reindex(columns=order)
