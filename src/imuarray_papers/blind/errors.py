"""Errors of the sensors' mean: bias, scale, axes, curvature, place; of all sensors; and unknown.

u is the true specific force at a triad and w the true angular rate, at the sensor's own instants.
The drawn entries have the sd ``size``; see `change.error_of` and `change.effect`. For ``gauge_``
effects, which all sensors share, the sensors asked for are ignored.
"""

import numpy as np

from imuarray_papers.blind.change import (
    UNIT_FORCE,
    UNIT_RATE,
    Parameter,
    altered,
    applied,
    effect,
    entries,
    error_of,
    kind_names,
    matrices,
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


def _off_diagonal(rng, sensors, size) -> np.ndarray:
    """Matrices (n, 3, 3) without diagonal."""
    return matrices(rng, sensors, size) * (1 - np.eye(3))


@error_of("force", "bias", UNIT_FORCE, 0.01, 0.1)
def accelerometer_bias(bias, field, sensors):
    """u + b; size in m/s^2."""
    return bias


@error_of("force", "scale", "1", 1e-3, 0.03)
def accelerometer_scale(scale, field, sensors):
    """(1 + c_i) u_i."""
    return scale * field.force[:, sensors]


@error_of("force", "misalignment", "1", 1e-3, 0.02, _off_diagonal)
def accelerometer_misalignment(matrix, field, sensors):
    """u + M u, M without diagonal."""
    return applied(matrix, field.force[:, sensors])


@error_of(
    "force", "curvature", "s2 m-1", 0.0015 / ACCELEROMETER_RAIL, 0.005 / ACCELEROMETER_RAIL
)  # fmt: skip
def accelerometer_nonlinearity(curvature, field, sensors):
    """u_i + c_i u_i^2; size in s^2/m."""
    return curvature * field.force[:, sensors] ** 2


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
    said = {"lever_arm": Parameter(arms, "m"), "alike": Parameter(bool(alike), "1")}
    error = {"force_error": lambda field: apart(arms, field, list(sensors))}
    return {"parameters": said, **error}


def apart(arms, field, sensors) -> np.ndarray:
    """Specific force that axes at ``arms`` (n, axis, 3) m from their triads add, (T, n, 3)."""
    seen = [field.lever(arms[:, axis], sensors)[..., axis] for axis in range(3)]
    return np.stack(seen, axis=-1)


@error_of("rate", "bias", UNIT_RATE, 0.01 * DEGREE, DEGREE)
def gyroscope_bias(bias, field, sensors):
    """w + b; size in rad/s."""
    return bias


@error_of("rate", "scale", "1", 1e-3, 0.03)
def gyroscope_scale(scale, field, sensors):
    """(1 + c_i) w_i."""
    return scale * field.rate[:, sensors]


@error_of("rate", "misalignment", "1", 1e-3, 0.02, _off_diagonal)
def gyroscope_misalignment(matrix, field, sensors):
    """w + M w, M without diagonal."""
    return applied(matrix, field.rate[:, sensors])


@error_of(
    "rate", "sensitivity", "rad s m-1", 0.03 * DEGREE / GRAVITY, 0.3 * DEGREE / GRAVITY, matrices
)  # fmt: skip
def gyroscope_g_sensitivity(matrix, field, sensors):
    """w + G u, u the specific force at the same IMU; size in rad/s per m/s^2."""
    return applied(matrix, field.force_at_gyroscopes[:, sensors])


@error_of("rate", "curvature", "s rad-1", 0.0006 / GYROSCOPE_RAIL, 0.002 / GYROSCOPE_RAIL)
def gyroscope_nonlinearity(curvature, field, sensors):
    """w_i + c_i w_i^2; size in s/rad."""
    return curvature * field.rate[:, sensors] ** 2


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
    shape = 1 - np.exp(-past / constant) if warming else past
    said = {"form": Parameter("exponential" if warming else "linear", "1")}
    if warming:
        said["time_constant"] = Parameter(constant, "s")
    ends = [size * unit for unit in DRIFTS]
    return _drifting(rng, sensors, ends, kinds, (shape / shape[-1])[:, None, None], said)


@effect("0.05 m s-2 and 0.1 deg s-1", 0.2, 2.0, everywhere=True)
def warm_up(scene, rng, sensors, size):
    """u + b T(t), w + b T(t): all sensors' offsets follow one temperature T from 0 to 1.

    The chips warm the board (a first-order lag), and the board what holds it (a slower one).
    """
    past = scene.time - scene.time[0]
    board, holder = rng.uniform([0.1, 0.5], [0.4, 1.5]) * scene.duration
    warmth = 0.8 * (1 - np.exp(-past / board)) + 0.2 * (1 - np.exp(-past / holder))
    said = {"time_constants": Parameter([float(board), float(holder)], "s")}
    course = (warmth / warmth[-1])[:, None, None]
    ends = [size * unit for unit in WARMING]
    return _drifting(rng, sensors, ends, (True, True), course, said)


def _drifting(rng, sensors, sizes, kinds, course, said) -> dict:
    """Parts of a `Change`: offsets of the chosen kinds along a course (T, n or 1, 1)."""
    parts, names = {"parameters": said}, (("force", UNIT_FORCE), ("rate", UNIT_RATE))
    for (what, unit), size, chosen in zip(names, sizes, kinds, strict=True):
        end = entries(rng, sensors, size)
        if chosen:
            said[f"{what}_drift"] = Parameter(end, unit)
            parts[f"{what}_error"] = lambda field, end=end: end * course
    return parts


@effect("1", 1.0, 1.0, scalable=False)
def axis_swap(scene, rng, sensors, size):
    """Two axes exchanged or a sign wrong; the amplitude means nothing."""
    kinds = which_kinds(rng)
    tables = np.stack([_wrong_axes(rng) for _ in sensors])
    rules = of_kinds(kinds, lambda values: applied(tables, values))
    said = {"reading_from_true": Parameter(tables, "1"), "of": kind_names(kinds)}
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
        "force_error": lambda field: np.where(later, field.lever(shift, sensors), 0.0),
    }


