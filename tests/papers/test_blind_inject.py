"""The independent injector: effects against their written-out equations, sizes against oracles."""

import json
from collections import Counter

import numpy as np
import pytest
from scipy.interpolate import CubicSpline
from scipy.linalg import toeplitz
from scipy.stats import multivariate_normal

from imuarray.recording import Recording
from imuarray.recording.format import from_dataset
from imuarray_papers.blind import cases as cases_module
from imuarray_papers.blind.cases import Case, make, matrix
from imuarray_papers.blind.change import draw_noise, finish, noiseless_readings, noisy_readings
from imuarray_papers.blind.inject import CATALOGUE, EFFECTS, GAUGE, OUTSIDE
from imuarray_papers.blind.measured import (
    NOT_FROM_READINGS,
    hide,
    inject_measured,
    measured_change,
)
from imuarray_papers.blind.scene import GYROSCOPE_RAIL, Pair, Scene
from imuarray_papers.blind.sizes import (
    below_rails,
    noise_divergence,
    scale_to,
    size_of,
    smallest_residual,
)
from imuarray_papers.reference import skew

NOISE_EFFECTS = {
    "accelerometer_noise",
    "gyroscope_noise",
    "heavy_tails",
    "coloured_noise",
    "outside_rate_noise",
}
KIND_NAMES = ("accelerometer", "gyroscope")
SOME = ((3,), (1, 6), tuple(range(8)))
MEASURABLE = [name for name in EFFECTS if name not in NOT_FROM_READINGS]


def scene(seed=1, duration=2.0, **kinds):
    return Scene.draw(np.random.default_rng(seed), duration=duration, **kinds)


def middle(name):
    """A realistic amplitude."""
    return float(np.sqrt(EFFECTS[name].low * EFFECTS[name].high))


def drawn(there, name, sensors=(3,), seed=7, amplitude=None):
    amplitude = middle(name) if amplitude is None else amplitude
    return EFFECTS[name].draw(there, np.random.default_rng(seed), sensors, amplitude)


def lever(motion, arm):
    """W r by matrices, (T, 3); `arm` (3,) or (T, 3)."""
    arms = np.broadcast_to(arm, motion.angular_rate.shape)
    rows = zip(motion.angular_rate, motion.angular_acceleration, arms, strict=True)
    return np.array([(skew(w) @ skew(w) + skew(a)) @ r for w, a, r in rows])


def clean(there, k, age=0.0):
    """u_k and w of one IMU, `age` seconds late."""
    motion = there.motion.at(there.time + age)
    return lever(motion, there.positions[k]) + motion.specific_force, motion.angular_rate


def by_axis(motion, arms):
    """What axis i sees at its own lever arm, arms (3, 3)."""
    return np.stack([lever(motion, arms[i])[:, i] for i in range(3)], axis=-1)


# What an IMU reads, from the true u and w, its row of the parameters, and what else is there.
EQUATIONS = {
    "accelerometer_bias": lambda u, w, p, x: (u + p["bias"], w),
    "accelerometer_scale": lambda u, w, p, x: ((1 + p["scale"]) * u, w),
    "accelerometer_misalignment": lambda u, w, p, x: (u + u @ p["misalignment"].T, w),
    "accelerometer_nonlinearity": lambda u, w, p, x: (u + p["curvature"] * u**2, w),
    "size_effect": lambda u, w, p, x: (u + by_axis(x["motion"], p["lever_arm"]), w),
    "gyroscope_bias": lambda u, w, p, x: (u, w + p["bias"]),
    "gyroscope_scale": lambda u, w, p, x: (u, (1 + p["scale"]) * w),
    "gyroscope_misalignment": lambda u, w, p, x: (u, w + w @ p["misalignment"].T),
    "gyroscope_g_sensitivity": lambda u, w, p, x: (u, w + u @ p["sensitivity"].T),
    "gyroscope_nonlinearity": lambda u, w, p, x: (u, w + p["curvature"] * w**2),
    "sensor_delay": lambda u, w, p, x: clean(x["scene"], x["k"], p["delay"]),
    "gyroscope_delay": lambda u, w, p, x: (u, clean(x["scene"], x["k"], p["delay"])[1]),
    "position_shift": lambda u, w, p, x: (
        u + (x["time"] >= x["all"]["instant"])[:, None] * lever(x["motion"], p["shift"]),
        w,
    ),
    "outside_cubic": lambda u, w, p, x: (u + p["coefficient"] * u**3, w),
    "outside_flexible_board": lambda u, w, p, x: (
        u + lever(x["motion"], u @ p["compliance"].T),
        w,
    ),
    "outside_vibration_rectification": lambda u, w, p, x: (
        u
        + p["coefficient"] * np.linalg.norm(x["motion"].angular_acceleration, axis=1)[:, None] ** 2,
        w,
    ),
    "outside_cross_talk": lambda u, w, p, x: (u + w @ p["leak"].T, w),
    "gauge_gyroscope_scale": lambda u, w, p, x: (u, (1 + x["all"]["scale"]) * w),
    "gauge_accelerometer_scale": lambda u, w, p, x: ((1 + x["all"]["scale"]) * u, w),
    "gauge_sensor_delay": lambda u, w, p, x: clean(x["scene"], x["k"], x["all"]["delay"]),
    "gauge_accelerometer_bias": lambda u, w, p, x: (u + x["all"]["bias"], w),
    "gauge_lever_arm": lambda u, w, p, x: (u + by_axis(x["motion"], x["all"]["lever_arm"]), w),
}


