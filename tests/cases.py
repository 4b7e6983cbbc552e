"""Small arrays and recordings that several tests use."""

import numpy as np

from imuarray.engine.dataset import noise_variables, positions_dataset
from imuarray.geometry import Array
from imuarray.model import ArrayModel, Noise
from imuarray.model.array_model import parameter_names
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


def model():
    """Five accelerometers and gyroscopes with the noise of a good chip."""
    return ArrayModel.isotropic(small_array(5, 5), 0.04, 0.02)


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


def known(recording, model, values, sd, positions, noise, origin, span):
    """A calibration that says so: the effects' parameters (P,) with one ``sd``, positions (A, 3) m.

    ``noise`` sds (m/s^2, rad/s) of all triads; ``origin`` and ``span`` of time in s.
    """
    labels = recording.accelerometer_labels, recording.gyroscope_labels
    counts = [len(names) for names in labels]
    size = 3 * (counts[0] - 1) + len(values)
    places = positions_dataset(recording, positions, np.eye(3 * (counts[0] - 1)) * 1e-12)
    return places.assign(
        effect_parameter=("parameter", values), effect_sd=("parameter", np.full(len(values), sd)),
        whole_covariance=(("unknown", "unknown_other"), np.eye(size) * 1e-12),
        **noise_variables(Noise.of(*counts, *map(np.full, counts, noise))),
    ).assign_coords(parameter=parameter_names(model, labels)).assign_attrs(
        effects=",".join(model.effects), time_origin=origin, span=span
    )  # fmt: skip
