"""Causes adopted one by one: the most telling test, refitted jointly, kept on held-out evidence."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import NamedTuple

import numpy as np

from imuarray.criticism import noise as noises
from imuarray.criticism.columns import POSITION, SCANNED, Columns
from imuarray.criticism.fit import (
    Fit,
    at,
    flat_parameters,
    from_flat,
    loosened,
    normal,
    search_optimum,
)
from imuarray.criticism.linearise import linearise
from imuarray.criticism.readings import Readings
from imuarray.criticism.scans import (
    delay_parts,
    refine_clock,
    refine_instant,
    scan_clocks,
    scan_shifts,
)
from imuarray.criticism.scores import (
    Candidate,
    Evidence,
    candidates,
    evidence,
    log_tail,
    mask_of,
    score_all,
)
from imuarray.criticism.start import is_smooth, start
from imuarray.criticism.thresholds import Thresholds
from imuarray.model import EFFECTS

BLOCKS = 10  # of time, held out in turn
MOST = 12  # causes
KEPT = 0.05  # of the gain that a test promises must be there on held-out time
TRACE = 2e-5  # of the excess there was at first
LEAST_Z = 1.5  # standard errors that a gain on held-out time must have
SURE = 50.0  # nats; smaller promises may break
EDGE = 0.03  # of a turn: how near to a clock's jump a reading is left out
STEADY = 0.02  # relative change of a noise sd below which a fit is not repeated


@dataclass
class Cause:
    """An adopted effect: its IMUs, form and evidence."""

    effect: str
    imus: tuple[int, ...]
    variants: set[str]
    log_p: float
    gain: float = 0.0
    gain_se: float = 0.0


class Rung(NamedTuple):
    """One adoption: what, its test, its gain on held-out time, the misfit after it."""

    effect: str
    imus: tuple[int, ...]
    log_p: float
    gain: float
    gain_se: float
    misfit: float


@dataclass
class Search:
    """The state of a diagnosis: what is adopted, and the fit it leads to."""

    readings: Readings
    columns: Columns
    effects: tuple[str, ...]
    thresholds: Thresholds
    say: Callable[[str], None]
    smooth: bool = True
    causes: list[Cause] = field(default_factory=list)
    fit: Fit | None = None
    noise: noises.Noise | None = None
    given: Evidence | None = None
    refused: set = field(default_factory=set)
    excess: float = 0.0  # of the misfit, before any cause
    jumps: np.ndarray | bool = False  # readings left out near a clock's jump
    allowed: np.ndarray | None = None  # readings that count, outliers included
    trace: list[Rung] = field(default_factory=list)

    @property
    def active(self) -> np.ndarray:
        """Positions and what the causes free, (N, m) bool."""
        mask = np.zeros(self.columns.owner.shape, bool)
        mask[:, self.columns.of(POSITION)] = True
        for cause in self.causes:
            for variant in cause.variants:
                mask |= mask_of(self.columns, Candidate(cause.effect, cause.imus, variant))
        return mask & self.columns.owner

    def refit(self, state=None, turns=2, rough=True) -> None:
        """Fit what is adopted, with the noise that the residual's fast part shows."""
        state = self.fit.state if state is None else state
        turns += bool(self.clocks)
        for turn in range(turns + 2):
            self.edges(state, EDGE / (1 + turn))
            state, converged, seen = search_optimum(
                self.readings, self.columns, self.active, state, self.smooth, rough
            )
            judged = noises.judge_parts(self.readings, seen.residual, seen.basis)
            change = np.max(np.abs(judged.sd / self.readings.sd - 1)[self.readings.exists])
            enough = turn > 0 or not self.clocks
            if (change < STEADY and enough) or (turn + 1 >= turns and change < 5 * STEADY):
                break
            self.readings, state = self.readings.with_sd(judged.sd), self.rewound(state)
        self.fit = at(self.readings, self.columns, self.active, state, converged)
        self.noise = noises.judge(self.fit)
        self.weigh()

    @property
    def clocks(self) -> tuple[int, ...]:
        """IMUs with an adopted clock."""
        return next((c.imus for c in self.causes if c.effect == "sensor_clock"), ())

    def rewound(self, state):
        """The state with its clocks' frequency and phase where the ages say."""
        if not self.clocks:
            return state
        # the readings near the jumps are those that tell the phase
        readings = replace(self.readings, keep=self.readings.keep | self.jumps)
        seen = linearise(readings, self.columns, state, self.columns.of("sensor_delay")[:1])
        parts = delay_parts(seen.residual, seen.whitened[..., 0], seen.through[..., 0])
        whole, chosen = flat_parameters(self.columns, state), self.columns.of("sensor_clock")
        for imu in self.clocks:
            own = (part[:, imu] for part in parts)
            whole[imu, chosen] = refine_clock(readings, whole[imu, chosen], *own)
        return from_flat(self.columns, state, whole)

    def edges(self, state, width) -> None:
        """Leave out a clocked IMU's samples near the sawtooth's jump: which side is a gamble."""
        near = np.zeros(self.readings.keep.shape, bool)
        values = self.columns.model.split(np.asarray(state.parameters))
        for imu in self.clocks:
            _, frequency, phase, _ = values["sensor_clock"][imu]
            turns = frequency * self.readings.time + phase
            near[:, imu] = (np.abs(turns - np.round(turns)) < width)[:, None]
        self.readings = replace(self.readings, keep=(self.readings.keep | self.jumps) & ~near)
        self.jumps = near & self.allowed

    def weigh(self) -> None:
        """The evidence at the present fit."""
        flat = flat_parameters(self.columns, self.fit.state)
        plain = evidence(self.fit, flat)
        meat = noises.coloured_meat(self.fit, plain.information, self.noise.correlation)
        self.given = plain if meat is None else replace(plain, meat=meat)

    def least(self) -> float:
        """The least chi-square of a cause: a share of what is left, and a trace of what there was.

        The second order of a huge effect leaves something that smaller ones would take up.
        """
        left = max(self.fit.misfit - self.fit.free, 0.0)
        return max(self.thresholds.share * left, TRACE * self.excess)

    def polish(self) -> None:
        """The same fit to the end."""
        self.refit(turns=2, rough=False)

    def begin(self, parameters=None, positions=None) -> None:
        """The papers' model, or what another search came to."""
        first = start(self.readings, self.columns)
        if parameters is not None:
            first = first._replace(positions=positions, parameters=parameters)
        self.allowed = self.readings.keep
        self.smooth = is_smooth(self.readings, first.motion)
        self.refit(first if self.smooth else loosened(self.readings, first))
        self.excess = max(self.fit.misfit - self.fit.free, 0.0)