@pytest.mark.parametrize("name", EQUATIONS)
def test_mean_effect_is_its_equation_and_leaves_the_others_alone(name):
    there = scene()
    motion = there.motion.at(there.time)
    for sensors in SOME:
        change = drawn(there, name, sensors)
        found = noiseless_readings(there, [change])
        values = {n: p.value for n, p in change.parameters.items()}
        affected = range(8) if name in GAUGE else sensors
        assert change.sensors == tuple(affected)
        for k in range(8):
            force, rate = clean(there, k)
            if k in affected:
                row = sensors.index(k) if k in sensors else 0
                own = {n: v[row] for n, v in values.items() if np.ndim(v) and row < len(v)}
                extra = dict(all=values, scene=there, k=k, motion=motion, time=there.time)
                force, rate = EQUATIONS[name](force, rate, own, extra)
            np.testing.assert_allclose(found.force[:, k], force, rtol=1e-8, atol=1e-8)
            np.testing.assert_allclose(found.rate[:, k], rate, rtol=1e-8, atol=1e-9)


def test_misalignment_has_no_diagonal_and_directions_are_normal_of_the_amplitude():
    there = scene()
    for name in ("accelerometer_misalignment", "gyroscope_misalignment"):
        matrices = drawn(there, name, range(8), amplitude=0.01).parameters["misalignment"].value
        assert not np.einsum("kii->ki", matrices).any()
        # 48 entries; 4 sd of their sd's own scatter
        assert 0.01 * (1 - 0.41) < matrices[matrices != 0].std() < 0.01 * 1.41


def test_gyroscope_delay_of_all_is_common_in_about_half_of_the_draws():
    there = scene(duration=0.2)
    common = [
        drawn(there, "gyroscope_delay", range(8), s).parameters["common"].value for s in range(200)
    ]
    assert 60 < sum(common) < 140  # 5.6 sd
    for seed in range(20):
        delay = drawn(there, "gyroscope_delay", range(8), seed).parameters["delay"].value
        assert (np.ptp(delay) == 0) == common[seed]


def steady_host(there, sensors, steady=True):
    """A seed whose host reads at even intervals, or not."""
    return next(
        seed for seed in range(20)
        if (drawn(there, "sensor_clock", sensors, seed, 1e-3).parameters["host_latency"].value == 0)
        == steady
    )  # fmt: skip


def test_a_host_that_reads_unevenly_gets_another_sample_near_a_jump_alone():
    there = scene()
    change = drawn(there, "sensor_clock", (3,), steady_host(there, (3,), False), 1e-3)
    period, phase = (change.parameters[n].value[0] for n in ("period", "phase"))
    age = change.ages.force[:, 3]
    turns = (there.time + age - phase) / period
    np.testing.assert_allclose(turns, np.round(turns), atol=1e-6)  # its own samples
    late = np.mod(there.time - phase, period) + age  # turns by which it is not the newest
    off = np.abs(late) > 1e-9
    near = np.mod(there.time - phase + period / 2, period) - period / 2
    assert 0.01 < off.mean() < 0.1 and np.abs(near[off]).max() < 5 * 5e-5
    np.testing.assert_allclose(np.abs(late[off]), period, rtol=1e-6)


@pytest.mark.parametrize("sensors", SOME)
def test_clock_gives_the_newest_sample_of_a_free_running_clock(sensors):
    there = scene()
    change = drawn(there, "sensor_clock", sensors, seed=steady_host(there, sensors), amplitude=1e-3)
    found = noiseless_readings(there, [change])
    for row, k in enumerate(sensors):
        period = change.parameters["period"].value[row]
        assert 0.009e-3 < abs(period - 1e-3) < 0.051e-3
        ticks = change.parameters["phase"].value[row] + period * np.arange(-3, 2.2 / period)
        newest = ticks[np.searchsorted(ticks, there.time, side="right") - 1]
        assert (newest <= there.time).all() and (there.time - newest < period).all()
        force, rate = clean(there, k, newest - there.time)
        np.testing.assert_allclose(found.force[:, k], force, rtol=1e-7, atol=1e-7)
        np.testing.assert_allclose(found.rate[:, k], rate, rtol=1e-7, atol=1e-8)
    untouched(there, change, found)


