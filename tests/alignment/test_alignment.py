"""Logs of loose IMUs brought together: against the truth, and against a slow, obvious search."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.interpolate import CubicSpline
from scipy.optimize import minimize
from scipy.spatial.transform import Rotation

from imuarray.alignment import align
from imuarray.alignment.clocks import compare
from imuarray.alignment.found import _with
from imuarray.alignment.resample import Sensor, Splines, spline_error
from imuarray.errors import InputError
from imuarray.motion import hand_twisting
from imuarray.recording import read_recording, write_recording
from imuarray.recording.rig import Log

OFFSETS, DRIFTS, RATES = (0.0, 1.7e9, -0.4), (0.0, 2e-4, -1e-4), (200.0, 190.0, 100.0)
TURNS = Rotation.random(3, np.random.default_rng(1)).as_matrix()
TURNS[0] = np.eye(3)
NOISE = 0.04, 1e-3
LENGTH = 12.0


def logs(motion, count=3, noise=NOISE):
    """Of IMUs at one place, so that all feel the same; stamps are offset + (1 + drift) time."""
    rng, out = np.random.default_rng(2), []
    for k in range(count):
        time = (np.arange(int(LENGTH * RATES[k])) + rng.uniform()) / RATES[k]
        sensed = motion.force.derivative(time), motion.rotation.derivative(time)
        force, rate = (
            x @ TURNS[k].T + sd * rng.standard_normal(x.shape)
            for x, sd in zip(sensed, noise, strict=True)
        )
        stamps = OFFSETS[k] + (1 + DRIFTS[k]) * time
        place = np.array([[0, 0, 0], [0.02, 0, 0], [0, 0.02, 0]])[k]
        out.append(
            Log(str(k + 1), stamps, force, stamps, rate, place, None, NOISE[0], 160.0, NOISE[1], 35)
        )
    return out


@pytest.fixture(scope="module")
def motion():
    return hand_twisting(np.random.default_rng(3), 8.0, 5.0, 4.0)


@pytest.fixture(scope="module")
def found(motion):
    return align(logs(motion), position_prior_sd=1e-3)


def test_clocks_and_rotations_are_the_true_ones(found):
    """Within 4 of the claimed sds, which are small; stamps since 1970 cost 0.2 us."""
    alignment = found[1]
    for k in (1, 2):
        clock = alignment.clocks[k]
        time = np.array([0.0, LENGTH])
        stamps = OFFSETS[k] + (1 + DRIFTS[k]) * time
        sds = np.sqrt(np.diag(clock.covariance))
        allowed = 4 * (sds[0] + sds[1] * LENGTH / 2) + 2.5e-7
        np.testing.assert_allclose(clock.instants(stamps), time, rtol=0, atol=allowed)
        assert allowed < 1e-5
        off = Rotation.from_matrix(TURNS[k] @ alignment.rotation[k]).magnitude()
        assert off < 8 * alignment.angle_sd[k] < 1e-4


def test_readings_are_those_at_the_common_instants(found, motion):
    """Noise apart, which is what is said; unless interpolation were wrong by as much."""
    recording, alignment = found
    time = recording.time + alignment.origin
    true = motion.force.derivative(time), motion.rotation.derivative(time)
    sensed = recording.specific_force, recording.angular_rate
    error, noise = np.moveaxis(alignment.carried, -1, 0)[2:]
    inner = slice(20, -20)
    for kind, (one, wanted) in enumerate(zip(sensed, true, strict=True)):
        left = (one - wanted[:, None])[inner].std(axis=(0, 2))
        np.testing.assert_allclose(left, noise[:, kind], rtol=0.1)
    assert (error < noise / 3).all()


def test_the_clock_is_that_of_a_plain_search(motion):
    """Offset and drift by Nelder and Mead, a map by least squares at each."""
    first, other = (
        Sensor("", log.gyroscope_time, 0.0, log.angular_rate, np.abs(log.angular_rate) > 35, 1e-3)
        for log in (logs(motion)[0], logs(motion)[2])
    )
    clock = compare(first, other)
    spline = CubicSpline(first.time, first.values)
    inside = slice(20, -80)

    def misfit(parameters):
        offset, drift = 1e-3 * parameters
        stamps = other.time[inside]
        base = spline(stamps - offset - drift * (stamps - clock.middle))
        base = np.column_stack([base, np.ones(len(base))])
        return np.linalg.lstsq(base, other.values[inside])[1].sum()

    options = {"xatol": 1e-7, "fatol": 0.0, "maxiter": 200}
    start = 1e3 * np.array([clock.offset + 2e-3, 0.0])
    slow = 1e-3 * minimize(misfit, start, method="Nelder-Mead", options=options).x
    np.testing.assert_allclose([clock.offset, clock.drift], slow, rtol=0, atol=2e-6)


def test_a_splines_error_for_a_sinusoid_is_that_predicted():
    time, at = np.arange(400.0), np.random.default_rng(4).uniform(100, 300, 5000)
    for frequency in (0.1, 0.2, 0.3, 0.4):
        turn = 2 * np.pi * frequency * time + 0.3
        waves = np.sqrt(2) * np.sin(np.column_stack([turn, turn, turn]))
        sensor = Sensor("", time, 0.0, waves, np.zeros((400, 3), bool), 1.0)
        true = np.sqrt(2) * np.sin(2 * np.pi * frequency * at + 0.3)
        left = np.mean((Splines(sensor)(np.sort(at))[:, 0] - true[np.argsort(at)]) ** 2)
        np.testing.assert_allclose(left, spline_error(np.array([frequency]))[0], rtol=0.1)


def test_gaps_and_rails_are_left_out_or_marked(motion):
    """A second without readings of one IMU, and a reading at the rail of another."""
    first, second, third = logs(motion)
    keep = (third.gyroscope_time < 5.0) | (third.gyroscope_time > 6.0)
    third = replace(third, gyroscope_time=third.gyroscope_time[keep],
                    angular_rate=third.angular_rate[keep])  # fmt: skip
    first.angular_rate[700, 1] = first.gyroscope_range
    recording, alignment = align([first, second, third], position_prior_sd=1e-3)
    assert 98 <= alignment.left_out <= 102
    assert "in gaps left out" in alignment.lines()[0]
    time = recording.time + alignment.origin
    assert not ((5.41 < time) & (time < 6.39)).any()
    near = np.abs(time - first.gyroscope_time[700]) < 0.02
    marked = recording.angular_rate_saturated
    np.testing.assert_array_equal(marked[near, 0], [[False, True, False]] * near.sum())
    assert near.sum() >= 3 and not marked[:, 1:].any()
    assert not marked[np.abs(time - first.gyroscope_time[700]) > 0.09].any()


def lossy(log, share, rng):
    """Without a share of its readings, here and there."""
    kept = rng.uniform(size=len(log.gyroscope_time)) > share
    return replace(
        log, gyroscope_time=log.gyroscope_time[kept], angular_rate=log.angular_rate[kept],
        accelerometer_time=log.accelerometer_time[kept], specific_force=log.specific_force[kept],
    )  # fmt: skip


def test_lost_readings_do_not_hide_motion_that_is_too_fast():
    """No run is whole then; what bridges the gaps would be off by a thousand times the noise."""
    rng = np.random.default_rng(5)
    fast, slow = (hand_twisting(np.random.default_rng(3), 8.0, 5.0, band) for band in (40.0, 4.0))
    with pytest.raises(InputError, match="motion too fast"):
        align([lossy(log, 0.05, rng) for log in logs(fast, 2)], position_prior_sd=1e-3)
    recording, alignment = align(
        [lossy(log, 0.05, rng) for log in logs(slow, 2)], position_prior_sd=1e-3
    )
    true = slow.rotation.derivative(recording.time + alignment.origin)
    left = (recording.angular_rate - true[:, None])[20:-20]
    assert np.abs(left).max() < 10 * NOISE[1] and alignment.left_out == 0


def test_a_sensor_much_faster_than_the_rest_is_averaged():
    """Slow motion leaks little into what ten readings' mean would miss."""
    time, rng = np.arange(0.0, 10.0, 1e-3), np.random.default_rng(1)
    motion = hand_twisting(np.random.default_rng(3), 8.0, 5.0, 3.0)
    values = motion.rotation.derivative(time) + 1e-3 * rng.standard_normal((len(time), 3))
    sensor = Sensor("", time, 0.0, values, np.zeros(values.shape, bool), 1e-3)
    assert sensor.error(0.01) < 1e-5 < sensor.error(0.2)


