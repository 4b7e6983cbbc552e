"""Effects in time against the exact motion at each sensor's own instant."""

import numpy as np
import pytest

from imuarray.geometry import mimu4444_corners
from imuarray.model import ArrayModel
from imuarray.motion import hand_twisting

TIMES = 0.4 + 0.013 * np.arange(40)


def scene(name, seed=3):
    """Model with one effect, its positions, and the motion as a function of time."""
    model = ArrayModel.isotropic(mimu4444_corners(), 0.04, 1e-3, (name,))
    motion = hand_twisting(np.random.default_rng(seed), np.radians(800), 10.0)
    return model, model.array.relative, motion


def exact(motion, times, positions):
    """(T, A, 3), (T, A, 3): readings of IMU k at its own instants, times (T, A)."""
    force, rate = np.empty((*times.shape, 3)), np.empty((*times.shape, 3))
    for k, place in enumerate(positions):
        there = motion.at(times[:, k])
        w, a, s = there[:3]
        force[:, k] = np.cross(w, np.cross(w, place)) + np.cross(a, place) + s
        rate[:, k] = w
    return force, rate


def departures(name, values, times):
    """Largest errors of the model's first order against the exact readings at ``times`` (T, 8)."""
    model, positions, motion = scene(name)
    found = model.predict_many(motion.at(TIMES), positions, model.join({name: values}), TIMES)
    force, rate = exact(motion, times, positions)
    return np.abs(found.specific_force - force).max(), np.abs(found.angular_rate - rate).max()


def sawtooth(clock, times):
    """Ages (T, 8) of the readings, since the first sample."""
    since = times[:, None] - times[0]
    turns = clock[:, 1] * since + clock[:, 2] + clock[:, 4] / 2 * (since - since[-1] / 2) ** 2
    return clock[:, 3] + clock[:, 0] * (turns % 1.0 - 0.5)


@pytest.mark.parametrize("name", ["sensor_delay", "sensor_clock"])
def test_half_the_age_leaves_a_quarter_of_the_error(name):
    rng, errors = np.random.default_rng(1), []
    clock = np.column_stack([
        rng.uniform(1e-3, 2e-3, 8), rng.uniform(0.3, 9, 8), rng.uniform(0, 1, 8),
        rng.uniform(0, 1e-3, 8), rng.uniform(-8, 8, 8),
    ])  # fmt: skip
    for size in (1.0, 0.5):
        scaled = clock * np.array([size, 1, 1, size, 1])
        if name == "sensor_clock":
            values, times = scaled, TIMES[:, None] - sawtooth(scaled, TIMES)
        else:
            values, times = scaled[:, 3], TIMES[:, None] + scaled[:, 3]
        errors.append(departures(name, values, times))
    ratio = np.array(errors[0]) / np.array(errors[1])
    assert np.all((ratio > 3.4) & (ratio < 4.6)), ratio


def test_a_gyroscope_delay_leaves_accelerometers_in_time():
    model, positions, motion = scene("gyroscope_delay")
    values = np.linspace(-1e-4, 1e-4, 8)
    found = model.predict_many(
        motion.at(TIMES), positions, model.join({"gyroscope_delay": values}), TIMES
    )
    force, _ = exact(motion, np.tile(TIMES[:, None], 8), positions)
    _, rate = exact(motion, TIMES[:, None] + values, positions)
    np.testing.assert_allclose(found.specific_force, force, atol=1e-10)
    np.testing.assert_allclose(found.angular_rate, rate, atol=2e-4)


def test_a_drift_is_a_cubic_of_time():
    model, positions, motion = scene("bias_drift")
    drift = np.random.default_rng(4).standard_normal((8, 2, 3, 4))
    state = motion.at(TIMES)
    found = model.predict_many(state, positions, model.join({"bias_drift": drift}), TIMES)
    plain = ArrayModel(model.array, model.noise).predict_many(state, positions)
    x = 2 * (TIMES - TIMES[0]) / (TIMES[-1] - TIMES[0]) - 1
    for k in range(8):
        for axis in range(3):
            for part, kind in ((0, "specific_force"), (1, "angular_rate")):
                bias = np.polynomial.legendre.legval(x, drift[k, part, axis])
                own = getattr(found, kind)[:, k, axis] - getattr(plain, kind)[:, k, axis]
                np.testing.assert_allclose(own, bias, atol=1e-10)


@pytest.mark.parametrize("pace", [0.0, 3.0, -2.0])
def test_a_warm_up_is_one_course_in_all_biases(pace):
    model, positions, motion = scene("warm_up")
    values = np.random.default_rng(4).standard_normal((8, 8))
    values[:, 6:] = pace, 0.3
    state = motion.at(TIMES)
    found = model.predict_many(state, positions, model.join({"warm_up": values}), TIMES)
    plain = ArrayModel(model.array, model.noise).predict_many(state, positions)
    past, span = TIMES - TIMES[0], TIMES[-1] - TIMES[0]
    warmth = past / span
    if pace:
        warmth = (1 - np.exp(-pace * past)) / (1 - np.exp(-pace * span))
    for part, kind in ((slice(3), "specific_force"), (slice(3, 6), "angular_rate")):
        bias = (warmth[:, None, None] - 0.3) * values[:, part]
        np.testing.assert_allclose(getattr(found, kind) - getattr(plain, kind), bias, atol=1e-10)


def test_a_shift_moves_a_triad_from_its_instant_on():
    model, positions, motion = scene("position_shift")
    shift = np.zeros((8, 4))
    shift[5] = [1e-3, -2e-3, 5e-4, TIMES[17] - TIMES[0]]
    state = motion.at(TIMES)
    found = model.predict_many(state, positions, model.join({"position_shift": shift}), TIMES)
    moved = positions.copy()
    moved[5] += shift[5, :3]
    before, _ = exact(motion, np.tile(TIMES[:, None], 8), positions)
    after, _ = exact(motion, np.tile(TIMES[:, None], 8), moved)
    np.testing.assert_allclose(found.specific_force[:17], before[:17], atol=1e-10)
    np.testing.assert_allclose(found.specific_force[17:], after[17:], atol=1e-10)