def untouched(there, change, found, ideal=None):
    """The IMUs that are not affected read what they would."""
    rest = [k for k in range(8) if k not in change.sensors]
    for values, before in zip(found, ideal or there.ideal(), strict=True):
        np.testing.assert_array_equal(values[:, rest], before[:, rest])


@pytest.mark.parametrize("seed", range(6))
def test_drift_starts_at_nothing_and_ends_at_its_parameter(seed):
    there = scene()
    change = drawn(there, "bias_drift", (1, 6), seed)
    found = noiseless_readings(there, [change])
    untouched(there, change, found)
    differences = {
        "force": found.force - there.ideal().force,
        "rate": found.rate - there.ideal().rate,
    }
    for what, difference in differences.items():
        known = change.parameters.get(f"{what}_drift")
        assert np.abs(difference[0]).max() < 1e-14
        if known is None:
            assert not difference.any()
            continue
        np.testing.assert_allclose(difference[-1, [1, 6]], known.value, atol=1e-12)
        shape = difference[:, 1, 0] / difference[-1, 1, 0]
        assert (np.diff(shape) > 0).all()
        straight = change.parameters["form"].value == "linear"
        assert (np.abs(shape - np.linspace(0, 1, len(shape))).max() < 1e-9) == straight


def test_a_warm_up_follows_one_temperature_in_all_sensors():
    there = scene()
    change = drawn(there, "warm_up", (1,))
    assert change.sensors == tuple(range(8))
    found, values = noiseless_readings(there, [change]), change.parameters
    fast, slow = (1 - np.exp(-there.time / tau) for tau in values["time_constants"].value)
    course = 0.8 * fast + 0.2 * slow
    for name, readings, ideal in zip(("force", "rate"), found, there.ideal(), strict=True):
        expected = course[:, None, None] / course[-1] * values[f"{name}_drift"].value
        np.testing.assert_allclose(readings - ideal, expected, atol=1e-12)


def test_chips_made_alike_have_their_axes_at_the_same_places_of_their_own():
    there, every = scene(), tuple(range(8))
    seeds = [s for s in range(9) if drawn(there, "size_effect", every, s).parameters["alike"].value]
    arms = drawn(there, "size_effect", every, seeds[0], 1e-3).parameters["lever_arm"].value
    underside = [[0, -1, 0], [-1, 0, 0], [0, 0, -1]]  # turned by half a turn about y = -x
    own = []
    for k in every:
        turn = np.array(underside if k % 2 else np.eye(3))
        order = np.argmax(np.abs(turn), axis=0)  # the array's axis that lies along each of its own
        own.append([turn.T @ arms[k, order[axis]] for axis in range(3)])
    apart = np.array(own) - np.mean(own, axis=0)
    assert 1e-5 < apart.std() < 8e-5 and 3e-4 < np.mean(own, axis=0).std() < 3e-3
    assert 0 < len(seeds) < 9


def test_a_shock_rings_within_a_millisecond_and_fades():
    there = scene()
    change = drawn(there, "shock", (1,), amplitude=3.0)
    assert change.sensors == tuple(range(8))
    force, rate = noiseless_readings(there, [change])
    force, rate = force - there.ideal().force, rate - there.ideal().rate
    begin = change.parameters["begin"].value
    since = there.time - begin[np.searchsorted(begin, there.time) - 1]
    late = (since > 0.25) | (there.time < begin[0])
    assert 0.5 < np.abs(force).max() < 60 and np.abs(force[late]).max() < 1e-3
    # of one rigid body, each IMU at an instant of its own: no two are alike
    struck = np.abs(force[..., 0]).max(axis=1) > 0.5
    assert struck.sum() > 5 and np.abs(np.corrcoef(force[struck, :, 0].T) - np.eye(8)).max() < 0.98
    # the rate is the integral of what turns: smaller by 2 pi 400 Hz
    turning = np.abs(rate[struck]).max() * 2 * np.pi * 400 * 0.02
    assert 0.1 < turning / np.abs(force[struck]).max() < 10


def test_a_drift_of_all_sensors_is_of_one_kind():
    for seed in range(6):
        change = drawn(scene(), "bias_drift", tuple(range(8)), seed)
        assert len({"force_drift", "rate_drift"} & set(change.parameters)) == 1