@pytest.mark.parametrize("later", [0.0, 4.0])
def test_of_places_that_fit_alike_the_stamps_decide(later):
    """A machine repeats its motion; logs that do not begin at once are no whole turn apart."""
    period, turns, out = 2.0, np.eye(3), []
    for k, begin in enumerate((0.0, later + 3.0)):
        time = begin + np.arange(0.0, 30.0 - begin, 0.005)
        phase = 2 * np.pi * time[:, None] / period
        rate = 4 * np.sin(phase * [1, 2, 3] + [0, 1, 2]) + 3 * np.cos(phase * [2, 3, 1])
        noise = np.random.default_rng(k).standard_normal(rate.shape)
        out.append(Log(str(k), time, 9.8 + 0.04 * noise, time, rate + 1e-3 * noise,
                       np.array([0.1 * k, 0, 0]), turns, 0.04, 160.0, 1e-3, 35.0))  # fmt: skip
    alignment = align(out, position_prior_sd=1e-3)[1]
    assert abs(alignment.clocks[1].offset) < 1e-4
    assert f"gyroscope '1' begins {later + 3.0:.1f} s after" in "\n".join(alignment.lines())


def test_what_was_found_is_said_and_kept(found, tmp_path):
    recording, alignment = found
    lines = "\n".join(alignment.lines())
    for text in ("100.00 Hz", "IMU 3: turned by", "ppm", "interpolation misses"):
        assert text in lines
    write_recording(recording, tmp_path / "rec.nc")
    kept = read_recording(tmp_path / "rec.nc").select(slice(0, 9)).alignment
    np.testing.assert_array_equal(kept.rotation, alignment.rotation)
    np.testing.assert_array_equal(read_recording(tmp_path / "rec.nc").time, recording.time)


