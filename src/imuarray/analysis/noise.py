"""The noise and the motion's size that a recording itself shows, by restricted likelihood."""

from contextlib import suppress
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from imuarray.analysis.model import Notify, require_motion, require_seen, silent
from imuarray.analysis.sensors import near_the_model
from imuarray.analysis.settings import SETTINGS
from imuarray.engine.estimate import Recorded, estimate
from imuarray.engine.linearise import CHUNK, State, chunk_at
from imuarray.engine.normal import pick
from imuarray.engine.parameters import POSITION, Columns, columns_of, model_of
from imuarray.engine.readings import Readings, measured
from imuarray.engine.start import linear_motion, start
from imuarray.linear import scaled_inverse
from imuarray.model import Noise
from imuarray.recording import Recording
from imuarray.streams import stream


class NoiseEstimate(NamedTuple):
    """Noise and motion's size by residuals and motion of a fit."""

    squares: np.ndarray  # (N, 2) of each triad's residuals, in their sds
    freedom: np.ndarray  # (N, 2) degrees that motion and shared parameters leave them
    motion_sd: np.ndarray  # (3,) sizes of omega, omega_dot, s: what is not noise of their estimates


def noise_estimate(
    readings: Readings, columns: Columns, state: State, active, covariance
) -> NoiseEstimate:
    """Noise and motion's size of a fit, for the ``active`` (N, m) parameters' covariance."""
    wanted = np.flatnonzero(active.any(axis=0))
    few = active[:, wanted]
    samples, count = readings.values.shape[:2]
    squares, freedom, spread = np.zeros((count, 2)), np.zeros((count, 2)), []
    for first in range(0, samples, CHUNK):
        linearised = chunk_at(readings, columns, state, wanted, first)
        keep = readings.keep[first : first + CHUNK]
        pairs, projected = pick(linearised.projected, few)
        for k in range(count):
            basis, own = linearised.basis[:, 6 * k : 6 * k + 6], np.flatnonzero(pairs[:, 0] == k)
            left = -basis @ projected
            left[..., own] += linearised.whitened[:, k][..., pairs[own, 1]]
            absorbed = np.sum(basis**2, axis=2) + np.sum((left @ covariance) * left, axis=2)
            squares[k] += np.sum(linearised.residual[:, k].reshape(-1, 2, 3) ** 2, axis=(0, 2))
            freedom[k] += np.sum((keep[:, k] * (1 - absorbed)).reshape(-1, 2, 3), axis=(0, 2))
        roots = linearised.inverse[..., :9].reshape(len(keep), -1, 3, 3)
        spread.append(np.einsum("trki,trkj->tkij", roots, roots))
    every = np.concatenate(spread)
    sizes = [_size(state.motion[:, 3 * k : 3 * k + 3], every[:, k]) for k in range(3)]
    return NoiseEstimate(squares, freedom, np.array(sizes))


def _size(estimates, covariances) -> float:
    """The sd whose normal values have estimates (T, 3) with errors of covariances (T, 3, 3)."""
    values, vectors = np.linalg.eigh(covariances)
    squares = np.einsum("tik,ti->tk", vectors, estimates) ** 2
    least, found = np.mean(squares) / 100, np.mean(squares)
    for _ in range(50):
        weights = (found + values) ** -2.0
        found = max(np.sum(weights * (squares - values)) / np.sum(weights), least)
    return float(np.sqrt(found))


def factors(estimated: NoiseEstimate, exists, known: bool = False) -> np.ndarray:
    """By what the triads' sds are wrong (N, 2); 1 where they do not exist.

    And of accelerometers where theirs are ``known``. Of few triads, or with few degrees of freedom,
    all of a kind share one.
    """
    out = np.ones(exists.shape)
    for kind in (1,) if known else (0, 1):
        own = exists[:, kind]
        squares, freedom = estimated.squares[own, kind], estimated.freedom[own, kind]
        if len(squares) < SETTINGS.apart[kind] or freedom.min() < SETTINGS.freedom:
            squares, freedom = squares.sum(), freedom.sum()
        if np.all(freedom >= 1):
            out[own, kind] = np.sqrt(np.maximum(squares / freedom, 1e-12))
    return out