@pytest.mark.parametrize("seed", range(6))
def test_axis_swap_is_a_signed_permutation_of_the_readings(seed):
    there = scene()
    change = drawn(there, "axis_swap", (1, 6), seed)
    found = noiseless_readings(there, [change])
    untouched(there, change, found)
    tables = change.parameters["reading_from_true"].value
    kinds = change.parameters["of"].value
    for values, before, kind in zip(found, there.ideal(), KIND_NAMES, strict=True):
        for row, k in enumerate((1, 6)):
            table = tables[row] if kind in kinds else np.eye(3)
            np.testing.assert_allclose(values[:, k], before[:, k] @ table.T, atol=1e-12)
    for table in tables:
        assert (np.abs(table).sum(axis=0) == 1).all() and np.linalg.det(table) == -1


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("name", ["accelerometer_noise", "gyroscope_noise", "heavy_tails"])
def test_noise_is_that_of_the_clean_recording_times_a_factor(name, seed):
    there = scene()
    change = drawn(there, name, (1, 6), seed)
    before, after = (
        draw_noise(there, changes, np.random.default_rng(2)) for changes in ([], [change])
    )
    untouched(there, change, after, before)
    ratios = [x[:, [1, 6]] / y[:, [1, 6]] for x, y in zip(after, before, strict=True)]
    factor = np.asarray(change.parameters["factor"].value)
    if name == "heavy_tails":
        kinds = change.parameters["of"].value
        for ratio, kind in zip(ratios, KIND_NAMES, strict=True):
            np.testing.assert_allclose(ratio - ratio[..., :1], 0, atol=1e-9)
            wild = np.isclose(ratio[..., 0], factor)
            assert (wild | np.isclose(ratio[..., 0], 1)).all()
            expected = change.parameters["share"].value if kind in kinds else 0
            np.testing.assert_allclose(wild.mean(axis=0), expected)
        return
    other, own = ratios if name == "gyroscope_noise" else ratios[::-1]
    np.testing.assert_array_equal(other, 1)
    np.testing.assert_allclose(own, np.broadcast_to(factor[:, None], own.shape))
    assert 0.5 <= factor.min() and factor.max() <= 5 and (factor != 1).all()


def test_coloured_noise_has_the_declared_sd_and_its_correlation():
    """Seed 2; tolerances are 5 sd of a correlation and an sd over 24 000 samples."""
    there = scene(duration=192.0)
    change = drawn(there, "coloured_noise", (1, 6), 3, amplitude=0.7)
    noise = draw_noise(there, [change], np.random.default_rng(2))
    untouched(there, change, noise, draw_noise(there, [], np.random.default_rng(2)))
    kinds = change.parameters["of"].value
    for values, sd, kind in zip(noise, there.noise, KIND_NAMES, strict=True):
        part = values[:, 6] / sd
        rho = 0.7 if kind in kinds else 0.0
        assert np.abs(part.std(axis=0) - 1).max() < 5 * np.sqrt(1.5 / len(part))
        for lag in (1, 2, 5):
            seen = (part[lag:] * part[:-lag]).mean(axis=0)
            assert np.abs(seen - rho**lag).max() < 5 * np.sqrt(3 / len(part))


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize("rails", [False, True])
def test_saturation_clips_after_noise_below_the_range(seed, rails):
    there = scene(rails=rails)
    change = drawn(there, "saturation", (1, 6), seed)
    rng = np.random.default_rng
    before, found = noisy_readings(there, [], rng(2)), noisy_readings(there, [change], rng(2))
    untouched(there, change, found, before)
    limits = dict(zip(("accelerometer_rail", "gyroscope_rail"), there.limits, strict=True))
    for values, old, (name, limit) in zip(found, before, limits.items(), strict=True):
        rail = change.parameters[name].value if name in change.parameters else limit
        assert name not in change.parameters or rail < limit
        np.testing.assert_array_equal(values[:, [1, 6]], np.clip(old[:, [1, 6]], -rail, rail))
        assert name not in change.parameters or (np.abs(values[:, [1, 6]]) == rail).any()


@pytest.mark.parametrize("share", [1e-4, 0.05])
def test_stale_samples_repeat_the_former_reading_of_the_imu_exactly(share):
    there = scene(duration=24.0)
    change = drawn(there, "stale_samples", (1, 6), 4, share)
    rng = np.random.default_rng
    before, found = noisy_readings(there, [], rng(2)), noisy_readings(there, [change], rng(2))
    untouched(there, change, found, before)
    for row, k in enumerate((1, 6)):
        stale = [(np.diff(x[:, k], axis=0) == 0).all(axis=1) for x in found]
        np.testing.assert_array_equal(*stale)
        assert stale[0].sum() == round(change.parameters["share"].value[row] * 3000) > 0
        # binomial, 5 sd; one repeat at least
        assert abs(stale[0].sum() - 3000 * share) < 5 * np.sqrt(3000 * share) + 1
        for values, old in zip(found, before, strict=True):
            fresh = ~np.concatenate([[False], stale[0]])
            np.testing.assert_array_equal(values[fresh, k], old[fresh, k])


@pytest.mark.parametrize("name", OUTSIDE)
def test_outside_effects_touch_their_sensors_only(name):
    there = scene()
    for sensors in SOME[:2]:
        change = drawn(there, name, sensors, 3)
        rng = np.random.default_rng
        before, found = noisy_readings(there, [], rng(2)), noisy_readings(there, [change], rng(2))
        untouched(there, change, found, before)
        for k in sensors:
            assert any((x[:, k] != y[:, k]).any() for x, y in zip(found, before, strict=True))


