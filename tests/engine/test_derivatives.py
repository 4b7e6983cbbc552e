"""Derivatives by local polynomials, against polynomials fitted one sample at a time."""

from math import factorial

import numpy as np
import pytest

from imuarray.engine.derivatives import derivatives, polynomial_derivative
from imuarray.engine.readings import arrange
from imuarray.motion.state import lever
from tests.recording.cases import make

RUNS, STEP = (30, 4, 9, 12), 0.01


def fitted(values, place, order, degree):
    """The derivative at a place of the polynomial through values, STEP apart."""
    found = np.polynomial.Polynomial.fit((np.arange(len(values)) - place) * STEP, values, degree)
    return factorial(order) * found.convert().coef[order]


@pytest.mark.parametrize(("window", "order", "ends"), [(5, 1, None), (9, 2, 3), (9, 3, None)])
def test_each_is_of_the_polynomial_about_it(window, order, ends):
    rng, run = np.random.default_rng(1), np.repeat(np.arange(len(RUNS)), RUNS)
    values, time = rng.standard_normal((sum(RUNS), 2)), STEP * np.arange(sum(RUNS))
    found = polynomial_derivative(time, run, values, window, order, ends=ends)
    first = np.cumsum([0, *RUNS[:-1]])
    for start, length in zip(first, RUNS, strict=True):
        for t in range(length):
            begin = min(max(t - window // 2, 0), length - window)
            place = t - begin
            degree = 4 if ends is None or place == window // 2 else ends
            part = slice(start + begin, start + begin + window)
            right = 0.0 if length < window else fitted(values[part, 1], place, order, degree)
            assert found[start + t, 1] == pytest.approx(right, rel=1e-6, abs=1e-6)


def test_a_readings_derivatives_are_those_of_the_reading():
    rng, count = np.random.default_rng(2), 40
    readings = arrange(make(time=STEP * np.arange(count), samples=count), sparse=True)
    motion, places = rng.standard_normal((count, 9)), rng.standard_normal((3, 3))
    motion, places = motion[: len(readings.time)], places - places[0]
    ideal = lever(motion[:, None, :3], motion[:, None, 3:6], places) + motion[:, None, 6:9]
    second = derivatives(readings, motion, places)[2]
    right = polynomial_derivative(readings.time, readings.run, ideal, readings.window, 2)
    np.testing.assert_allclose(second.specific_force, right, rtol=1e-9, atol=1e-6)
