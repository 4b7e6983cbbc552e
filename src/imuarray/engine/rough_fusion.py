"""Each sample's motion under a recording's own estimate, what rough motion adds beside it.

What `analysis.beside` has fitted to samples off the rails (noise and its tails, clocks, the size of
what rough motion adds) holds for those at a rail, too.
"""

from dataclasses import replace
from typing import NamedTuple, Self

import numpy as np
from scipy.special import expit

from imuarray.engine.clocks import CLOCK, clocks_in
from imuarray.engine.derivatives import no_derivatives
from imuarray.engine.estimate import Estimate, Recorded
from imuarray.engine.fusion import covariances, descend, fuse, one_sided
from imuarray.engine.gyroscope_clocks import with_phases
from imuarray.engine.linearise import CHUNK, State, chunk_at, predicted
from imuarray.engine.parameters import Columns
from imuarray.engine.readings import Readings
from imuarray.engine.robust import Linearised
from imuarray.engine.settings import SETTINGS
from imuarray.engine.start import with_derivatives, with_free_gyroscopes, with_rough_prior
from imuarray.model import ArrayModel
from imuarray.model.timing import clock_turns


class Rough(NamedTuple):
    """Samples as an estimate sees them; motion (T, D) as in `State`, ``freedoms`` (2,) of t.

    ``late``: s, of jerk that the gyroscopes' omega_dot has more than the accelerometers'.
    """

    readings: Readings
    columns: Columns
    state: State
    freedoms: np.ndarray
    rails: np.ndarray | None
    late: float
    converged: np.ndarray

    def select(self, index) -> Self:
        """Some of the samples; each of them is by itself."""
        return self._replace(
            readings=self.readings.select(index),
            state=self.state.select(index),
            rails=None if self.rails is None else self.rails[index],
            converged=self.converged[index],
        )

    def fused(self) -> Self:
        """The most likely motion of every sample, readings far out having lost their say.

        Readings near their clock's jump are in the turn that suits them. A shock reaches all
        triads: at last a sample's noise is as large as its residual, where that is more.
        """
        now, every = self, np.arange(len(self.state.motion))
        nothing = np.zeros(self.columns.owner.shape, bool)
        for number in range(SETTINGS.rough_rounds):
            found = descend(
                now.readings, self.columns.model, now.state, every, self.rails, SETTINGS.rough_near
            )
            now = now._replace(state=now._moved(found.motion), converged=found.converged)
            _, seen = Linearised.of(now.readings, self.columns, now.state, nothing)
            last = number == SETTINGS.rough_rounds - 1
            least = SETTINGS.rough_freedom if last else 0.0
            now = now._replace(readings=now._trusted(seen, least))
            if not last and now.readings.clock_deviation is not None:
                other, doubt, _ = now.turns()
                turns = now.readings.clock_deviation
                turns = np.where(doubt > 0.5, other.clock_deviation, turns)
                now = now._replace(readings=replace(now.readings, clock_deviation=turns))
        return now

    def _moved(self, motion) -> State:
        """The state at a motion; what the gyroscopes see more is expected with its jerk."""
        prior = self.state.rough_prior
        if self.late:
            mean = prior.mean.copy()
            mean[:, 6:9] = self.late * motion[:, 9:12]
            prior = prior._replace(mean=mean)
        return self.state._replace(motion=motion, rough_prior=prior)

    def _trusted(self, seen, least: float) -> Readings:
        """With the weights of Student's t, its scale each sample's own where that is larger.

        ``least``: degrees of freedom, if the estimate has fewer.
        """
        trust = np.ones(seen.distance.shape)
        for kind, nu in enumerate(np.maximum(self.freedoms, least)):
            if not np.isfinite(nu):
                continue
            n, d, free = (part[..., kind] for part in (seen.number, seen.distance, seen.freedom))
            squares, whole = np.where(n > 0, d / np.maximum(n, 1), 0.0) * free, free.sum(axis=1)
            scale = np.ones((len(n), 1))
            for _ in range(SETTINGS.rough_rounds):
                sums = np.sum((nu + n) / (nu + d / scale) * squares, axis=1)
                scale = np.maximum(1.0, sums / np.maximum(whole, 1.0))[:, None]
            trust[..., kind] = np.sqrt((nu + n) / (nu + d / scale) / scale)
        return self.readings.with_noise(self.readings.sd, trust)

    def turns(self) -> tuple[Readings, np.ndarray, np.ndarray]:
        """Readings near a jump in the other turn; how likely that is (T, N); what it changes.

        The latter (T, N, 6): predicted. By each IMU's residual in both.
        """
        readings, model = self.readings, self.columns.model
        values = model.split(self.state.parameters)[CLOCK]
        steady = clock_turns(values.T, readings.time[:, None], readings.span)
        place = steady - np.floor(steady) + readings.clock_deviations
        near = (np.abs(place - (place > 0.5)) < SETTINGS.around_jump) & (values[:, 1] != 0)
        step = near * np.where(place > 0.5, -1.0, 1.0)
        other = replace(readings, clock_deviation=readings.clock_deviations + step)
        read = [predicted(one, model, self.state) for one in (readings, other)]
        cost = [np.sum((readings.weights * (readings.values - p)) ** 2, axis=-1) for p in read]
        return other, near * expit((cost[0] - cost[1]) / 2), read[1] - read[0]

    @property
    def lost(self) -> float:
        """Normal noise's information over that of Student's t."""
        return (
            (SETTINGS.rough_freedom + 5) / (SETTINGS.rough_freedom + 3)
            if np.isfinite(self.freedoms).any()
            else 1.0
        )

    def covariance(self) -> np.ndarray:
        """(T, D, D) of the motion: noise as `fused` weighs it, and what the prior leaves."""
        out = []
        for first in range(0, len(self.state.motion), CHUNK):
            made = chunk_at(self.readings, self.columns, self.state, np.arange(0), first)
            out.append(np.swapaxes(made.inverse, 1, 2) @ made.inverse)
        return self.lost * np.concatenate(out)

    def covariances(self, spread) -> tuple[np.ndarray, np.ndarray]:
        """(T, 9, 9) of the motion, and what parameters of a covariance ``spread`` have of it."""
        whole, shared = covariances(self.readings, self.columns.model, self.state, spread)
        return self.lost * (whole - shared) + shared, shared

    def predictions(self) -> tuple[np.ndarray, np.ndarray]:
        """Readings (T, N, 6) at the motion, left out or not, and the sds of their noise and it."""
        values, slopes = predicted(self.readings, self.columns.model, self.state, slopes=True)
        variance = np.einsum("tnri,tij,tnrj->tnr", slopes, self.covariance(), slopes)
        nu = self.freedoms
        wide = np.array([n / (n - 2) if np.isfinite(n) else 1.0 for n in nu])
        variance += np.repeat(wide * self.readings.sd**2, 3, axis=1)
        if self.readings.clock_deviation is not None:
            _, doubt, change = self.turns()
            variance += (doubt * (1 - doubt))[..., None] * change**2
        return values, np.sqrt(variance)