def test_outside_effects_without_an_equation_above_do_what_they_say():
    there = scene(duration=24.0)
    ideal = there.ideal()
    coarse = finish(there, [drawn(there, "outside_quantisation", (3,), 3, 5.0)], ideal)
    kinds = drawn(there, "outside_quantisation", (3,), 3, 5.0).parameters["of"].value
    for values, sd, kind in zip(coarse, there.noise, KIND_NAMES, strict=True):
        codes = values[:, 3] / (5 * sd)
        assert (np.abs(codes - np.round(codes)).max() < 1e-6) == (kind in kinds)
    late = drawn(there, "outside_timing_jitter", (3,), 3, 1e-4).ages
    assert 0.9e-4 < late.rate[:, 3].std() < 1.1e-4 and late.force is late.rate
    change = drawn(there, "outside_hysteresis", (3,), 3)
    extra = (noiseless_readings(there, [change]).force - ideal.force)[:, 3]
    assert np.abs(extra).max() <= np.abs(change.parameters["depth"].value).max() + 1e-12
    rising = np.sign(np.gradient(ideal.force[:, 3], axis=0)) * change.parameters["depth"].value
    assert (np.sum(extra * rising, axis=0) > 0).all()
    change = drawn(there, "outside_scale_drift", (3,), 3, 0.02)
    found = noiseless_readings(there, [change])
    for what in ("force", "rate"):
        end = change.parameters.get(f"{what}_scale_at_end")
        scale = 0 if end is None else end.value[0] * np.linspace(0, 1, 3000)[:, None]
        expected = (1 + scale) * getattr(ideal, what)[:, 3]
        np.testing.assert_allclose(getattr(found, what)[:, 3], expected, atol=1e-9)
    gains = drawn(there, "outside_rate_noise", (3,), 3, 2.0).gain
    gain = next(g for g in gains if g is not None)[:, 3]
    turning = np.linalg.norm(ideal.rate[:, 3], axis=1)
    assert np.corrcoef(np.log(gain), turning)[0, 1] > 1 - 1e-9


def test_effects_compose_in_the_order_of_the_hardware():
    there = scene()
    late = drawn(there, "sensor_delay", (3,), 1, 2e-3)
    scale = drawn(there, "gyroscope_scale", (3,), 2, 0.02)
    for changes in ([late, scale], [scale, late]):
        found = noiseless_readings(there, changes)
        force, rate = clean(there, 3, late.parameters["delay"].value[0])
        np.testing.assert_allclose(found.force[:, 3], force, atol=1e-8)
        expected = (1 + scale.parameters["scale"].value[0]) * rate
        np.testing.assert_allclose(found.rate[:, 3], expected, atol=1e-9)
    stale = drawn(there, "stale_samples", (3,), 1, 0.2)
    clip = drawn(there, "saturation", (3,), 1, 0.3)
    one = noisy_readings(there, [stale, clip], np.random.default_rng(1))
    other = noisy_readings(there, [clip, stale], np.random.default_rng(1))
    for x, y in zip(one, other, strict=True):
        np.testing.assert_array_equal(x, y)


def test_scene_agrees_with_the_motion_and_its_rails_are_met():
    there = scene()
    motion = there.motion.at(there.time)
    np.testing.assert_allclose(there.nominal.rate[:, 0], motion.angular_rate, atol=1e-10)
    np.testing.assert_allclose(there.nominal.acceleration[:, 0], motion.angular_acceleration)
    np.testing.assert_allclose(there.nominal.force[:, 0], motion.specific_force, atol=1e-10)
    assert not there.positions[0].any()
    late = np.tile(1e-3 * np.arange(8), (len(there.time), 1))
    apart = there.field(Pair(late, np.zeros_like(late)))
    np.testing.assert_allclose(apart.force[:, 5], clean(there, 5, 5e-3)[0], atol=1e-8)
    np.testing.assert_allclose(apart.rate, there.ideal().rate)
    np.testing.assert_allclose(
        there.field(Pair(late, late)).rate[:, 5], clean(there, 5, 5e-3)[1], atol=1e-9
    )
    for seed in range(5):
        railed = scene(seed, duration=24.0, rails=True)
        readings = noisy_readings(railed, [], np.random.default_rng(1))
        share = (np.abs(readings.rate) >= GYROSCOPE_RAIL).any(axis=(1, 2)).mean()
        assert 0.01 < share < 0.1 and np.abs(readings.rate).max() == GYROSCOPE_RAIL
    assert len(scene(imus=32).positions) == 32
    with pytest.raises(ValueError, match="imus"):
        scene(imus=9)
    with pytest.raises(ValueError, match="sensors"):
        drawn(there, "accelerometer_bias", (8,))


