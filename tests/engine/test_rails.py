"""Gyroscopes at their rail: their readings count from one side."""

from dataclasses import replace

import numpy as np

from imuarray.engine.derivatives import no_derivatives
from imuarray.engine.fusion import better, equations, fuse, one_sided, turned
from imuarray.engine.linearise import State
from imuarray.engine.readings import measured
from imuarray.model import Noise
from imuarray.motion import Motion, normal_motion
from imuarray.simulation.recordings import measure
from imuarray_papers.estimation.collapsed import Collapsed, motion_from
from tests.cases import model

RAIL = 5.0


def lost_rates():
    """(model, force, rate, saturated, truth): most axes are lost, badly determined by forces."""
    rng, own = np.random.default_rng(8), model()
    own = replace(own, noise=Noise.of(5, 5, 2.0, 0.02))
    motion = normal_motion(rng, (400,), 20.0, 300.0, 10.0)
    force, rate, saturated = measure(own, motion, own.array.relative, rng, gyroscope_range=RAIL)
    return own, force, rate, saturated, np.asarray(motion.angular_rate)


def test_a_lost_reading_counts_below_it_and_on_the_other_side():
    own = model()
    rate, saturated = np.zeros((1, 5, 3)), np.zeros((1, 5, 3), bool)
    rate[0, 0], saturated[0, 0] = [5.0, -5.0, 1.0], [True, True, False]
    for omega, short in (
        ([7.0, -6.0, 0.0], 0.0), ([4.0, -5.0, 0.0], 1.0), ([-5.0, -5.0, 0.0], 100.0),
        ([5.0, -4.0, 0.0], 1.0),
    ):  # fmt: skip
        motion = Motion.of(np.array([omega]), np.zeros((1, 3)), np.zeros((1, 3)))
        force, _ = own.predict_many(motion, own.array.relative)
        given, x = measured(own, force, rate, saturated), np.hstack(motion[:3])
        state = State(x, own.array.relative, np.empty(0), no_derivatives(1, 5))
        plain, found = (
            equations(given, own, state, np.array([0]), rails)[2]
            for rails in (None, one_sided(given, saturated))
        )
        assert np.allclose(found - plain, short / 0.02**2)
    readings, lost = rate[:, :1], saturated[:, :1]
    assert np.array_equal(turned(np.array([[-7.0, -3.0, 2.0]]), readings, lost), [[7, -5, 2]])
    assert np.array_equal(turned(np.array([[6.0, -9.0, 2.0]]), readings, lost), [[6, -9, 2]])


def test_the_lower_cost_wins_among_those_that_were_found():
    one = np.array([1.0, 1.0, 1.0, 1.0]), np.array([True, True, False, True])
    other = np.array([0.5, 2.0, 9.0, 0.1]), np.array([True, True, True, False])
    assert np.array_equal(better(one, other), [True, False, True, False])


def test_no_estimate_contradicts_a_reading_at_its_rail():
    own, force, rate, saturated, truth = lost_rates()
    data = Collapsed.of(own, force, rate, saturated)
    plain = motion_from(data, own.array.relative)
    one = fuse(own, force, rate, None, None, saturated).estimate
    biased, p = replace(own, effects=("gyroscope_bias",)), own.array.parameters
    other = fuse(biased, force, rate, np.append(p, np.zeros(15)), None, saturated).estimate
    lost = saturated.any(axis=1)
    side = np.sign(rate.mean(axis=1))
    before = np.asarray(plain.motion.angular_rate)
    assert np.mean((side * before < RAIL)[lost]) > 0.05
    for found in (one, other):
        omega = np.asarray(found.motion.angular_rate)
        assert np.all((side * omega > RAIL - 0.2)[lost & found.converged[:, None]])
        error, former = (np.sqrt(np.mean((r - truth)[lost] ** 2)) for r in (omega, before))
        assert error < 0.8 * former and found.converged.mean() > 0.95
    # samples that agree with their readings are as they were
    agree = plain.converged & np.all((side * before >= RAIL) | ~lost, axis=1)
    np.testing.assert_allclose(one.motion[0][agree], before[agree], atol=1e-4)
