"""Gain of each cause: a board's recordings fitted group by group, and how the positions repeat."""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import pandas as pd

from imuarray.engine.estimate import Estimate, Recorded, estimate
from imuarray.engine.forward import GYROSCOPES, LAG, ROUGH_GROUPS, Selected, gains
from imuarray.engine.parameters import POSITION, columns_of
from imuarray.engine.readings import arrange, determined, most_informative
from imuarray.engine.widths import widths
from imuarray.recording import Recording
from imuarray_papers.measured.positions import coordinate_table, pairwise

ARMS = "lever arms of the axes"
STEPS = {
    "normal": "papers' model, normal noise",
    "robust": "papers' model, Student's t",
    "no clocks": "... and lag, maps, lever arms",
    "clocks": "Student's t and clocks",
    "no arms": "... and lag, maps",
    "own arms": "... and lever arms, each chip's own",
    "common arms": "... nearly common to all chips",
}


def stepwise(recording: Recording) -> pd.DataFrame:
    """Positions of a corrected recording under each of `STEPS`, a row a coordinate.

    Columns step, accelerometer, axis, mean_m, sd_m; and of the step residual_ratio (rms residual
    over the declared noise), smooth_ratio (the same of smooth samples, median of all triads, as
    `Estimate.smooth_ratio`), nats and nats_error (a sample, on held-out time, what is new in it
    over the step that it extends; NaN where that is another noise), converged; and
    common_scale_sd of the recording's gyroscopes, whose square the array's size follows.
    """
    readings = arrange(recording, sparse=True)
    readings = most_informative(readings.select(determined(readings, 1)), lambda text: None)
    labels, parts = recording.accelerometer_labels[1:], []
    for step, found, gain in _fits(readings):
        covariance, *_ = widths(found)
        smooth = found.smooth_ratio()
        pairs = np.argwhere(found.active)
        mine = found.places[0][pairs[:, 1] < 3]
        sd = np.sqrt(np.diag(covariance)[mine])
        parts.append(coordinate_table(labels, found.positions[1:], sd, step=step).assign(
            residual_ratio=found.residual_ratio(),
            smooth_ratio=np.nan if smooth is None else np.median(smooth),
            nats=gain[0] / len(readings.time),
            nats_error=gain[1] / len(readings.time), converged=found.converged,
            common_scale_sd=recording.gyroscope_common_scale_sd,
        ))  # fmt: skip
    return pd.concat(parts, ignore_index=True)


def _fits(readings) -> Iterator[tuple[str, Estimate, tuple[float, float]]]:
    """(step, its estimate, (nats gained, their error)), all of `STEPS` in order."""
    effects = [effect for ids in ROUGH_GROUPS.values() for effect in ids]
    columns = columns_of(readings.array, effects, readings.position_prior_sd)
    apart = replace(columns, common_sd=np.zeros(columns.size))
    begun, nothing = [Recorded.of(readings, columns)], (np.nan, np.nan)
    placed = columns.mask([POSITION])
    yield "normal", estimate(begun, columns, placed, noise="normal"), nothing
    robust = Selected(estimate(begun, apart, placed), (readings.keep,), {})
    yield "robust", robust.found, nothing
    yield "no clocks", *_more(robust, [LAG, GYROSCOPES, ARMS])[1:]
    clocked, groups = robust.clocked()
    clocked = clocked.fitted()
    yield "clocks", clocked.found, (groups[0].gain, groups[0].error)
    lagging, found, gain = _more(clocked, [LAG, GYROSCOPES])
    yield "no arms", found, gain
    own, found, gain = _more(lagging, [ARMS])
    yield "own arms", found, gain
    common = own._replace(found=replace(own.found, columns=columns))
    yield "common arms", common.fitted().found, nothing


def _more(now: Selected, names) -> tuple[Selected, Estimate, tuple[float, float]]:
    """With more groups, and what they gain."""
    mask = now.found.columns.mask([effect for name in names for effect in ROUGH_GROUPS[name]])
    group = gains(now.found, {"all": mask}, now.kept)[0]
    now = now.with_kept(names).fitted()
    return now, now.found, (group.gain, group.error)


def repeated(tables: dict[str, pd.DataFrame]) -> pd.DataFrame:
    """Repeatability of positions between recordings, a row for each of `STEPS`.

    ``tables`` {recording: `stepwise`}. Differences of all pairs: rms_m, median_m, covered (share in
    95 % intervals), same_size_rms_m (each array brought to the mean size); size_sd (relative, of
    the arrays' sizes); common_size_m (rms of the coordinates' error by a scale that all share);
    medians over recordings of residual_ratio, smooth_ratio and nats.
    """
    whole = pd.concat([table.assign(recording=name) for name, table in tables.items()])
    rows = []
    for step in STEPS:
        part = whole[whole.step == step]
        wide = part.pivot_table("mean_m", "recording", ["accelerometer", "axis"])
        mean = wide.mean(axis=0)
        size = wide @ mean / (mean @ mean)
        between, alike = pairwise(part), part.copy()
        alike["mean_m"] /= alike.recording.map(size)
        each = part.groupby("recording").first()
        medians = each[["residual_ratio", "smooth_ratio", "nats", "nats_error"]].median()
        rows.append({
            "step": step, "model": STEPS[step], "recordings": len(wide),
            "rms_m": _rms(between.difference_m), "median_m": between.difference_m.abs().median(),
            "same_size_rms_m": _rms(pairwise(alike).difference_m),
            "common_size_m": 2 * part.common_scale_sd.median() * _rms(mean),
            "size_sd": size.std(ddof=1), "covered": np.mean(between.z.abs() < 1.96),
            **medians, "converged": int(each.converged.sum()),
        })  # fmt: skip
    return pd.DataFrame(rows)


def _rms(values) -> float:
    return float(np.sqrt(np.mean(np.square(values))))