def dense_size(there, perturbed, keep):
    """The size by one large least-squares problem with a numerical Jacobian."""
    samples = int(keep.sum())
    nominal = [x[keep, 0] for x in there.nominal]

    def predicted(unknown):
        w, a, s = unknown[: 9 * samples].reshape(3, samples, 3) + np.array(nominal)
        r = there.positions.copy()
        r[1:] += unknown[9 * samples :].reshape(-1, 3)
        inner = np.cross(w[:, None], r)
        force = np.cross(w[:, None], inner) + np.cross(a[:, None], r) + s[:, None]
        rate = np.repeat(w[:, None], len(r), axis=1)
        return np.concatenate([(force / 0.04).ravel(), (rate / np.radians(0.06)).ravel()])

    count = 9 * samples + 3 * (len(there.positions) - 1)
    # central differences of a cubic; steps of 1e-3 in every unit
    steps = 1e-3 * np.eye(count)
    jacobian = np.stack([(predicted(h) - predicted(-h)) / 2e-3 for h in steps], axis=1)
    change = np.concatenate(
        [(perturbed.force[keep] / 0.04).ravel(), (perturbed.rate[keep] / np.radians(0.06)).ravel()]
    ) - predicted(np.zeros(count))
    best = np.linalg.lstsq(jacobian, change, rcond=1e-13)[0]
    return np.linalg.norm(change - jacobian @ best)


@pytest.mark.parametrize("rails", [False, True])
def test_size_is_what_a_dense_least_squares_leaves(rails):
    there = scene(3, duration=0.4, rails=rails)
    plain = there.ideal()
    for name in ("accelerometer_scale", "gyroscope_misalignment", "sensor_delay", "position_shift"):
        found = noiseless_readings(there, [drawn(there, name, range(8), 1)])
        keep = np.ones(len(there.time), bool)
        for values, limit in zip(found, there.limits, strict=True):
            keep &= (np.abs(values) < limit).all(axis=(1, 2))
        assert rails is not keep.all()
        expected = dense_size(there, found, keep)
        assert smallest_residual(there, plain, found) == pytest.approx(expected, rel=1e-4)


@pytest.mark.parametrize("name", [n for n in EFFECTS if EFFECTS[n].scalable and n not in GAUGE])
def test_sizes_are_met_when_recomputed(name):
    for number, sensors in enumerate(SOME[::2]):
        # a rail below the declared one on all IMUs is never small where that one is reached
        rails = bool(number) and name != "saturation"
        there = scene(number, duration=8.0, rails=rails)
        for sigma in (4.0, 50.0):
            amplitude = scale_to(there, name, sensors, 11, sigma)
            again = scene(number, duration=8.0, rails=rails)
            change = drawn(again, name, sensors, 11, amplitude)
            assert size_of(again, change) == pytest.approx(sigma, rel=0.05)
            if name not in NOISE_EFFECTS:
                # minimised, not linear
                assert size_of(again, change, 4) == pytest.approx(sigma, rel=0.05)
            assert (change.divergence is not None) == (name in NOISE_EFFECTS)


def test_effects_without_an_amplitude_or_a_size_say_so():
    for name in ("axis_swap", *GAUGE):
        with pytest.raises(ValueError, match="amplitude"):
            scale_to(scene(), name, (3,), 1, 12.0)
    assert size_of(scene(), drawn(scene(), "axis_swap")) > 1000


def test_divergences_of_the_noise_against_other_formulas():
    """Seed 1; the Monte Carlo one within 5 of its standard errors."""
    there, share_left = scene(), (48 - 9) / 48
    change = drawn(there, "coloured_noise", (3,), 1, 0.6)
    kinds = len(change.parameters["of"].value)
    _, log_determinant = np.linalg.slogdet(toeplitz(0.6 ** np.arange(400)))
    exact = -0.5 * log_determinant * 3 * kinds * share_left
    assert noise_divergence(there, change, 400) == pytest.approx(exact, rel=0.004)
    change = drawn(there, "heavy_tails", (3,), 1, 4.0)
    share, rng = change.parameters["share"].value, np.random.default_rng(1)
    kinds, eye = len(change.parameters["of"].value), np.eye(3)
    draws = rng.standard_normal((200_000, 3)) * np.where(rng.random(200_000) < share, 5, 1)[:, None]
    normal = [multivariate_normal(np.zeros(3), v * eye).pdf(draws) for v in (1, 25, 1 + 24 * share)]
    ratio = np.log((1 - share) * normal[0] + share * normal[1]) - np.log(normal[2])
    error = 5 * ratio.std() / np.sqrt(len(ratio))
    found = noise_divergence(there, change, 1) / kinds / share_left
    assert found == pytest.approx(ratio.mean(), abs=error)
    change = drawn(there, "accelerometer_noise", (3,), 1, np.log(2.0))
    c = change.parameters["factor"].value[0]
    by_hand = 0.5 * (c**2 - 1 - 2 * np.log(c)) * 3 * 100 * share_left
    assert noise_divergence(there, change, 100) == pytest.approx(by_hand)


