"""The array as one sensor: its motion with covariances, given calibrated positions."""

from __future__ import annotations

from functools import partial
from typing import NamedTuple

import numpy as np

from imuarray.estimation.blocks import motion_equations, pack_motion, problem
from imuarray.estimation.collapsed import Collapsed
from imuarray.estimation.motion_ml import MotionEstimate, motion_from
from imuarray.estimation.samplewise import rows, search, turned
from imuarray.geometry.array import require_planar_extent
from imuarray.model import ArrayModel
from imuarray.model.jax64 import jax, jnp
from imuarray.motion import Motion

COMPONENTS = tuple(f"{name}_{axis}" for name in ("omega", "omega_dot", "s") for axis in "xyz")
CHUNK = 256  # samples at a time: bounds memory
TOLERANCE, LIMIT = 1e-6, 50  # sds, steps


class Fused(NamedTuple):
    """Motion at each sample; the covariance is of (omega, omega_dot, s) in that order."""

    estimate: MotionEstimate
    covariance: np.ndarray  # (T, 9, 9) rad/s, rad/s^2, m/s^2: noise and positions
    from_calibration: np.ndarray  # (T, 9, 9), the positions' part of it


def fuse(
    model: ArrayModel, specific_force, angular_rate, positions=None, position_covariance=None,
    saturated=None,
) -> Fused:  # fmt: skip
    """Each sample's motion by maximum likelihood (2017, eq. 5) and how well it is known.

    Parameters
    ----------
    specific_force : (T, A, 3) m/s^2
    angular_rate : (T, G, 3) rad/s
    positions : (A, 3) m relative to the reference triad, or None for the nominal ones
    position_covariance : (3 (A - 1), 3 (A - 1)) m^2 of r_2 ... r_A, or None: exactly known
        Its errors are the same at all samples, so they do not average out over time.
    saturated : (T, G, 3) bool or None
        Gyroscope axes at the rail. Their readings give the side and the least size of the rate
        (`imuarray.estimation.samplewise`; not where gyroscopes' noise is correlated), and nothing
        to the covariances.

    IdentifiabilityError for fewer than three or collinear triads.
    """
    positions = model.array.relative if positions is None else np.asarray(positions, float)
    require_planar_extent(positions, "positions")
    data = Collapsed.of(model, specific_force, angular_rate, saturated)
    found = _searched(model, data, positions, specific_force, angular_rate, saturated)
    size = 3 * (model.array.accelerometers - 1)
    spread = np.zeros((size, size)) if position_covariance is None else position_covariance
    state = np.hstack([np.asarray(field) for field in found.motion[:3]])
    given = jnp.asarray(positions), jnp.asarray(model.noise.accelerometer_precision)
    noise, shared = np.empty((2, len(state), 9, 9))
    for first in range(0, len(state), CHUNK):
        part = slice(first, first + CHUNK)
        known, cross = map(np.array, _information(model, state[part], *given))
        known[:, :3, :3] += np.moveaxis(data.gyroscope_information[..., part], -1, 0)
        noise[part] = np.linalg.inv(known)
        # the estimate's derivative by the positions, with its sign turned
        moved = noise[part] @ cross
        shared[part] = moved @ spread @ moved.swapaxes(1, 2)
    return Fused(found, noise + shared, shared)


def _searched(
    model: ArrayModel, data: Collapsed, positions, specific_force, angular_rate, saturated
) -> MotionEstimate:
    """Most likely motion; where it falls short of readings at a rail, these are used as well."""
    first = motion_from(data, positions)
    if saturated is None or not np.any(saturated):
        return first
    rate = np.asarray(first.motion.angular_rate)
    index = np.flatnonzero(np.any(turned(rate, angular_rate, saturated) != rate, axis=1))
    if not index.size or not model.noise.uncorrelated_gyroscopes:
        return first
    given = rows(problem(model, specific_force, angular_rate, saturated), index)
    part = Collapsed.of(model, specific_force[index], angular_rate[index], saturated[index])
    parameters, where = positions[1:].ravel() - np.tile(positions[0], len(positions) - 1), index
    x, converged, counts, cost = search(
        given, part, positions - positions[0], first.motion.select(index), saturated[index],
        parameters, TOLERANCE, LIMIT,
    )  # fmt: skip
    start = pack_motion(model, first.motion.select(index))
    before = motion_equations(given, start, parameters)[2]
    fields = [np.array(field) for field in first.motion]
    for field, new in zip(fields[:3], np.split(x, 3, axis=1), strict=True):
        field[where] = new
    costs, steps, flags = (np.array(f) for f in (first.cost, first.iterations, first.converged))
    costs[where] += cost - before  # the collapsed cost leaves out a constant
    steps[where], flags[where] = counts, converged
    return MotionEstimate(Motion(*fields), costs, steps, flags)


@partial(jax.jit, static_argnums=0)
def _information(model, states, positions, precision):
    """What the accelerometers say of the motion (T, 9, 9), and of it and r_2 ... r_A at once."""

    def predicted(state, relative):
        whole = jnp.concatenate([positions[:1], relative.reshape(-1, 3)])
        motion = Motion(*state.reshape(3, 3), jnp.zeros(3), jnp.zeros(3))
        return model.predict(motion, whole).specific_force.ravel()

    def one(state):
        relative = positions[1:].ravel()
        by_motion = jax.jacfwd(predicted)(state, relative)
        by_position = jax.jacfwd(predicted, argnums=1)(state, relative)
        weighted = by_motion.T @ precision
        return weighted @ by_motion, weighted @ by_position

    return jax.vmap(one)(states)
