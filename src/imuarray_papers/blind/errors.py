"""Errors of the sensors' mean: bias, scale, axes, curvature, place; of all sensors; and unknown.

u is the true specific force at a triad and w the true angular rate, at the sensor's own instants.
The drawn entries have the sd ``size``; see `change.effect`, and `change.error_of`: errors are given
the value drawn and a `Field` x at the affected sensors. For ``gauge_`` effects, which all sensors
share, the sensors asked for are ignored.
"""

import numpy as np

from imuarray_papers.blind.change import (
    UNIT_FORCE,
    UNIT_RATE,
    UNITS,
    Parameter,
    altered,
    effect,
    entries,
    error_of,
    kind_names,
    of_kinds,
    spread,
    which_kinds,
)
from imuarray_papers.blind.scene import ACCELEROMETER_RAIL, GYROSCOPE_RAIL, Pair

DEGREE = float(np.radians(1.0))
GRAVITY = 9.80665  # m/s^2
# What a drift of amplitude 1 adds up to in the course of a recording.
DRIFTS = 0.1, 0.3 * DEGREE
UNLIKE = 0.04  # of an axis' place in its chip, from one chip to the other: 15 of 360 um
WARMING = 0.05, 0.1 * DEGREE  # the same of a board that warms up
COMMON = {"everywhere": True, "scalable": False}


def applied(matrices: np.ndarray, vectors: np.ndarray) -> np.ndarray:
    """Matrices (n, 3, 3) times vectors (T, n, 3)."""
    return np.einsum("kij,tkj->tki", matrices, vectors)


def matrices(rng, sensors, size) -> np.ndarray:
    """Normal matrices with entries of sd ``size``, (n, 3, 3)."""
    return size * rng.standard_normal((len(sensors), 3, 3))


def _off_diagonal(rng, sensors, size) -> np.ndarray:
    """Matrices (n, 3, 3) without diagonal."""
    return matrices(rng, sensors, size) * (1 - np.eye(3))


error_of("accelerometer_bias", "force", "bias", UNIT_FORCE, 0.01, 0.1, lambda b, x: b)
error_of("accelerometer_scale", "force", "scale", "1", 1e-3, 0.03, lambda c, x: c * x.force)
error_of(
    "accelerometer_misalignment", "force", "misalignment", "1", 1e-3, 0.02,
    lambda M, x: applied(M, x.force), _off_diagonal,
)  # fmt: skip
error_of(
    "accelerometer_nonlinearity", "force", "curvature", "s2 m-1", 0.0015 / ACCELEROMETER_RAIL,
    0.005 / ACCELEROMETER_RAIL, lambda c, x: c * x.force**2,
)  # fmt: skip


@effect("m", 1e-4, 1.5e-3, from_readings=False)
def size_effect(scene, rng, sensors, size):
    """Axis i of triad k sits at r_k + d_k,i; size in metres; value (n, axis i, 3).

    A triad's place r_k is the mean of its axes' places: nothing else is measured of it.
    If all are chosen, half the time each chip is made alike: its axes' places, in the chip, are
    the same nine numbers but for `UNLIKE` of them.
    """
    arms = matrices(rng, sensors, size)
    alike = len(sensors) == scene.accelerometers and rng.random() < 0.5
    if alike:
        arms = size * rng.standard_normal((3, 3)) + UNLIKE * arms
        turned = np.einsum("kij,kaj->kai", scene.array.turns, arms)
        # which of its axes lies along each of the array's
        arms = np.einsum("kia,kaj->kij", np.abs(scene.array.turns), turned)
    arms = np.sqrt(1.5) * (arms - arms.mean(axis=1, keepdims=True))  # of the same size
    said = {"lever_arm": Parameter(arms, "m"), "alike": Parameter(bool(alike))}
    return {"parameters": said, "force_error": lambda field: apart(arms, field.of(sensors))}


def apart(arms, x) -> np.ndarray:
    """Specific force that axes at ``arms`` (n, axis, 3) m from their triads add, (T, n, 3)."""
    seen = [x.states.lever(arms[:, axis])[..., axis] for axis in range(3)]
    return np.stack(seen, axis=-1)