@pytest.mark.parametrize("name", GAUGE)
def test_gauges_can_not_be_seen(name):
    for rails in (False, True):
        there = scene(duration=8.0, rails=rails)
        change = drawn(there, name, (0,), amplitude=EFFECTS[name].high)
        plain, found = there.ideal(), noiseless_readings(there, [change])
        keep = below_rails(there, found)
        parts = zip(found, plain, there.noise, strict=True)
        # motion and positions known
        raw = np.sqrt(sum((((y - x)[keep] / sd) ** 2).sum() for y, x, sd in parts))
        assert raw > 50
        assert smallest_residual(there, plain, found) < 0.05 * raw
        # with the second order minimised too, nothing is left at all
        assert smallest_residual(there, plain, found, 6) < 1e-6


@pytest.fixture(scope="module")
def quick():
    return [(case, *make(case, 5)) for case in matrix("quick")]


def test_cases_are_valid_recordings_with_their_truth(quick):
    for case, recording, truth in quick:
        again = from_dataset(recording.to_dataset())
        np.testing.assert_array_equal(again.specific_force, recording.specific_force)
        words = (recording.title + recording.source).lower()
        assert not any(name in words for name in EFFECTS)
        held = json.loads(json.dumps(truth))
        assert held["case"]["id"] == case.id and len(held["positions_m"]) == case.imus
        assert [e["effect"] for e in held["effects"]] == [name for name, _ in case.effects]
        assert held["struck"] == ([case.effects[0][0]] if case.kind == "struck" else [])
        assert (0.01 < held["at_rail"] < 0.1) if case.rails else held["at_rail"] == 0
        for said, (name, sensors) in zip(held["effects"], case.effects, strict=True):
            labels = [recording.accelerometer_labels[k] for k in sensors]
            assert said["sensors"] == (["all"] if len(labels) == case.imus else labels)
            assert all({"value", "unit"} == set(p) for p in said["parameters"].values())
            if case.sigma and EFFECTS[name].scalable:
                assert said["sigma"] == pytest.approx(case.sigma, rel=0.05)
        if case.kind == "gauge":
            assert truth["sigma_exact"] < 1e-6


def test_case_residuals_are_the_declared_noise_where_nothing_is_injected():
    recording, truth = make(Case("plain"), 3)
    spread = recording.angular_rate - recording.angular_rate.mean(axis=1, keepdims=True)
    sd = np.sqrt((spread**2).sum() / (7 * 3 * 3000))
    # 63 000 degrees of freedom; 5 sd
    assert sd == pytest.approx(recording.gyroscope_noise_sd, rel=5 / np.sqrt(2 * 63_000))
    assert truth["effects"] == [] and truth["sigma"] == 0


def test_same_seed_same_recording_other_seed_another():
    case = Case("twice", (("gyroscope_scale", (2,)),), 12.0, kind="one", duration=4.0)
    first, second, third = (make(case, seed) for seed in (1, 1, 2))
    np.testing.assert_array_equal(first[0].specific_force, second[0].specific_force)
    assert first[1] == second[1] != third[1]
    other = make(Case("other", case.effects, 12.0, kind="one", duration=4.0), 1)
    assert not np.array_equal(first[0].specific_force, other[0].specific_force)
    with pytest.raises(ValueError, match="kind"):
        Case("x", kind="nothing")


@pytest.mark.parametrize(("scale", "least", "most"), [("quick", 28, 32), ("default", 1000, 1300),
                                                      ("paper", 3600, 4400)])  # fmt: skip
def test_matrix_covers_every_effect_and_repeats_itself(scale, least, most):
    found = matrix(scale)
    assert found == matrix(scale) and least <= len(found) <= most
    assert len({case.id for case in found}) == len(found)
    assert {case.kind for case in found} == set(cases_module.KINDS)
    standard = Counter((c.imus, c.sampling_rate, c.duration) == (8, 125.0, 24.0) for c in found)
    assert standard[True] > 0.6 * len(found)
    if scale != "quick":
        assert {name for c in found for name, _ in c.effects} == set(EFFECTS)
        for name in CATALOGUE:
            mine = [c for c in found if c.kind == "one" and c.effects[0][0] == name]
            assert {len(c.effects[0][1]) == c.imus for c in mine} == {False, True}
            levels = {c.sigma for c in mine}
            assert levels == ({4, 8, 12, 20, 50, None} if EFFECTS[name].scalable else {None})
    with pytest.raises(ValueError, match="scale"):
        matrix("huge")


