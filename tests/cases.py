"""Small arrays and recordings that several tests use."""

import numpy as np

from imuarray.geometry import Array
from imuarray.model import ArrayModel, Noise
from imuarray.motion import normal_motion

SHAPE = np.array(
    [
        [0.0, 0.0, 0.0],
        [0.021, 0.002, -0.001],
        [-0.001, 0.019, 0.003],
        [0.017, 0.020, 0.002],
        [0.008, 0.009, -0.006],
        [-0.012, 0.004, 0.005],
    ]
)


def small_array(accelerometers=5, gyroscopes=2) -> Array:
    """The first few of six triads some 2 cm apart, not in one plane."""
    labels = tuple(str(k + 1) for k in range(accelerometers))
    return Array(SHAPE[:accelerometers].copy(), labels, gyroscopes, "small")


def random_covariance(rng, size, sd) -> np.ndarray:
    """A covariance (size, size) with sds near ``sd`` and strong correlations."""
    raw = rng.standard_normal((size, 2 * size))
    return sd**2 * (raw @ raw.T) / (2 * size)


def noises(rng, accelerometers, gyroscopes) -> dict[str, Noise]:
    """One `Noise` of each form an accelerometer noise can take."""
    count = accelerometers
    forms = {
        "isotropic": 0.04,
        "per_triad": rng.uniform(0.02, 0.2, count),
        "triad_covariances": np.stack([random_covariance(rng, 3, 0.05) for _ in range(count)]),
        "crosstalk": random_covariance(rng, 3 * count, 0.05),
    }
    return {name: Noise.of(count, gyroscopes, form, 0.02) for name, form in forms.items()}


def simulate(rng, model: ArrayModel, samples, rate_sd=10.0, acceleration_sd=300.0, noise=True):
    """(motion, specific_force (T, A, 3), angular_rate (T, G, 3)) at the array's positions."""
    motion = normal_motion(rng, (samples,), rate_sd, acceleration_sd, 20.0)
    return motion, *measure(rng, model, motion, noise)


def measure(rng, model, motion, noise=True):
    """Measurements of ``motion``, (T, A, 3) and (T, G, 3), written out without the package."""
    r = model.array.relative
    rate, acceleration = motion.angular_rate[:, None], motion.angular_acceleration[:, None]
    force = np.cross(rate, np.cross(rate, r)) + np.cross(acceleration, r)
    force = force + motion.specific_force[:, None]
    turning = np.repeat(rate, model.array.gyroscopes, axis=1)
    if noise:
        first, second = model.noise.draw(rng, (len(force),))
        return force + first, turning + second
    return force, turning


def diagnosis(effect, parameters, positions, noise, span, sd=0.0, origin=0.0) -> dict:
    """A diagnosis.json that says so: ``parameters`` {name: (value, sd)} of one effect.

    ``positions`` (A, 3) m of IMUs 1, 2, ... with one ``sd``; ``noise`` sds (m/s^2, rad/s); s.
    """
    labels = [str(k + 1) for k in range(len(positions))]
    kinds = zip(("accelerometer", "gyroscope"), noise, strict=True)
    named = {k: {"value": value, "sd": sd, "unit": "1"} for k, (value, sd) in parameters.items()}
    return {
        "extended": {
            "positions_m": positions.tolist(),
            "positions_sd_m": np.full(positions.shape, sd).tolist(),
        },
        "causes": [{"effect": effect, "parameters": named}],
        "noise_sd": {kind: {label: {"sd": size} for label in labels} for kind, size in kinds},
        "clock": {"origin_s": origin, "span_s": span},
    }
