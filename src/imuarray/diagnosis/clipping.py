"""Single readings far from the prediction: a rail that clips a single one, or another cause.

Where a rail clips several readings they pile up at one value, which needs no model
(`imuarray.diagnosis.reading_effects`); one alone is seen only beside its prediction.
"""

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from imuarray.diagnosis.reading_effects import RAILS, Structural, rails_cause, unique
from imuarray.diagnosis.residual_checks import Check
from imuarray.diagnosis.settings import SETTINGS
from imuarray.diagnosis.state import Search
from imuarray.model.effects import KINDS
from imuarray.tails import log_normal


class Peak(NamedTuple):
    """A triad's largest reading."""

    imu: int
    kind: int
    at: np.ndarray  # (T, 3) bool: the reading, with any that are as large
    size: float  # SI
    inward: float  # sds by which it falls short of its prediction
    others: float  # sds by which any other reading of the triad is off at most
    apart: float  # ``inward`` less what the next largest readings fall short by, in their own sds


def peaks(search: Search) -> list[Peak]:
    """Of every triad."""
    residual, readings, found = search.fit.residual, search.readings, []
    for imu, kind in np.argwhere(readings.exists):
        block = np.s_[:, imu, 3 * kind : 3 * kind + 3]
        kept, values = readings.keep[block], readings.values[block]
        size = np.where(kept, np.abs(values), 0.0)
        at = size >= size.max() * (1 - 1e-9)
        short = -np.sign(values) * residual[block]
        rest = kept & ~at
        # what bends all large readings alike is no rail
        near = short[rest][np.argsort(size[rest])[-SETTINGS.next_largest :]]
        spread = max(float(np.std(near)), 1.0) * np.sqrt(1 + 1 / SETTINGS.next_largest)
        inward = float(np.max(short[at]))
        others = float(np.max(np.abs(residual[block])[rest]))
        apart = (inward - float(np.mean(near))) / spread
        found.append(Peak(int(imu), int(kind), at, float(size.max()), inward, others, apart))
    return found


def clipped(found: list[Peak], limit: float) -> tuple[list[Peak], float]:
    """Those that fall short far more than anything else does, or all of a kind together."""
    logs = {id(p): float(log_normal(p.inward) + np.log(len(found))) for p in found}
    # two at one value are more than an outlier
    least_off = {id(p): p.others * (SETTINGS.alone if p.at.sum() == 1 else 1.0) for p in found}
    hit = [p for p in found if logs[id(p)] < limit and p.inward > least_off[id(p)]]
    least = min((logs[id(p)] for p in hit), default=0.0)
    for kind in range(len(KINDS)):
        own = [p for p in found if p.kind == kind]
        pooled = sum(p.apart for p in own) / np.sqrt(max(len(own), 1))
        log_p = float(log_normal(pooled) + np.log(len(KINDS)))
        if log_p < min(limit, least) and np.median([p.apart for p in own]) > 1.0:
            hit, least = [p for p in hit if p.kind != kind] + own, log_p
    return hit, least


def leave_out_clips(search: Search, without=()) -> tuple[Search, list[Structural]]:
    """Triads whose largest reading falls short of its prediction, far more than any other does.

    Those readings are left out of the search from here on.
    """
    hit, log_p = ([], 0.0) if RAILS in without else clipped(peaks(search), SETTINGS.check)
    if not hit:
        return search, []
    lost = np.zeros(search.readings.keep.shape, bool)
    for peak in hit:
        lost[:, peak.imu, 3 * peak.kind : 3 * peak.kind + 3] = peak.at
    search = replace(search, readings=search.readings.without(lost)).refit()
    says = "the largest reading alone stays below what it should be, as at a rail"
    found = rails_cause([(peak.imu, peak.kind, peak.size) for peak in hit], log_p, says)
    return replace(search, allowed=search.allowed & ~lost), [found]


def together(first: list[Structural], second: list[Structural]) -> list[Structural]:
    """Both lists, what is in both as one cause in the first's words."""
    names = {item.effect: item for item in first}
    for new in second:
        old = names.get(new.effect, new)
        imus, log_p = unique([*old.imus, *new.imus]), min(old.log_p, new.log_p)
        names[new.effect] = old._replace(imus=imus, log_p=log_p)
    return list(names.values())


def lone_checks(search: Search, tailed) -> list[Check]:
    """The reading farthest from its prediction, but for triads whose tails are known."""
    known = {(imu, kind) for imu, kind, _ in tailed}
    size = np.abs(search.fit.residual)
    for imu, kind in known:
        size[:, imu, 3 * kind : 3 * kind + 3] = 0.0
    place = np.unravel_index(int(np.argmax(size)), size.shape)
    farthest = float(size[place])
    log_p = float(log_normal(farthest) + np.log(2 * size.size))
    return [Check("farthest reading", farthest, min(log_p, 0.0), (int(place[1]),))]