error_of("gyroscope_bias", "rate", "bias", UNIT_RATE, 0.01 * DEGREE, DEGREE, lambda b, x: b)
error_of("gyroscope_scale", "rate", "scale", "1", 1e-3, 0.03, lambda c, x: c * x.rate)
error_of(
    "gyroscope_misalignment", "rate", "misalignment", "1", 1e-3, 0.02,
    lambda M, x: applied(M, x.rate), _off_diagonal,
)  # fmt: skip
error_of(
    "gyroscope_g_sensitivity", "rate", "sensitivity", "rad s m-1", 0.03 * DEGREE / GRAVITY,
    0.3 * DEGREE / GRAVITY, lambda G, x: applied(G, x.force_at_gyroscopes), matrices,
)  # fmt: skip
error_of(
    "gyroscope_nonlinearity", "rate", "curvature", "s rad-1", 0.0006 / GYROSCOPE_RAIL,
    0.002 / GYROSCOPE_RAIL, lambda c, x: c * x.rate**2,
)  # fmt: skip


@effect("0.1 m s-2 or 0.3 deg s-1", 0.33, 3.3)
def bias_drift(scene, rng, sensors, size):
    """u + b f(t), w + b f(t) with f from 0 to 1: a line, or a warm-up 1 - exp(-t / tau).

    Never of all sensors of both kinds: they would follow one temperature.
    """
    kinds = which_kinds(rng)
    if all(kinds) and len(sensors) == scene.accelerometers:
        kinds = (True, False)
    warming = rng.random() < 0.5
    constant = rng.uniform(0.15, 0.4) * scene.duration
    past = scene.time - scene.time[0]
    course = 1 - np.exp(-past / constant) if warming else past
    said = {"form": Parameter("exponential" if warming else "linear")}
    if warming:
        said["time_constant"] = Parameter(constant, "s")
    return _drifting(rng, sensors, [size * end for end in DRIFTS], kinds, course, said)


@effect("0.05 m s-2 and 0.1 deg s-1", 0.2, 2.0, everywhere=True)
def warm_up(scene, rng, sensors, size):
    """u + b T(t), w + b T(t): all sensors' offsets follow one temperature T from 0 to 1.

    The chips warm the board (a first-order lag), and the board what holds it (a slower one).
    """
    past = scene.time - scene.time[0]
    board, holder = rng.uniform([0.1, 0.5], [0.4, 1.5]) * scene.duration
    warmth = 0.8 * (1 - np.exp(-past / board)) + 0.2 * (1 - np.exp(-past / holder))
    said = {"time_constants": Parameter([float(board), float(holder)], "s")}
    return _drifting(rng, sensors, [size * end for end in WARMING], (True, True), warmth, said)


def _drifting(rng, sensors, sizes, kinds, course, said, scales: bool = False) -> dict:
    """Parts of a `Change`: of the chosen kinds offsets, or scales, of ``sizes`` at a course's end.

    ``course`` (T,), of any height.
    """
    parts, shape = {"parameters": said}, (course / course[-1])[:, None, None]
    for what, unit, size, chosen in zip(("force", "rate"), UNITS, sizes, kinds, strict=True):
        end = entries(rng, sensors, size)
        if chosen:
            name, unit = ("scale_at_end", "1") if scales else ("drift", unit)
            said[f"{what}_{name}"] = Parameter(end, unit)
            parts[f"{what}_error"] = lambda field, end=end, what=what: (
                end * shape * (getattr(field.of(sensors), what) if scales else 1.0)
            )
    return parts


@effect("1", 1.0, 1.0, scalable=False)
def axis_swap(scene, rng, sensors, size):
    """Two axes exchanged or a sign wrong; the amplitude means nothing."""
    kinds = which_kinds(rng)
    tables = np.stack([_wrong_axes(rng) for _ in sensors])
    rules = of_kinds(kinds, lambda values: applied(tables, values))
    said = {"reading_from_true": Parameter(tables), "of": kind_names(kinds)}
    return {"parameters": said, "relabel": altered(sensors, rules)}


def _wrong_axes(rng) -> np.ndarray:
    """A signed permutation (3, 3): two axes exchanged, or one reversed."""
    table = np.eye(3)
    if rng.random() < 0.5:
        return table[[[1, 0, 2], [2, 1, 0], [0, 2, 1]][rng.integers(3)]]
    table[(axis := rng.integers(3)), axis] = -1.0
    return table


@effect("m", 1e-4, 3e-3, from_readings=False)
def position_shift(scene, rng, sensors, size):
    """r_k + d_k from one instant on; size in metres; the instant is the same for all."""
    shift = entries(rng, sensors, size)
    instant = scene.time[0] + rng.uniform(0.25, 0.75) * scene.duration
    later = (scene.time >= instant)[:, None, None]
    said = {"shift": Parameter(shift, "m"), "instant": Parameter(float(instant), "s")}
    return {
        "parameters": said,
        "force_error": lambda field: np.where(later, field.of(sensors).states.lever(shift), 0.0),
    }


