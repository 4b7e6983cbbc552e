"""What is special in the search for some effects: the one place that says so, by id."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from imuarray.diagnosis.clocks import maybe_clock, placebo_of_ages, sawtooth_scan
from imuarray.diagnosis.elimination import need
from imuarray.diagnosis.residual_checks import Check
from imuarray.diagnosis.scans import (
    SHIFT,
    WARM_UP,
    maybe_grown,
    maybe_warming,
    refine_instants,
    scan_shifts,
    scan_warming,
)
from imuarray.diagnosis.scores import Candidate, Scanned, score_all
from imuarray.diagnosis.settings import SETTINGS
from imuarray.engine.clocks import CLOCK, DELAY
from imuarray.engine.fit import flat_parameters
from imuarray.model.effects import EFFECTS
from imuarray.tails import log_chi_square

DRIFT = "bias_drift"


class Special(NamedTuple):
    """An effect's own steps; None where it has none.

    ``scan`` (fit, given, imus, scores) -> [Scanned] of those IMUs; ``linear``: whether one
    linearisation at what was found predicts anything; ``refine`` (search, imus) -> search, after
    its adoption; ``maybe`` (search, cause, chi-square) -> whether it may be what was named as
    another ``cause``; ``placebo`` (search) -> (nats, nats); ``check`` (search, cause) -> [Check].
    """

    scan: Callable | None = None
    linear: bool = True
    refine: Callable | None = None
    maybe: Callable | None = None
    placebo: Callable | None = None
    check: Callable | None = None


def scans(fit, given, effects, scores, taken=lambda effect: ()) -> list[Scanned]:
    """All scans, of IMUs that can have the effect and have not (``taken`` (effect) -> IMUs)."""
    exists, found = fit.readings.exists, []
    for effect, special in SPECIAL.items():
        if special.scan is None or effect not in effects:
            continue
        whole = EFFECTS[effect].sensors == "imu"
        able = exists.all(axis=1) if whole else exists[:, 0]
        imus = [int(k) for k in np.flatnonzero(able) if k not in taken(effect)]
        found += special.scan(fit, given, imus, scores) if imus else []
    return found


def scan_clocks(fit, given, imus, scores) -> list[Scanned]:
    """Clocks, beyond the constant delays that were tested."""
    delays = {s.candidate.imus: s.statistic for s in scores if s.candidate.effect == DELAY}
    return sawtooth_scan(fit, given, imus, delays)


def maybe_drift(search, cause, own) -> bool:
    """Whether a bias may change through the recording: not enough to be adopted, but likely.

    Or as likely grows from nothing.
    """
    if maybe_grown(search, cause):
        return True
    kind = EFFECTS[cause.effect].sensors
    tried = [Candidate(DRIFT, cause.imus, f"{kind} {form}") for form in ("linear", "cubic")]
    scores = score_all(search.given, search.fit, tried)
    return any(
        log_chi_square(max(s.statistic, 1e-9), s.freedom) < SETTINGS.likely_drift for s in scores
    )


def drift_check(search, cause) -> list[Check]:
    """A drift that needs its constants only: a misattributed offset."""
    columns = search.columns
    changing = [c for c in columns.of(DRIFT) if columns.places[c][2] > 0]
    statistic, freedom = need(search, DRIFT, among=changing)
    steady = log_chi_square(statistic, max(freedom, 1)) > SETTINGS.limit(DRIFT)
    steady |= statistic < SETTINGS.changing * need(search, DRIFT)[0]
    return [
        Check(f"change of {DRIFT}", statistic, SETTINGS.steady_drift if steady else 0.0, cause.imus)
    ]


SPECIAL = {
    CLOCK: Special(
        scan=scan_clocks, linear=False, maybe=maybe_clock, placebo=placebo_of_ages
    ),
    SHIFT: Special(scan=lambda fit, given, imus, _: scan_shifts(fit, given, imus),
                          refine=refine_instants),
    WARM_UP: Special(scan=scan_warming, maybe=maybe_warming),
    DRIFT: Special(maybe=maybe_drift, check=drift_check),
}  # fmt: skip


def placebo_gain(search, cause) -> tuple[float, float]:
    """(nats the cause gains, nats it gains with each IMU's numbers given to the next).

    Against the same model with the cause's parameters at zero, all others refitted (quadratic).
    """
    special = SPECIAL.get(cause.effect)
    if special and special.placebo:
        return special.placebo(search)
    given, columns = search.given, search.columns
    every = np.zeros(search.active.shape, bool)
    every[:, columns.of(cause.effect)] = search.active[:, columns.of(cause.effect)].any(axis=0)
    every &= columns.owner
    flat = flat_parameters(columns, search.fit.state)
    rows = np.flatnonzero(every.any(axis=1))
    moved = flat.copy()
    moved[rows] = flat[np.roll(rows, 1)]
    places = given.places(every)
    active = np.setdiff1d(given.places(search.active), places)
    block, slope, *_ = given.conditional(active, of=places)

    def nats(values):
        step = values - flat[every]
        return slope @ step - step @ block @ step / 2

    nothing = nats(np.zeros(len(places)))
    return float(-nothing), float(nats(moved[every]) - nothing)
