"""The numbers behind a diagnosis's figures, one table (a row per mark) for each of them."""

import numpy as np
import pandas as pd
from scipy.special import ndtri

from imuarray.diagnosis.adoption import separability
from imuarray.diagnosis.document import Diagnosis, Fitted
from imuarray.diagnosis.fit import Fit
from imuarray.diagnosis.noise import standardised
from imuarray.diagnosis.replicates import TESTS
from imuarray.diagnosis.settings import SETTINGS
from imuarray.model.effects import KINDS
from imuarray.words import sensors_of

BAND = ndtri(0.975)  # sds of a 95 % band


def in_declared_sds(made: Fit) -> np.ndarray:
    """Residuals (T, N, 6) over the declared noise, corrected for what the motion takes up."""
    readings = made.readings
    return standardised(made) * np.repeat(readings.sd / readings.declared, 3, axis=1)


def in_noise_sds(fitted: Fitted) -> dict[str, float]:
    """rms of the residual over the declared noise, by kind: 1 where the noise is as declared."""
    unit, exists = in_declared_sds(fitted.fit), fitted.fit.readings.exists
    return {
        name: float(np.sqrt(np.nanmean(unit[:, :, 3 * kind : 3 * kind + 3] ** 2)))
        for kind, name in enumerate(KINDS) if exists[:, kind].any()
    }  # fmt: skip


def discrepancy_table(diagnosis: Diagnosis) -> pd.DataFrame:
    """One row for each check and model: the statistic in sds of its simulated band.

    ``standardised`` has the band's median as 0 and its half width as 1.96; ``limit`` is what the
    worst of the check's n sensors reaches in 95 % of simulations, if they are independent.
    """
    exists = diagnosis.base.fit.readings.exists
    rows = []
    for model in ("base", "extended"):
        for item in getattr(diagnosis, model).discrepancies:
            kind, name = item.check.split(" ", 1)
            band = item.simulated
            far = item.statistic - band["median"]
            edge = (band["q975"] - band["q025"]) / 2
            number = exists[:, KINDS.index(kind)].sum() * (3 if TESTS[name].by_axis else 1)
            rows.append({
                "model": model, "kind": kind, "check": name, "label": TESTS[name].label,
                "statistic": item.statistic, "q025": band["q025"], "q975": band["q975"],
                "standardised": BAND * far / max(edge, 1e-300),
                "limit": -ndtri((1 - 0.95 ** (1 / number)) / 2), "p_value": item.p_value,
            })  # fmt: skip
    return pd.DataFrame(sorted(rows, key=lambda row: list(TESTS).index(row["check"])))


def detectable_table(diagnosis: Diagnosis) -> pd.DataFrame:
    """One row an effect: the smallest size that would be named (median of an IMU's parameters).

    ``best`` and ``worst`` are those of the IMUs ``best_imu`` and ``worst_imu``; ``found`` is the
    rms of the parameters of a cause, NaN of others; ``typical`` the prior sd; ``unit`` of all.
    """
    causes = {cause["effect"]: cause["parameters"] for cause in diagnosis.document["causes"]}
    columns, rows = diagnosis.found.search.columns, []
    for effect, entry in diagnosis.document["detectable"].items():
        unit = next(iter(entry["units"].values()))
        alike = [name for name, other in entry["units"].items() if other == unit]
        sizes = {
            imu: np.median([size for name, size in own.items() if name in alike])
            for imu, own in entry["sizes"].items() if set(own) & set(alike)
        }  # fmt: skip
        best, worst = min(sizes, key=sizes.get), max(sizes, key=sizes.get)
        items = [item["value"] for item in causes.get(effect, {}).values() if item["unit"] == unit]
        rows.append({
            "effect": effect, "best_imu": best, "best": sizes[best], "worst_imu": worst,
            "worst": sizes[worst], "found": np.sqrt(np.mean(np.square(items))) if items else np.nan,
            "unit": unit, "typical": float(np.ravel(columns.usual_sd)[columns.of(effect)[0]]),
        })  # fmt: skip
    return pd.DataFrame(rows)


def residual_table(diagnosis: Diagnosis) -> pd.DataFrame:
    """One row for each model, IMU, kind and axis ("all": the triad): rms in declared noise sds.

    ``noise`` is the extended model's own noise sd in that unit, ``half_width`` that of the 95 %
    band of white noise of the declared size.
    """
    noise = diagnosis.found.search.readings
    rows = []
    for model in ("base", "extended"):
        made = getattr(diagnosis, model).fit
        readings, unit = made.readings, in_declared_sds(made)
        for imu, kind in np.argwhere(readings.exists):
            triad = unit[:, imu, 3 * kind : 3 * kind + 3]
            count = max(int(np.isfinite(triad).sum()), 1)
            shared = {
                "model": model, "kind": KINDS[kind], "imu": readings.labels[imu],
                "noise": noise.sd[imu, kind] / noise.declared[imu, kind],
            }  # fmt: skip
            parts = {"all": triad, **dict(zip("xyz", triad.T, strict=True))}
            for axis, part in parts.items():
                size = float(np.sqrt(np.nanmean(part**2))) if np.isfinite(part).any() else np.nan
                spread = BAND / np.sqrt(2 * count / (1 if axis == "all" else 3))
                rows.append(shared | {"axis": axis, "rms": size, "half_width": spread})
    return pd.DataFrame(rows)