def noise_of(readings: Readings) -> Noise:
    """The readings' sds (N, 2), as a model has them."""
    counts = readings.exists.sum(axis=0)
    return Noise.of(*counts, *(readings.sd[:n, kind] for kind, n in enumerate(counts)))


class Mode(NamedTuple):
    """The most likely positions of a recording under the papers' model, and its motion there."""

    positions: np.ndarray  # (A, 3) m
    covariance: np.ndarray  # (P, P) m^2 of r_2 ... r_A
    state: State
    cost: float  # twice the negative log posterior, up to a constant
    converged: bool


def as_declared(recording: Recording) -> tuple[Readings, Columns]:
    """All samples with the noise that the recording declares, and the positions as parameters.

    IdentifiabilityError where the gyroscopes do not see each sample's rate, or turns have one axis.
    """
    model, prior_sd = model_of(recording), recording.position_prior_sd
    data = recording.specific_force, recording.angular_rate, recording.saturated_gyroscopes()
    readings = replace(measured(model, *data), position_prior_sd=prior_sd)
    columns = columns_of(model.array, (), prior_sd)
    require_seen(readings)
    require_motion(readings, start(readings, columns))
    return readings, columns


def mode_of(readings: Readings, columns: Columns, begin=None) -> Mode:
    """The mode of the positions' posterior with the readings' noise, searched from ``begin``.

    Without one from the nominal positions, and from others where few samples leave local optima.
    """
    found = _mode_from(readings, columns, begin)
    if begin is not None or len(readings.time) > SETTINGS.few:
        return found
    rng, nominal = stream(0, "sample", "mode"), readings.array.relative
    for _ in range(SETTINGS.starts):
        off = readings.position_prior_sd * rng.standard_normal(nominal.shape)
        with suppress(np.linalg.LinAlgError):  # it ran to triads on one line
            other = _mode_from(readings, columns, nominal + off - off[0])
            found = min(found, other, key=lambda one: one.cost)
    return found


def _mode_from(readings: Readings, columns: Columns, begin) -> Mode:
    state = start(readings, columns)
    if begin is not None:
        motion = np.hstack([
            state.motion[:, :3], linear_motion(readings, begin, state.motion[:, :3])
        ])  # fmt: skip
        state = state._replace(positions=begin, motion=motion)
    begun = [Recorded(readings, state, smooth=False)]
    found = estimate(begun, columns, columns.mask([POSITION]), noise="fixed")
    off = found.values - columns.prior_means()[found.active]
    cost = np.sum(found.residuals[0].squares) + off @ found.precision @ off
    covariance = scaled_inverse(found.information + found.precision)
    return Mode(found.positions, covariance, found.recorded[0].state, float(cost), found.converged)


@near_the_model()
def estimated_noise(
    recording: Recording, known: bool = False, notify: Notify = silent
) -> tuple[Readings, Mode, NoiseEstimate]:
    """All readings with the noise of each triad, the mode with that, and what it shows.

    Restricted maximum likelihood: each triad's squared residuals against the degrees of freedom
    that motion and positions leave it, fit and noise by turns. Where those are few, or triads too
    few to be told apart, all triads of a kind share one factor.

    ``known``: whether the accelerometers' noise is the declared one.
    """
    (readings, columns), begin = as_declared(recording), None
    for number in range(SETTINGS.rounds + 1):
        found = mode_of(readings, columns, begin)
        begin = found.positions
        estimated = noise_estimate(readings, columns, found.state, columns.owner, found.covariance)
        wrong = factors(estimated, readings.exists, known)
        if np.abs(np.log(wrong)).max() < SETTINGS.enough:
            break
        if number == SETTINGS.rounds:
            notify("the estimates of noise and positions did not settle; the last ones are taken")
            break
        readings = readings.with_sd(readings.sd * wrong)
    return readings, found, estimated
