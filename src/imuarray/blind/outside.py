"""Effects that the catalogue does not hold: the right answer is "unexplained"."""

import numpy as np

from imuarray.blind.change import (
    UNIT_FORCE,
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
from imuarray.blind.noise import level_divergence
from imuarray.blind.scene import ACCELEROMETER_RAIL, Pair


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
    return {
        "parameters": said,
        "force_error": lambda field: applied(leak, field.rate[:, others]),
    }


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


@effect("s", 5e-5, 3e-4)
def outside_timing_jitter(scene, rng, sensors, size):
    """Each sample of an IMU at t + a white random age; size is its sd in seconds."""
    jitter = size * rng.standard_normal((len(scene.time), len(sensors)))
    ages = spread(scene, sensors, jitter)
    return {"parameters": {"jitter_sd": Parameter(size, "s")}, "ages": Pair(ages, ages)}


@effect("1", 0.2, 1.0, limit=20.0)
def outside_rate_noise(scene, rng, sensors, size):
    """Noise exp(size |w| / rms |w|) times the declared one.

    Not 1 + size |w|: its shape in time, level apart, can not grow past a bound.
    """
    kinds = which_kinds(rng)
    turning = np.linalg.norm(scene.ideal().rate[:, list(sensors)], axis=-1)
    relative = turning / np.sqrt(np.mean(turning**2))
    gain = spread(scene, sensors, np.exp(size * relative), 1.0)
    own = gain[:, list(sensors)]
    # against the constant level of the same mean square: the level is another effect's
    shape = own / np.sqrt((own**2).mean(axis=0))
    return {
        "parameters": {"growth": Parameter(size, "1"), "of": kind_names(kinds)},
        "gain": of_kinds(kinds, gain),
        "divergence": lambda samples: level_divergence(shape) * sum(kinds) * samples,
    }


@effect("1", 3.0, 10.0, scalable=False)
def outside_quantisation(scene, rng, sensors, size):
    """Readings rounded to multiples of an LSB of ``size`` times the declared noise."""
    kinds = which_kinds(rng)

    def rounding(step, limit):
        def coarse(values):
            rounded = np.clip(step * np.round(values / step), -limit, limit)
            # the rail itself is a code
            return np.where(np.abs(values) >= limit, values, rounded)

        return coarse

    steps = zip(scene.noise, scene.limits, kinds, strict=True)
    rules = [rounding(size * sd, limit) if chosen else None for sd, limit, chosen in steps]
    said = {"lsb_in_noise_sd": Parameter(size, "1"), "of": kind_names(kinds)}
    return {"parameters": said, "after": altered(sensors, Pair(*rules))}
