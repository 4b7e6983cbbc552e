"""Which combinations of positions a recording determines worst, in words."""

import numpy as np
import pytest

from imuarray.engine.directions import patterns, weak_directions
from imuarray.geometry import mimu4444
from imuarray.model import ArrayModel
from imuarray.motion import normal_motion
from imuarray_papers.estimation.information import information_at

ARRAY = mimu4444()


def covariance_with(vector, sd):
    size = 3 * (ARRAY.accelerometers - 1)
    return 1e-12 * np.eye(size) + sd**2 * np.outer(vector, vector)


@pytest.mark.parametrize("name", patterns(ARRAY.relative))
def test_patterns_are_named(name):
    vector = patterns(ARRAY.relative)[name]
    first = weak_directions(ARRAY.relative, covariance_with(vector, 1e-4), ARRAY.labels)[0]
    assert first.words == name
    assert first.sd == pytest.approx(1e-4, rel=1e-3)


def test_a_single_triad_is_named():
    vector = np.zeros((ARRAY.accelerometers - 1, 3))
    vector[6, 2] = 1.0
    first = weak_directions(ARRAY.relative, covariance_with(vector.ravel(), 1e-4), ARRAY.labels)[0]
    assert first.words == "IMU 8 along z, mostly"


def test_a_motion_about_one_axis_hardly_tells_the_arms_along_it():
    """The lever arms along the axis of rotation are what it determines worst."""
    model = ArrayModel.isotropic(ARRAY, 0.04, 1e-3)
    motion = normal_motion(np.random.default_rng(1), (50,), 10.0, 200.0, 20.0)
    slow = np.array([1.0, 0.01, 0.01])
    motion = motion._replace(
        angular_rate=motion.angular_rate * slow,
        angular_acceleration=motion.angular_acceleration * slow,
    )
    covariance = np.linalg.inv(information_at(model, motion, ARRAY.relative))
    worst = weak_directions(ARRAY.relative, covariance, ARRAY.labels, 3)
    assert all(np.linalg.norm(item.vector[:, 0]) > 0.95 for item in worst)
    assert worst[0].sd >= worst[1].sd >= worst[2].sd