def _signed(rng, sensors, size) -> float:
    """One amplitude for all, of either sign."""
    return size * float(rng.choice([-1.0, 1.0]))


@error_of("rate", "scale", "1", 1e-3, 0.03, _signed, **COMMON)
def gauge_gyroscope_scale(scale, field, sensors):
    """(1 + c) w on all axes of all gyroscopes; the same as a dilation r / (1 + c)^2."""
    return scale * field.rate


@error_of("force", "scale", "1", 1e-3, 0.03, _signed, **COMMON)
def gauge_accelerometer_scale(scale, field, sensors):
    """(1 + c) u on all axes of all accelerometers; the same as a dilation (1 + c) r."""
    return scale * field.force


@effect("s", 1e-4, 5e-3, **COMMON)
def gauge_sensor_delay(scene, rng, sensors, size):
    """All IMUs sample at t + tau: another motion, as free as the first."""
    delay = _signed(rng, sensors, size)
    ages = spread(scene, sensors, delay)
    return {"parameters": {"delay": Parameter(delay, "s")}, "ages": Pair(ages, ages)}


@error_of(
    "force", "bias", UNIT_FORCE, 0.01, 0.1,
    lambda rng, sensors, size: size * rng.standard_normal(3), **COMMON,
)  # fmt: skip
def gauge_accelerometer_bias(bias, field, sensors):
    """u + b, the same b on all triads: part of s."""
    return bias


@error_of(
    "force", "lever_arm", "m", 1e-4, 1.5e-3,
    lambda rng, sensors, size: size * rng.standard_normal((3, 3)), from_readings=False, **COMMON,
)  # fmt: skip
def gauge_lever_arm(arms, field, sensors):
    """Axis i of every triad sits at r_k + d_i: one specific force for all, part of s."""
    return apart(np.broadcast_to(arms, (len(sensors), 3, 3)), field, sensors)


@error_of(
    "force", "coefficient", "s4 m-2", 0.001 / ACCELEROMETER_RAIL**2, 0.01 / ACCELEROMETER_RAIL**2
)  # fmt: skip
def outside_cubic(coefficient, field, sensors):
    """u_i + c_i u_i^3; size in (m/s^2)^-2."""
    return coefficient * field.force[:, sensors] ** 3


@error_of("force", "compliance", "s2", 1e-6, 3e-5, matrices, from_readings=False)
def outside_flexible_board(compliance, field, sensors):
    """The triad sits at r_k + K u_k, quasi-statically; size in metres per m/s^2."""
    return field.lever(applied(compliance, field.force[:, sensors]), sensors)


@error_of("force", "coefficient", "m s2", 1e-7, 3e-6, from_readings=False)
def outside_vibration_rectification(coefficient, field, sensors):
    """u + c |w'|^2; size in m/s^2 per (rad/s^2)^2."""
    shaking = field.states.columns(sensors).acceleration
    return coefficient * (shaking**2).sum(axis=-1, keepdims=True)


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
        rising = np.sign(np.gradient(field.force[:, list(sensors)], axis=0))
        return depth * lfilter([1 - keep], [1.0, -keep], rising, axis=0)

    said = {"depth": Parameter(depth, UNIT_FORCE), "lag": Parameter(lag, "s")}
    return {"parameters": said, "force_error": error}


@effect("1", 1e-3, 0.03)
def outside_scale_drift(scene, rng, sensors, size):
    """(1 + c_i t / T) on accelerometers, gyroscopes or both; size at the end."""
    kinds = which_kinds(rng)
    past = scene.time - scene.time[0]
    shape = (past / past[-1])[:, None, None]
    parts = {"parameters": {}}
    for what, chosen in zip(("force", "rate"), kinds, strict=True):
        end = entries(rng, sensors, size)
        if chosen:
            parts["parameters"][f"{what}_scale_at_end"] = Parameter(end, "1")
            parts[f"{what}_error"] = lambda field, end=end, what=what: (
                end * shape * getattr(field, what)[:, list(sensors)]
            )
    return parts