def tried(search: Search) -> list[Candidate]:
    """What may be adopted: neither refused before, nor there already."""
    exists = search.readings.exists
    there = {(c.effect, k, v) for c in search.causes for k in c.imus for v in c.variants}
    found = candidates(search.columns, exists, search.effects)
    return [
        c for c in found
        if (c.effect, c.imus, c.variant) not in search.refused
        and not all((c.effect, k, c.variant) in there for k in c.imus)
        and not (c.effect == "sensor_delay" and set(c.imus) <= set(search.clocks))
    ]  # fmt: skip


def proposals(search: Search):
    """[(score, start values by IMU or None)] of all tests and scans, most telling first."""
    found = [(score, None) for score in score_all(search.given, search.fit, tried(search))]
    exists = search.readings.exists
    both = [int(k) for k in np.flatnonzero(exists.all(axis=1))]
    taken = {(c.effect, k) for c in search.causes for k in c.imus}
    if "sensor_clock" in search.effects:
        imus = [k for k in both if ("sensor_clock", k) not in taken]
        delays = {
            s.candidate.imus: s.statistic for s, _ in found if s.candidate.effect == "sensor_delay"
        }
        found += scan_clocks(search.fit, imus, delays) if imus else []
    if "position_shift" in search.effects:
        imus = [int(k) for k in np.flatnonzero(exists[:, 0]) if ("position_shift", k) not in taken]
        found += scan_shifts(search.fit, search.given, imus)
    refused = search.refused
    named = [
        (s, v)
        for s, v in found
        if (s.candidate.effect, s.candidate.imus, s.candidate.variant) not in refused
    ]
    return sorted(named, key=lambda pair: pair[0].log_p)


def adopt(search: Search) -> None:
    """Forward: adopt while a test is significant, large enough and gains on held-out time."""
    while len(search.causes) < MOST:
        best, values = (proposals(search) or [(None, None)])[0]
        limit = search.thresholds.limit(best.candidate.effect) if best else 0.0
        if best is None or best.log_p > limit:
            break
        if best.statistic < search.least():
            break
        attempt(search, best, values)