def _mirrored(first, second):
    second.angular_rate[:, 1] *= -1


def _about_one_axis(first, second):
    for log, turn in zip((first, second), TURNS, strict=False):
        log.angular_rate[:] = log.angular_rate @ turn @ np.diag([1, 1e-4, 1e-4]) @ turn.T


def _still(first, second):
    for log in (first, second):
        log.angular_rate[:] *= 1e-4


def _of_another_motion(first, second):
    second.angular_rate[:] = second.angular_rate[::-1].copy()


@pytest.mark.parametrize(
    "change, words",
    [
        (_mirrored, "gyroscope '2': expected right-handed axes"),
        (_about_one_axis, "about two axes at least"),
        (_still, "turning motion"),
        (_of_another_motion, "on one rigid body"),
    ],
)
def test_what_does_not_determine_it_is_refused(motion, change, words):
    two = logs(motion, 2)
    change(*two)
    with pytest.raises(InputError, match=words):
        align(two, position_prior_sd=1e-3)


def test_stamps_that_lie_years_apart_are_refused(motion):
    """Instants at a sensor's rate would fill any memory."""
    first, second = logs(motion, 2)
    second.gyroscope_time[len(second.gyroscope_time) // 2 :] += 1e9
    with pytest.raises(InputError, match=r"'2': expected stamps of one .* 1.16e\+04 days"):
        align([first, second], position_prior_sd=1e-3)


def test_motion_at_the_limit_of_a_sensors_rate_is_refused():
    fast = hand_twisting(np.random.default_rng(5), 8.0, 5.0, 45.0)
    with pytest.raises(InputError, match=r"'3': .* for 100 Hz: .* log at a higher rate"):
        align(logs(fast), position_prior_sd=1e-3)


@pytest.mark.parametrize("rounding, jitter", [(1e-3, 0.0), (1e-6, 5e-4)])
def test_stamps_that_are_rounded_or_late_cost_little(motion, found, rounding, jitter):
    """Readings are even; sds allow for what stamps of so many readings say, within 4 of them."""
    rng, made = np.random.default_rng(6), []
    for log in logs(motion):
        stamps = log.gyroscope_time + jitter * rng.standard_normal(len(log.gyroscope_time))
        stamps = np.round(stamps / rounding) * rounding
        made.append(replace(log, accelerometer_time=stamps, gyroscope_time=stamps))
    alignment = align(made, position_prior_sd=1e-3)[1]
    assert "ms off even readings" in "\n".join(alignment.lines())
    np.testing.assert_allclose(alignment.agreement[1:], found[1].agreement[1:], atol=0.03)
    clock, stamp = alignment.clocks[2], OFFSETS[2] + (1 + DRIFTS[2]) * LENGTH / 2
    sd = np.sqrt(clock.covariance[0, 0])
    assert abs(clock.instants(stamp) - LENGTH / 2) < 4 * sd + rounding / 2


def test_stamps_that_are_wild_are_refused(motion):
    """Shuffled by more than a reading, while the sensor's own pace is uneven, too."""
    first, second = logs(motion, 2)
    rng = np.random.default_rng(7)
    keep = rng.uniform(size=len(second.gyroscope_time)) > 0.5
    stamps = np.sort(second.gyroscope_time + 5e-3 * rng.standard_normal(len(keep)))[keep]
    second = replace(second, gyroscope_time=stamps, angular_rate=second.angular_rate[keep])
    with pytest.raises(InputError, match="gyroscope '2'"):
        align([first, second], position_prior_sd=1e-3)


def test_an_sd_too_small_to_show_is_a_bound():
    assert _with(1.2345, 0.056) == "1.234 +- 0.056" and _with(3.0, 4e-4) == "3.0000 +- 0.0004"
    assert _with(0.0123, 1e-6) == "0.0123 +- < 0.0001" and _with(2e-5, 1e-6) == "< 0.0001"
