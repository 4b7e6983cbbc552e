"""Clocks estimated from the gyroscopes alone, where the motion is too rough for its samples."""

from types import SimpleNamespace

import numpy as np
import pytest

from imuarray.engine import clocks
from imuarray.engine.derivatives import no_derivatives
from imuarray.engine.gyroscope_clocks import (
    Gyroscopes,
    ages_of,
    clocks_from_gyroscopes,
    moved,
    with_phases,
)
from imuarray.engine.linearise import RoughPrior, State
from imuarray.engine.readings import Readings
from imuarray.model.timing import clock_turns

PERIOD, SPAN, NOISE = 1e-3, 90.0, 0.004


class Rough:
    """Eight gyroscopes at 62.5 Hz whose motion is white from sample to sample."""

    def __init__(self, seed, samples=3000, wrong=0.02):
        rng = np.random.default_rng(seed)
        self.time = np.sort(rng.choice(int(62.5 * SPAN), samples, replace=False)) / 62.5
        self.span, self.keep, self.period = SPAN, np.ones((samples, 8, 6), bool), np.nan
        self.clocks = np.column_stack([
            np.full(8, PERIOD), rng.uniform(-3, 3, 8), rng.uniform(0, 1, 8), np.zeros(8),
            rng.normal(0, 1e-4, 8) + 2e-4,
        ])  # fmt: skip
        rate, self.turn = rng.normal(0, 15, (samples, 3)), rng.normal(0, 400, (samples, 3))
        # half of what the accelerometers see turning is what the gyroscopes see, as strong
        self.acceleration = (self.turn + rng.normal(0, 400, (samples, 3))) / np.sqrt(2)
        ages = PERIOD * (np.mod(clock_turns(self.clocks.T, self.time[:, None], SPAN), 1) - 0.5)
        ages += PERIOD * rng.choice([-1, 0, 1], ages.shape, p=[wrong / 2, 1 - wrong, wrong / 2])
        maps = np.eye(3) + rng.normal(0, 0.01, (8, 3, 3))
        seen = rate[:, None] - ages[..., None] * self.turn[:, None]
        readings = np.einsum("kij,tkj->tki", maps, seen) + rng.normal(0, 0.01, (8, 3))
        self.values = np.zeros((samples, 8, 6))
        self.values[..., 3:] = readings + rng.normal(0, NOISE, readings.shape)

    def guesses(self, rng):
        """First guesses a little off, without drift."""
        off = self.clocks.copy()
        # the tangent of a drift in the middle is its rate there: none
        off[:, 4] = 0.0
        off[:, 2] += clock_turns(self.clocks.T, SPAN / 2, SPAN) - clock_turns(off.T, SPAN / 2, SPAN)
        off[:, 2] += rng.uniform(-0.06, 0.06, 8)
        off[:, 0] *= rng.uniform(0.6, 1.2, 8)
        return dict(enumerate(off))


@pytest.mark.slow
@pytest.mark.parametrize("seed", [1, 2])
def test_phases_rates_drifts_and_the_period_are_found(seed):
    there = Rough(seed)
    guesses = there.guesses(np.random.default_rng(seed))
    found = clocks_from_gyroscopes(there, there.acceleration, guesses)
    clocks = np.array([found[imu] for imu in range(8)])
    exact = clock_turns(there.clocks.T, there.time[:, None], SPAN)
    off = clock_turns(clocks.T, there.time[:, None], SPAN) - exact
    off -= np.round(off)
    assert np.abs(off).max() < 0.03
    # strengths as equal as the draw makes them
    assert clocks[:, 0] == pytest.approx(PERIOD, rel=0.03)