def as_recording(there, readings):
    """Readings of a scene as if they had been measured."""
    labels = there.array.labels
    return Recording(
        there.time, readings.force, readings.rate, there.array.positions, labels, labels,
        *there.noise, *there.limits, there.position_prior_sd,
    )  # fmt: skip


@pytest.mark.parametrize("name", MEASURABLE)
def test_effects_on_measured_recordings(name):
    there = scene(4, duration=4.0, rails=True)
    before = as_recording(there, noisy_readings(there, [], np.random.default_rng(3)))
    after = inject_measured(before, name, (3,), middle(name), 5)
    from_dataset(after.to_dataset())
    change = measured_change(before, name, (3,), middle(name), 5)
    pairs = [(before.specific_force, after.specific_force, before.saturated_accelerometers()),
             (before.angular_rate, after.angular_rate, before.saturated_gyroscopes())]  # fmt: skip
    rest = [k for k in range(8) if k not in change.sensors]
    assert any((new != old).any() for old, new, _ in pairs)
    for old, new, rail in pairs:
        np.testing.assert_array_equal(new[:, rest], old[:, rest])
        if name not in ("axis_swap", "stale_samples", "saturation"):
            np.testing.assert_array_equal(new[rail], old[rail])
    again = inject_measured(before, name, (3,), middle(name), 5)
    np.testing.assert_array_equal(again.angular_rate, after.angular_rate)


def test_measured_effects_are_those_of_the_scene_when_readings_are_exact():
    there = scene(4, duration=4.0)
    exact = as_recording(there, Pair(*map(np.array, there.ideal())))
    for name in ("sensor_delay", "gyroscope_g_sensitivity", "accelerometer_nonlinearity"):
        change = measured_change(exact, name, (3,), middle(name), 5)
        found = inject_measured(exact, name, (3,), middle(name), 5)
        u, w = clean(there, 3)
        own = {n: p.value[0] for n, p in change.parameters.items()}
        extra = dict(scene=there, k=3)
        force, rate = EQUATIONS[name](u, w, own, extra)
        inner = slice(5, -5)
        np.testing.assert_allclose(found.specific_force[inner, 3], force[inner], atol=2e-3)
        np.testing.assert_allclose(found.angular_rate[inner, 3], rate[inner], atol=2e-4)
    loud = inject_measured(exact, "gyroscope_noise", (3,), np.log(3.0), 5)
    added = (loud.angular_rate - exact.angular_rate)[:, 3]
    # sqrt(9 - 1) of the declared sd; 1500 values, 5 sd
    expected = np.sqrt(8) * there.noise[1]
    assert added.std() == pytest.approx(expected, rel=5 / np.sqrt(3000))
    smooth = CubicSpline(there.time, exact.angular_rate[:, 3])
    late = measured_change(exact, "gyroscope_delay", (3,), 1e-3, 5).parameters["delay"].value[0]
    found = inject_measured(exact, "gyroscope_delay", (3,), 1e-3, 5)
    expected = smooth(np.clip(there.time + late, 0, there.time[-1]))
    np.testing.assert_allclose(found.angular_rate[:, 3], expected)
    for name in (*NOT_FROM_READINGS, "nothing"):
        with pytest.raises(ValueError, match="effect"):
            inject_measured(exact, name, (3,), 1e-3, 5)


def test_what_is_hidden_in_a_recording_follows_the_seed():
    """On one IMU, of what it would show and does not have, twice as large as it must be."""
    there = scene(4, duration=4.0)
    before = as_recording(there, noisy_readings(there, [], np.random.default_rng(3)))
    sizes = {label: {"x": 1e-3, "y": 2e-3, "z": 4e-3} for label in before.accelerometer_labels}
    names = "accelerometer_bias", "gyroscope_bias", "gyroscope_scale", "size_effect"
    document = {
        "causes": [{"effect": "gyroscope_scale", "indistinguishable_from": ["gyroscope_bias"]}],
        "detectable": {name: {"units": {}, "sizes": sizes} for name in names},
    }
    changed, truth = hide(before, document, 5)
    again, same = hide(before, document, 5)
    np.testing.assert_array_equal(changed.specific_force, again.specific_force)
    assert truth == same == json.loads(json.dumps(truth))
    [effect] = truth["effects"]
    assert effect["effect"] == "accelerometer_bias"
    own = before.accelerometer_labels.index(effect["sensors"][0])
    moved = np.ptp(changed.specific_force - before.specific_force, axis=0).max(axis=1) > 1e-12
    error = (changed.specific_force - before.specific_force)[0]
    shown = error[own] / [1e-3, 2e-3, 4e-3]
    assert np.linalg.norm(shown) == pytest.approx(2) and not moved.any()
    assert np.count_nonzero(error.any(axis=1)) == 1
    np.testing.assert_array_equal(changed.angular_rate, before.angular_rate)
    assert {hide(before, document, s)[1]["effects"][0]["sensors"][0] for s in range(9)} > {"1"}
