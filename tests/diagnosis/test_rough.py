"""Rough motion, as of a board shaken by hand: faster than its samples, and clocks on top.

The recording is made on a grid of 8 kHz: what the triads' filters let pass, each IMU at its own
clock's instants, the accelerometers a fixed time behind. Nothing of the model is used.
"""

import numpy as np
import pytest
from scipy.signal import lfilter

from imuarray.diagnosis.document import diagnose
from imuarray.geometry import mimu4444_corners
from imuarray.recording import Recording

pytestmark = pytest.mark.slow

RATE, FINE, SECONDS = 62.5, 8000, 26.0
PERIOD, BEHIND, LAG = 1e-3, 1.5e-3, 1e-3  # s
FORCE_SD, RATE_SD = 0.04, 0.002


def sines(rng, time, frequencies, amplitudes):
    """A random (T, 3) signal and its derivative."""
    value, slope = np.zeros((len(time), 3)), np.zeros((len(time), 3))
    for frequency, amplitude in zip(frequencies, amplitudes, strict=True):
        turn, size = 2 * np.pi * frequency, amplitude * rng.standard_normal(3)
        angle = turn * time[:, None] + rng.uniform(0, 2 * np.pi, 3)
        value += size * np.sin(angle)
        slope += size * turn * np.cos(angle)
    return value, slope


def filtered(values):
    """A first-order low pass, as both kinds of triad have."""
    keep = np.exp(-1 / (FINE * LAG))
    return lfilter([1 - keep], [1, -keep], values, axis=0, zi=values[:1] * keep)[0]


def at(instants, time, values):
    return np.stack([np.interp(instants, time, values[:, axis]) for axis in range(3)], axis=1)


def rough_recording(seed):
    """(recording, positions, the clocks' alias frequencies)."""
    rng, array = np.random.default_rng(seed), mimu4444_corners()
    time = np.arange(int(SECONDS * FINE)) / FINE
    tones = np.concatenate([rng.uniform(0.5, 4, 8), rng.uniform(20, 100, 40)])
    omega, turning = sines(rng, time, tones, np.repeat([5.0, 0.35], [8, 40]))
    force = sines(rng, time, tones, np.repeat([3.0, 1.0], [8, 40]))[0] + [0, 0, -9.8]
    count = len(array.relative)
    shifts = np.vstack([np.zeros((1, 3)), rng.normal(0, 5e-4, (count - 1, 3))])
    positions = array.relative + shifts
    host = 0.5 + np.arange(int((SECONDS - 1) * RATE)) / RATE
    aliases, phases = rng.uniform(-3, 3, count), rng.uniform(0, 1, count)
    maps = np.eye(3) + rng.normal(0, 0.01, (count, 3, 3))
    maps += np.eye(3) - maps.mean(axis=0)
    observed, forces, rates = filtered(omega), [], []
    for place, alias, phase, own in zip(positions, aliases, phases, maps, strict=True):
        instants = host - PERIOD * ((alias * (host - host[0]) + phase) % 1)
        lever = np.cross(omega, np.cross(omega, place)) + np.cross(turning, place)
        forces.append(at(instants - BEHIND, time, filtered(lever + force)))
        rates.append(at(instants, time, observed) @ own.T)
    forces, rates = np.stack(forces, axis=1), np.stack(rates, axis=1)
    recording = Recording(
        time=host, specific_force=forces + rng.normal(0, FORCE_SD, forces.shape),
        angular_rate=rates + rng.normal(0, RATE_SD, rates.shape),
        accelerometer_position=array.positions, accelerometer_labels=array.labels,
        gyroscope_labels=array.labels, accelerometer_noise_sd=FORCE_SD, gyroscope_noise_sd=RATE_SD,
        accelerometer_range=400.0, gyroscope_range=80.0, position_prior_sd=1e-3, source="simulated",
    )  # fmt: skip
    return recording, positions - positions[0], aliases


@pytest.fixture(scope="module")
def made():
    recording, positions, aliases = rough_recording(2)
    return diagnose(recording, replicates=1), positions, aliases


def numbers(document, effect, name):
    """Values of an effect's parameter, in the order of the IMUs."""
    cause = next(c for c in document["causes"] if c["effect"] == effect)
    return np.array([v["value"] for k, v in cause["parameters"].items() if k.startswith(name)])


def test_clocks_and_lag_are_found_beside_the_gyroscopes_errors(made):
    document, _, aliases = made[0].document, *made[1:]
    first = {cause["effect"] for cause in document["causes"][:4]}
    # products of filtered rates are not the filtered products: what no effect names is said
    others = {cause["effect"] for cause in document["causes"][4:]}
    assert document["unexplained"] or not others
    assert document["smooth"]["gyroscope"]["residual"] < 2
    assert first == {
        "sensor_clock", "gyroscope_delay", "gyroscope_misalignment", "gyroscope_scale",
    }  # fmt: skip
    assert numbers(document, "sensor_clock", "frequency") == pytest.approx(aliases, abs=0.003)
    assert numbers(document, "sensor_clock", "period") == pytest.approx(PERIOD, rel=0.06)
    assert numbers(document, "gyroscope_delay", "") == pytest.approx(BEHIND, rel=0.06)


def test_the_extended_model_s_positions_are_five_times_better_and_within_their_sds(made):
    document, positions, _ = made[0].document, *made[1:]
    error = {
        name: np.sqrt(np.mean((np.array(document[name]["positions_m"]) - positions)[1:] ** 2))
        for name in ("base", "extended")
    }
    assert error["base"] > 4e-5
    assert error["extended"] < error["base"] / 5
    off = (np.array(document["extended"]["positions_m"]) - positions)[1:]
    assert np.mean(np.abs(off) < 1.96 * np.array(document["extended"]["positions_sd_m"])[1:]) > 0.8