def roughly(readings: Readings, own: Estimate, papers: ArrayModel, saturated) -> Rough:
    """All samples of a recording, the motion as the papers' model has it.

    ``readings``: those at a rail not kept; ``saturated`` (T, G, 3) bool. ``papers``: the model
    without effects. ``own``: of the same recording.
    """
    (one,), columns = own.recorded, own.columns
    readings = replace(readings, sd=one.readings.sd, gapless=True)
    place, gyroscopes = one.state.positions, saturated.shape[1]
    first = fuse(
        papers, readings.values[:, : len(place), :3], readings.values[:, :gyroscopes, 3:],
        (place - place[0])[1:].ravel(), None, saturated,
    ).estimate.motion  # fmt: skip
    motion = np.hstack([np.asarray(field) for field in first[:3]])
    nothing, late = no_derivatives(len(motion), len(place)), 0.0
    state = State(motion, place, one.state.parameters, nothing)
    if one.state.rough_prior is None:
        state = with_derivatives(readings, state, one.smooth)
    else:
        readings, state, late = _of_rough(readings, state, columns, one)
    rails, never = one_sided(readings, saturated), np.zeros(len(motion), bool)
    return Rough(readings, columns, state, own.freedoms, rails, late, never)


def _of_rough(readings: Readings, state: State, columns: Columns, one: Recorded):
    """(readings with clocks' phases, state with the prior of rough motion, `Rough.late`)."""
    state = with_rough_prior(readings, state)
    same = np.searchsorted(readings.time, one.readings.time - 1e-9)
    known, late, left = one.state, 0.0, 1.0
    if known.gyroscopes_free:
        state = with_free_gyroscopes(readings, state)
        clocks = clocks_in(one, columns, range(len(readings.labels)))
        readings = _timed(readings, state, one, same, clocks) if clocks else readings
        jerk, more = (known.motion[:, i : i + 3] / known.rough_prior.sd[:, 6:9] for i in (9, 15))
        late = float(np.sum(jerk * more) / np.sum(jerk**2))
        left = np.sqrt(np.sum((more - late * jerk) ** 2) / np.sum(more**2))
    ratio = known.rough_prior.sd / state.rough_prior.sd[same]
    sizes = np.median(ratio, axis=0).reshape(-1, 3).mean(axis=1)
    sizes[2] *= left
    return readings, state._replace(rough_prior=state.rough_prior.scaled(sizes)), late


def _timed(readings: Readings, state: State, one: Recorded, same, clocks) -> Readings:
    """Clocks' phases as the samples ``same`` of an estimate have them."""
    motion, other = state.motion.copy(), np.ones(readings.keep.shape, bool)
    motion[same, 3:6] = one.state.motion[:, 3:6]
    other[same] = ~one.readings.keep
    other[..., :3] = False
    found = with_phases(readings.without(other), state._replace(motion=motion), clocks)
    return replace(readings, clock_deviation=found.clock_deviation)
