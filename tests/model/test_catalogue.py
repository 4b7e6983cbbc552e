"""The catalogue's equations against plain ones, and their recovery by maximum likelihood."""

import numpy as np
import pytest

from imuarray.geometry import mimu4444_corners
from imuarray.model import ArrayModel
from imuarray.motion import hand_twisting
from imuarray.simulation.recordings import measure
from tests import oracles

RATE = np.radians(0.06)
OFF = [(0, 1), (0, 2), (1, 0), (1, 2), (2, 0), (2, 1)]


def force_at(motion, t, place):
    w, a, s = (field[t] for field in motion[:3])
    return np.cross(w, np.cross(w, place)) + np.cross(a, place) + s


def mixed(entries, vector):
    """Off-diagonal matrix times vector."""
    out = np.zeros(3)
    for (row, column), entry in zip(OFF, entries, strict=True):
        out[row] += entry * vector[column]
    return out


def plain(name, p, motion, t, k, positions):
    """(specific force, angular rate) of IMU k at sample t, written out one by one."""
    u, w = force_at(motion, t, positions[k]), motion.angular_rate[t].copy()
    if name == "accelerometer_bias":
        u = u + p[k]
    elif name == "accelerometer_scale":
        u = u * (1 + p[k])
    elif name == "accelerometer_misalignment":
        u = u + mixed(p[k], u)
    elif name == "accelerometer_nonlinearity":
        u = u + p[k] * u * u
    elif name == "size_effect":
        u = np.array([force_at(motion, t, positions[k] + p[k][axis])[axis] for axis in range(3)])
    elif name == "gyroscope_bias":
        w = w + p[k]
    elif name == "gyroscope_scale":
        w = w * (1 + p[k])
    elif name == "gyroscope_misalignment":
        w = w + mixed(p[k], w)
    elif name == "gyroscope_g_sensitivity":
        w = w + p[k] @ u
    elif name == "gyroscope_nonlinearity":
        w = w + p[k] * w * w
    elif name == "gyroscope_delay":
        w = w + p[k] * motion.angular_acceleration[t]
    return u, w


NAMES = [
    "accelerometer_bias", "accelerometer_scale", "accelerometer_misalignment",
    "accelerometer_nonlinearity", "size_effect", "gyroscope_bias", "gyroscope_scale",
    "gyroscope_misalignment", "gyroscope_g_sensitivity", "gyroscope_nonlinearity",
    "gyroscope_delay",
]  # fmt: skip


def setting(name, seed, samples=150):
    """Model, motion, positions and parameters at the effect's own scale."""
    rng = np.random.default_rng(seed)
    model = ArrayModel.isotropic(mimu4444_corners(), 0.04, RATE, (name,))
    positions = model.array.relative + 2e-4 * rng.standard_normal((8, 3))
    positions -= positions[0]
    motion = hand_twisting(rng, np.radians(1000), 10.0).at(0.02 * np.arange(samples))
    parameters = model.effect_prior_sd * rng.standard_normal(model.effect_size)
    return model, motion, positions, parameters, rng


@pytest.mark.parametrize("name", NAMES)
def test_the_equation(name):
    model, motion, positions, parameters, _ = setting(name, 1, samples=4)
    found = model.predict_many(motion, positions, parameters)
    values = parameters.reshape(model.shapes[0])
    for t in range(4):
        for k in range(8):
            force, rate = plain(name, values, motion, t, k, positions)
            np.testing.assert_allclose(found.specific_force[t, k], force, rtol=1e-10, atol=1e-10)
            np.testing.assert_allclose(found.angular_rate[t, k], rate, rtol=1e-10, atol=1e-12)


@pytest.mark.parametrize("name", [*NAMES, "sensor_delay"])
def test_recovery_within_the_claimed_widths(name):
    """Seed 2; gauges rest on the prior, from which the truth is drawn: all |z| below 5 (1e-4)."""
    model, motion, positions, parameters, rng = setting(name, 2)
    force, rate, _ = measure(model, motion, positions, rng, parameters)
    found = oracles.joint_map(model, force, rate, prior=(model.array.parameters, 3e-3))
    assert found.converged
    errors = np.concatenate([found.positions[1:].ravel(), found.effects])
    errors -= np.concatenate([positions[1:].ravel(), parameters])
    z = errors / np.sqrt(np.diag(found.covariance))
    assert np.abs(z).max() < 5
    # something was learned: the data narrow some direction of the effect well below its prior
    block = found.covariance[21:, 21:] / np.outer(model.effect_prior_sd, model.effect_prior_sd)
    assert np.sqrt(np.linalg.eigvalsh(block)[0]) < 0.2