def attempt(search: Search, score, values) -> bool:
    """Adopt a candidate, refit, and take it back where held-out time does not gain."""
    candidate = score.candidate
    causes = [replace(c, variants=set(c.variants)) for c in search.causes]
    before = search.readings, search.fit, search.noise, search.given, causes
    merge(search, candidate, score.log_p)
    gain, error = foreseen(search, candidate, values)
    if keeps(score, gain, error):
        search.refit(started(search, candidate, values))
        if candidate.effect == "position_shift":
            move_instant(search, candidate.imus)
        prune(search, candidate.effect)
        gain, error = heldout_gain(search, candidate.effect)
    words = f"{candidate.effect} {candidate.variant} of {label(search, candidate)}"
    if not keeps(score, gain, error):
        search.readings, search.fit, search.noise, search.given, search.causes = before
        search.refused.add((candidate.effect, candidate.imus, candidate.variant))
        search.say(f"refused {words}: held-out gain {gain:.1f} +- {error:.1f}")
        return False
    search.trace.append(
        Rung(candidate.effect, candidate.imus, score.log_p, gain, error, search.fit.misfit)
    )
    search.say(
        f"adopted {words}: log p {score.log_p:.0f}, held-out gain {gain:.0f} +- {error:.0f} nats"
    )
    return True


def keeps(score, gain: float, error: float) -> bool:
    """Whether a gain on held-out time is clear, and a fair part of what the test promised."""
    return gain > LEAST_Z * error and gain > KEPT * (score.statistic / 2 - SURE)


def foreseen(search: Search, candidate: Candidate, values) -> tuple[float, float]:
    """The held-out gain as one linearisation foresees it: it spares hopeless fits.

    A clock's first ages are too rough to foresee anything: (inf, 0).
    """
    if candidate.effect == "sensor_clock":
        return np.inf, 0.0
    state = started(search, candidate, values)
    search.fit = at(search.readings, search.columns, search.active, state, False)
    search.weigh()
    return heldout_gain(search, candidate.effect)


def label(search: Search, candidate) -> str:
    """Whose, in words."""
    return (
        "all" if candidate.whole else ", ".join(search.readings.labels[k] for k in candidate.imus)
    )


def merge(search: Search, candidate: Candidate, log_p: float) -> None:
    """Add a candidate to the causes, to one of the same effect where there is one."""
    for cause in search.causes:
        if cause.effect == candidate.effect:
            cause.imus = tuple(sorted({*cause.imus, *candidate.imus}))
            cause.variants.add(candidate.variant)
            cause.log_p = min(cause.log_p, log_p)
            return
    # a drift or a clock has its own constant: the constant alone is no cause of its own
    inside = {
        "bias_drift": ("accelerometer_bias", "gyroscope_bias"),
        "sensor_clock": ("sensor_delay",),
    }
    for lesser in inside.get(candidate.effect, ()):
        drop(search, lesser, candidate)
    search.causes.append(Cause(candidate.effect, candidate.imus, {candidate.variant}, log_p))


def drop(search: Search, effect: str, wider: Candidate) -> None:
    """Take away a lesser effect of the IMUs where a wider one contains it."""
    for cause in list(search.causes):
        same_kind = wider.variant.split(" ")[0] in (*cause.effect.split("_")[:1], "")
        if cause.effect == effect and same_kind:
            cause.imus = tuple(k for k in cause.imus if k not in wider.imus)
            if not cause.imus:
                search.causes.remove(cause)


def started(search: Search, candidate: Candidate, values):
    """The present state, dropped effects at zero, scanned ones where the scan found them."""
    columns = search.columns
    whole = flat_parameters(columns, search.fit.state)
    held = np.zeros_like(whole, bool)
    for name in SCANNED:
        held[:, columns.of(name)] = True
    whole[~search.active & ~held] = 0.0
    whole[: len(search.fit.state.positions), columns.of(POSITION)] = search.fit.state.positions
    if values is not None:
        for imu, value in values.items():
            whole[imu, columns.of(candidate.effect)] = value
    return from_flat(columns, search.fit.state, whole)


def move_instant(search: Search, imus, times=3) -> None:
    """Refine an adopted step's instant, alternating with the fit."""
    columns = search.columns
    chosen = columns.of("position_shift")
    for _ in range(times):
        whole = flat_parameters(columns, search.fit.state)
        for imu in imus:
            found = refine_instant(search.fit, imu, whole[imu, chosen[3]])
            moved = abs(found - whole[imu, chosen[3]])
            whole[imu, chosen[3]] = found
        search.refit(from_flat(columns, search.fit.state, whole))
        if moved == 0:
            break


def freed_places(search: Search, effect: str, imus=None) -> np.ndarray:
    """Places of an adopted effect's free parameters, of some of its IMUs."""
    mask = search.active.copy()
    others = np.setdiff1d(np.arange(search.columns.size), search.columns.of(effect))
    mask[:, others] = False
    if imus is not None:
        mask[np.setdiff1d(np.arange(len(mask)), imus)] = False
    return search.given.places(mask)