def noise_table(diagnosis: Diagnosis) -> pd.DataFrame:
    """One row a triad: declared and extended noise sds (SI), lag-one correlation, residuals' rms.

    ``before`` and ``after`` are the residuals of the two models in declared sds.
    """
    search = diagnosis.found.search
    readings, units = search.readings, ("m s-2", "rad s-1")
    sizes = residual_table(diagnosis).query("axis == 'all'").set_index(["model", "kind", "imu"]).rms
    return pd.DataFrame([
        {
            "kind": KINDS[kind], "imu": readings.labels[imu], "unit": units[kind],
            "declared": readings.declared[imu, kind], "sd": readings.sd[imu, kind],
            "correlation": search.noise.correlation[imu, kind],
            "before": sizes["base", KINDS[kind], readings.labels[imu]],
            "after": sizes["extended", KINDS[kind], readings.labels[imu]],
        }
        for kind in range(2) for imu in np.flatnonzero(readings.exists[:, kind])
    ])  # fmt: skip


def gain_table(diagnosis: Diagnosis) -> pd.DataFrame:
    """One row for each cause in the order of adoption, and for the whole model; nats.

    ``adopted`` is the gain when a cause was adopted, with those before it alone; ``placebo`` what
    its numbers gain when they are given to other IMUs.
    """
    document = diagnosis.document
    first = dict(reversed(diagnosis.found.search.trace))
    rows = []
    for cause in document["causes"]:
        # a single clock's ages have no other to go to: its placebo is exactly 0
        placebo = cause.get("placebo_gain_nats") or np.nan
        rows.append({
            "what": cause["effect"], "sensors": ", ".join(cause["sensors"]),
            "gain": cause["heldout_gain_nats"], "se": cause["heldout_gain_se"],
            "adopted": first.get(cause["effect"], np.nan), "placebo": placebo,
        })  # fmt: skip
    gain, samples = document["gain"], document["samples"]
    for key, what in (
        ("heldout_log_score_nats_per_sample", "over the declared noise"),
        ("over_inflated_noise_nats_per_sample", "over inflated noise"),
    ):
        rows.append({
            "what": what, "sensors": "model", "gain": samples * gain[key],
            "se": samples * gain[f"{key}_se"], "adopted": np.nan, "placebo": np.nan,
        })  # fmt: skip
    return pd.DataFrame(rows)


def position_table(diagnosis: Diagnosis) -> pd.DataFrame:
    """One row for each triad but the reference: positions and sds of both models, m."""
    document = diagnosis.document
    names = diagnosis.found.search.readings.labels[: len(document["base"]["positions_m"])]
    pairs = [(label, axis) for label in names for axis in "xyz"]
    table = pd.DataFrame(pairs, columns=["imu", "axis"])
    for model in ("base", "extended"):
        table[model] = np.ravel(document[model]["positions_m"])
        table[f"{model}_sd"] = np.ravel(document[model]["positions_sd_m"])
    # but for the reference, the origin
    known = np.repeat(np.any(document["base"]["positions_sd_m"], axis=1), 3)
    table = table[known].reset_index(drop=True)
    return table.assign(change=table.extended - table.base)


def separability_table(diagnosis: Diagnosis) -> pd.DataFrame:
    """One row for each pair of effects: the largest and the mean squared canonical correlation."""
    search = diagnosis.found.search
    found = separability(search.given, search.fit, [(c.effect, c.imus) for c in search.causes])
    rows = [(*pair, *alike) for pair, alike in found.items()]
    return pd.DataFrame(rows, columns=["effect", "other", "largest", "mean"])


def score_table(diagnosis: Diagnosis) -> pd.DataFrame:
    """The most significant test of each effect at the plain model, before any cause is adopted.

    ``log10_p`` allows for its IMUs and forms; ``limit`` is the critical value.
    """
    search, best = diagnosis.found.search, {}
    for score in diagnosis.found.base_scores:  # best first
        best.setdefault(score.candidate.effect, score)
    adopted = {cause.effect for cause in search.causes}
    return pd.DataFrame([
        {
            "effect": effect, "form": score.candidate.variant,
            "imus": ", ".join(sensors_of(search.readings.labels, score.candidate.imus)),
            "statistic": score.statistic, "freedom": score.freedom,
            "log10_p": score.log_p / np.log(10),
            "limit": SETTINGS.limit(effect) / np.log(10), "adopted": effect in adopted,
        }
        for effect, score in best.items()
    ])  # fmt: skip
