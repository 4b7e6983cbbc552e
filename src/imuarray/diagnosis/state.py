"""The state of a search for causes: what is adopted, and the fit that it leads to."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import NamedTuple

import numpy as np

from imuarray.diagnosis import noise as noises
from imuarray.diagnosis.clock_from_gyros import wind, windable
from imuarray.diagnosis.fit import (
    Fit,
    at,
    flat_parameters,
    from_flat,
    loosened,
    search_optimum,
)
from imuarray.diagnosis.linearise import linearise
from imuarray.diagnosis.parameters import POSITION, SCANNED, Columns
from imuarray.diagnosis.readings import Readings
from imuarray.diagnosis.scans import delay_parts, refine_clock
from imuarray.diagnosis.scores import Candidate, Evidence, evidence, mask_of
from imuarray.diagnosis.start import is_smooth, start
from imuarray.diagnosis.thresholds import Thresholds
from imuarray.model.timing import clock_turns

TRACE = 2e-5  # of the excess there was at first
EDGE = 0.03  # of a turn: how near to a clock's jump a reading is left out
JITTER = 0.04  # the same where clocks were wound by the gyroscopes
ROUGH_SHARE = 5.0  # by which the least share of what is left is larger where motion is rough
STEADY = 0.02  # relative change of a noise sd below which a fit is not repeated


@dataclass
class Cause:
    """An adopted effect: its IMUs, form and evidence."""

    effect: str
    imus: tuple[int, ...]
    variants: set[str]
    log_p: float


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
            self.edges(state, JITTER if own_turning(state) else EDGE / (1 + turn))
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
        if not self.clocks or own_turning(state):
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
        near = np.zeros((*self.readings.keep.shape[:2], 2), bool)
        values = self.columns.model.split(np.asarray(state.parameters))
        for imu in self.clocks:
            turns = clock_turns(values["sensor_clock"][imu], self.readings.time, self.readings.span)
            near[:, imu] = (np.abs(turns - np.round(turns)) < width)[:, None]
        # what is left must tell the motion
        near = np.repeat(noises.few_at_once(near), 3, axis=2)
        keep = self.readings.keep | self.jumps
        self.readings = replace(self.readings, keep=keep & ~near)
        self.jumps = near & keep

    def weigh(self) -> None:
        """The evidence at the present fit."""
        flat = flat_parameters(self.columns, self.fit.state)
        plain = evidence(self.fit, flat)
        meat = noises.coloured_meat(self.fit, plain.information, self.noise.correlation)
        self.given = plain if meat is None else replace(plain, meat=meat)

    def least(self) -> float:
        """The least chi-square of a cause: a share of what is left, and a trace of what there was.

        The second order of a huge effect leaves something that smaller ones would take up, and
        rough motion leaves more.
        """
        left = max(self.fit.misfit - self.fit.free, 0.0)
        share = self.thresholds.share * (1.0 if self.smooth else ROUGH_SHARE)
        return max(share * left, TRACE * self.excess)

    def polish(self) -> None:
        """The same fit to the end."""
        self.refit(turns=2, rough=False)

    def begin(self, parameters=None, positions=None, wound=False) -> None:
        """The papers' model, or what another search came to, its clocks ``wound`` or not."""
        first = start(self.readings, self.columns)
        if parameters is not None:
            first = first._replace(positions=positions, parameters=parameters)
        self.allowed = self.readings.keep
        self.smooth = is_smooth(self.readings, first.motion)
        if not self.smooth:
            first = loosened(self.readings, first)
            if wound:
                first = first._replace(loose=first.loose.freed())
        self.refit(first)
        self.excess = max(self.fit.misfit - self.fit.free, 0.0)


def started(search: Search, candidate: Candidate, values):
    """The present state, dropped effects at zero, scanned ones where the scan found them."""
    columns = search.columns
    whole = flat_parameters(columns, search.fit.state)
    held = np.zeros_like(whole, bool)
    for name in SCANNED:
        own = columns.of(name)
        held[:, own] = search.active[:, own].any(axis=1, keepdims=True)
    whole[~search.active & ~held] = 0.0
    whole[: len(search.fit.state.positions), columns.of(POSITION)] = search.fit.state.positions
    state = search.fit.state
    if state.loose is not None and candidate.effect == "sensor_clock" and values is not None:
        # clocks that are there already are wound again, all as one
        place = columns.of("sensor_clock")
        values = {imu: whole[imu, place] for imu in search.clocks} | values
    if own_clocks(search, candidate, values, state):
        values = wind(search.readings, state.motion[:, 3:6], values)
        state = state._replace(loose=state.loose.freed())
    if values is not None:
        for imu, value in values.items():
            whole[imu, columns.of(candidate.effect)] = value
    return from_flat(columns, state, whole)


def own_clocks(search: Search, candidate: Candidate, values, state) -> bool:
    """Whether a candidate's clocks are to be wound by the gyroscopes alone."""
    if state.loose is None or candidate.effect != "sensor_clock" or values is None:
        return False
    return windable(search.readings, values)


def own_turning(state) -> bool:
    """Whether the gyroscopes' omega dot is free."""
    return state.loose is not None and state.loose.free