def test_with_true_ages_only_noise_is_left():
    there = Rough(3, wrong=0.0)
    maps = np.tile(np.eye(4)[:3], (8, 1, 1))
    seen = Gyroscopes(there.time, SPAN, there.values[..., 3:], there.acceleration)
    ages = ages_of(there.clocks, seen)
    bare = there.values[..., 3:]
    motion, left = moved(seen, maps, ages, np.ones(ages.shape))
    # the oracle: ordinary least squares of each axis over the ages, sample by sample
    design = np.stack([np.ones(8), -ages[100]], axis=1)
    expected = np.linalg.lstsq(design, bare[100], rcond=None)[0]
    np.testing.assert_allclose(motion[100].reshape(2, 3), expected, rtol=0.02, atol=0.02)
    # two of eight readings are used up; the maps' own percent of the rate is left in this test
    assert np.sqrt(np.mean(left**2)) < 0.01 * 15 * np.sqrt(3)


def test_phases_that_wander_and_jumps_that_jitter_are_found_reading_by_reading():
    there, rng = Rough(4, samples=1500, wrong=0.0), np.random.default_rng(4)
    steady = clock_turns(there.clocks.T, there.time[:, None], SPAN)
    turns = steady + 0.1 * np.sin(2 * np.pi * there.time[:, None] / 40 + np.arange(8))
    jumps = np.floor(turns - 0.08 + rng.normal(0, 0.05, turns.shape))
    ages = PERIOD * (turns - jumps - 0.5)
    rate = rng.normal(0, 15, (len(ages), 3))
    there.values[..., 3:] = rate[:, None] - ages[..., None] * there.turn[:, None]
    there.values[..., 3:] += rng.normal(0, NOISE, there.values[..., 3:].shape)
    every = np.ones((8, 2))
    readings = Readings(
        None, there.time, SPAN, there.values, there.keep, every > 0, NOISE * every, NOISE * every,
        np.zeros(len(ages), int), tuple("12345678"), 1e-3,
    )  # fmt: skip
    motion = np.hstack([rate, there.acceleration, 0 * rate])
    nothing = np.zeros((len(ages), 15))
    prior = RoughPrior(nothing, nothing + 1e3, nothing)
    state = State(motion, np.zeros((8, 3)), np.empty(0), no_derivatives(len(ages), 8), prior)
    found = with_phases(readings, state, dict(enumerate(there.clocks)))
    off = steady - np.floor(steady) - 0.5 + found.clock_deviation - ages / PERIOD
    # a turn common to all is the motion's; where the board hardly turns nothing tells
    off -= np.median(off, axis=1, keepdims=True)
    told = np.linalg.norm(there.turn, axis=1) > 200
    assert np.median(np.abs(off[told])) < 0.01
    # left are samples with several readings beside a jump at once
    assert np.mean(np.abs(off[told]) > 0.3) < 0.03
    # the clock's own jumps leave as many readings a turn off as jitter and the jump's place do
    plain = steady - np.floor(steady) - 0.5 - ages / PERIOD
    assert np.mean(np.abs(plain[told]) > 0.3) > 0.09


def test_a_declared_period_near_the_found_one_is_taken():
    there = Rough(3, samples=400)
    there.period = 1.1 * PERIOD
    guesses = there.guesses(np.random.default_rng(3))
    found = clocks_from_gyroscopes(there, there.acceleration, guesses)
    assert {values[0] for values in found.values()} == {there.period}


@pytest.mark.parametrize(("smooth", "seen"), [(True, {1}), (False, {0, 1})])
def test_a_short_period_is_no_clock_but_in_rough_motion(monkeypatch, smooth, seen):
    """There a first look sees a small part of the ages; in smooth motion no IMU is so fast."""
    each = {0: (200.0, np.array([2e-5, 0.3, 0, 0, 0])), 1: (200.0, np.array([1e-3, 0.3, 0, 0, 0]))}
    monkeypatch.setattr(clocks, "sawtooths", lambda *given: each)
    monkeypatch.setattr(clocks, "delay_of", lambda *given: (None, None))
    readings = SimpleNamespace(exists=np.ones((2, 2), bool), time=None)
    one = SimpleNamespace(readings=readings, smooth=smooth, state=None)
    assert set(clocks.shown_clocks(one, None)) == seen