def _signed(rng, sensors, size) -> float:
    """One amplitude for all, of either sign."""
    return size * float(rng.choice([-1.0, 1.0]))


# the same as a dilation r / (1 + c)^2, and (1 + c) r
error_of(
    "gauge_gyroscope_scale", "rate", "scale", "1", 1e-3, 0.03, lambda c, x: c * x.rate, _signed,
    **COMMON,
)  # fmt: skip
error_of(
    "gauge_accelerometer_scale", "force", "scale", "1", 1e-3, 0.03, lambda c, x: c * x.force,
    _signed, **COMMON,
)  # fmt: skip


@effect("s", 1e-4, 5e-3, **COMMON)
def gauge_sensor_delay(scene, rng, sensors, size):
    """All IMUs sample at t + tau: another motion, as free as the first."""
    delay = _signed(rng, sensors, size)
    ages = spread(scene, sensors, delay)
    return {"parameters": {"delay": Parameter(delay, "s")}, "ages": Pair(ages, ages)}


# all part of s: the same b on all triads; axis i of every triad at r_k + d_i
error_of(
    "gauge_accelerometer_bias", "force", "bias", UNIT_FORCE, 0.01, 0.1, lambda b, x: b,
    lambda rng, sensors, size: size * rng.standard_normal(3), **COMMON,
)  # fmt: skip
error_of(
    "gauge_lever_arm", "force", "lever_arm", "m", 1e-4, 1.5e-3, lambda d, x: apart(d[None], x),
    lambda rng, sensors, size: size * rng.standard_normal((3, 3)), from_readings=False, **COMMON,
)  # fmt: skip
error_of(
    "outside_cubic", "force", "coefficient", "s4 m-2", 0.001 / ACCELEROMETER_RAIL**2,
    0.01 / ACCELEROMETER_RAIL**2, lambda c, x: c * x.force**3,
)  # fmt: skip
# the triad sits at r_k + K u_k, quasi-statically
error_of(
    "outside_flexible_board", "force", "compliance", "s2", 1e-6, 3e-5,
    lambda K, x: x.states.lever(applied(K, x.force)), matrices, from_readings=False,
)  # fmt: skip
# c |w'|^2
error_of(
    "outside_vibration_rectification", "force", "coefficient", "m s2", 1e-7, 3e-6,
    lambda c, x: c * (x.states.acceleration**2).sum(axis=-1, keepdims=True), from_readings=False,
)  # fmt: skip


@effect("m s-1", 1e-3, 0.05)
def outside_cross_talk(scene, rng, sensors, size):
    """A share of another IMU's gyroscope reading leaks into the accelerometer.

    Leaked into a gyroscope it would be a scale error or a misalignment, as all gyroscopes measure
    the same rate, and the catalogue holds those. size in m/s^2 per rad/s.
    """
    others = [int(rng.choice([j for j in range(scene.accelerometers) if j != k])) for k in sensors]
    leak = matrices(rng, sensors, size)
    said = {"leak": Parameter(leak, "m s-1"), "from": Parameter(others, "index")}
    return {"parameters": said, "force_error": lambda field: applied(leak, field.rate[:, others])}


@effect(UNIT_FORCE, 0.02, 0.3)
def outside_hysteresis(scene, rng, sensors, size):
    """u + h z, z a first-order lag behind the sign of du/dt; size in m/s^2."""
    from scipy.signal import lfilter  # slow to import, and every run of Snakemake imports this

    depth = entries(rng, sensors, size)
    lag = float(np.exp(rng.uniform(np.log(0.02), np.log(0.1))))
    keep = np.exp(-1 / (lag * scene.sampling_rate))

    def error(field):
        rising = np.sign(np.gradient(field.of(sensors).force, axis=0))
        return depth * lfilter([1 - keep], [1.0, -keep], rising, axis=0)

    said = {"depth": Parameter(depth, UNIT_FORCE), "lag": Parameter(lag, "s")}
    return {"parameters": said, "force_error": error}


@effect("1", 1e-3, 0.03)
def outside_scale_drift(scene, rng, sensors, size):
    """(1 + c_i t / T) on accelerometers, gyroscopes or both; size at the end."""
    course = scene.time - scene.time[0]
    return _drifting(rng, sensors, (size, size), which_kinds(rng), course, {}, scales=True)