def need(search: Search, effect: str, imus=None) -> tuple[float, int]:
    """(chi-square, degrees of freedom) of an adopted effect against zero, all else refitted."""
    freed = freed_places(search, effect, imus)
    active = np.setdiff1d(search.given.places(search.active), freed)
    conditional = search.given.conditional(active, freed)
    return search.given.test(conditional, freed)


def prune(search: Search, effect: str) -> None:
    """Of an effect adopted for many IMUs, keep those that need it, where they are the fewer."""
    cause = next((c for c in search.causes if c.effect == effect), None)
    if cause is None or len(cause.imus) < 3:
        return
    limit = search.thresholds.limit(effect) - np.log(len(cause.imus))
    keep = []
    for imu in cause.imus:
        statistic, freedom = need(search, effect, [imu])
        if freedom and log_tail(statistic, freedom) < limit:
            keep.append(imu)
    rest = [imu for imu in cause.imus if imu not in keep]
    if not keep or len(keep) > len(cause.imus) / 2:
        return
    statistic, freedom = need(search, effect, rest)
    if freedom and log_tail(statistic, freedom) < search.thresholds.limit(effect):
        return
    cause.imus = tuple(keep)
    state = started(search, Candidate(effect, tuple(keep)), None)
    whole = flat_parameters(search.columns, state)
    whole[np.ix_(rest, search.columns.of(effect))] = 0.0
    search.refit(from_flat(search.columns, state, whole))


def heldout_gain(search: Search, effect: str | None) -> tuple[float, float]:
    """Nats gained on held-out blocks of time by an adopted effect, with standard error.

    Both rivals are trained without the block, the effect's parameters shrunk as their evidence
    in the training blocks deserves (positive-part James-Stein).
    """
    given, mask = search.given, search.active
    places = given.places(mask)
    freed = np.isin(places, freed_places(search, effect))
    ridge, values = given.precision[np.ix_(places, places)], given.values[places]
    edges = np.linspace(0, len(search.fit.residual), BLOCKS + 1).astype(int)
    parts = [
        normal(search.fit.residual, search.fit.whitened, search.fit.through, mask, slice(a, b))
        for a, b in zip(edges[:-1], edges[1:], strict=True)
    ]
    information, score = sum(p[0] for p in parts), sum(p[1] for p in parts)
    gains = []
    for block, slope in parts:
        trained = information - block + ridge, score - slope
        without = _solve(*trained, values, freed, 0.0)
        full = _solve(*trained, values, freed, None)
        found = (full + values)[freed]
        effective = _schur(trained[0], freed)
        statistic = found @ effective @ found
        shrink = max(0.0, 1 - freed.sum() / max(statistic, 1e-300))
        kept = _solve(*trained, values, freed, shrink * found)
        gains.append(_predicted(kept, block, slope) - _predicted(without, block, slope))
    return float(np.sum(gains)), float(np.std(gains, ddof=1) * np.sqrt(BLOCKS))


def _schur(information, chosen):
    """Information of the chosen given the rest."""
    rest = ~chosen
    inner = np.linalg.solve(information[np.ix_(rest, rest)], information[np.ix_(rest, chosen)])
    return information[np.ix_(chosen, chosen)] - information[np.ix_(chosen, rest)] @ inner


def _solve(information, score, values, freed, target):
    """Steps of all parameters where the freed ones go to ``target``, or anywhere if None."""
    if target is None:
        return np.linalg.solve(information, score)
    step = np.zeros(len(score))
    step[freed] = target - values[freed]
    rest = ~freed
    right = score[rest] - information[np.ix_(rest, freed)] @ step[freed]
    step[rest] = np.linalg.solve(information[np.ix_(rest, rest)], right)
    return step


def _predicted(step, block, slope) -> float:
    """Log likelihood of a block after a step, against before, quadratic."""
    return float(slope @ step - step @ block @ step / 2)


def clear(search: Search) -> None:
    """Backward: causes that are not needed beside the others go."""
    for cause in list(search.causes):
        statistic, freedom = need(search, cause.effect)
        limit = search.thresholds.limit(cause.effect)
        small = statistic < search.least()
        if not freedom or log_tail(statistic, freedom) > limit or small:
            search.causes.remove(cause)
            search.say(f"dropped {cause.effect}: not needed beside the others")
            search.refit(started(search, Candidate("", ()), None))


__all__ = ["EFFECTS", "Cause", "Search", "adopt", "clear", "heldout_gain", "need"]
