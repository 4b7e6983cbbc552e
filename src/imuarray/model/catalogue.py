"""The catalogue of effects that a sample's motion determines, and of those in the data.

u is the true specific force at a triad, omega the true angular rate; each function says how the
predicted measurement departs from them. Prior scales are those of consumer MEMS; ids are fixed.
"""

import numpy as np

from imuarray.model import kinematics
from imuarray.model.effects import KINDS, common_mean, data_effect, each_mean, effect
from imuarray.model.jax64 import jnp

# Rows and columns of the off-diagonal entries of a 3 x 3 matrix, row by row.
OFF_ROWS, OFF_COLUMNS = np.array([0, 0, 1, 1, 2, 2]), np.array([1, 2, 0, 2, 0, 1])
FULL_SCALE_FORCE = 157.0  # m/s^2, 16 g: non-linearity is given as a share of it
FULL_SCALE_RATE = 34.9  # rad/s, 2000 deg/s


def _skewed(vectors, entries):
    """Vectors (n, 3), each with M times it, M (n, 3, 3) of (n, 6) off-diagonal entries."""
    matrix = jnp.zeros((len(entries), 3, 3)).at[:, OFF_ROWS, OFF_COLUMNS].set(entries)
    return vectors + jnp.einsum("kij,kj->ki", matrix, vectors)


@effect(
    "accelerometer_bias", unit="m s-2", prior_sd=0.05, shape=lambda a, g: (a, 3),
    meaning="the accelerometers have an offset", against="time", own=True,
)  # fmt: skip
def accelerometer_bias(bias, instant, predicted):
    """u + b."""
    return predicted._replace(specific_force=predicted.specific_force + bias)


@effect(
    "accelerometer_scale", unit="1", prior_sd=0.01, shape=lambda a, g: (a, 3), gauge=common_mean,
    meaning="the accelerometers' axes are scaled", shown="%", against="specific force",
    resizes=True,
)  # fmt: skip
def accelerometer_scale(scale, instant, predicted):
    """(1 + c_i) u_i at each axis."""
    return predicted._replace(specific_force=(1.0 + scale) * predicted.specific_force)


@effect(
    "accelerometer_misalignment", unit="1", prior_sd=0.01, shape=lambda a, g: (a, 6),
    meaning="the accelerometers' axes are skewed", shown="rad", against="specific force",
)  # fmt: skip
def accelerometer_misalignment(entries, instant, predicted):
    """u + M u, M without diagonal: xy, xz, yx, yz, zx, zy."""
    return predicted._replace(specific_force=_skewed(predicted.specific_force, entries))


@effect(
    "accelerometer_nonlinearity", unit="s2 m-1", prior_sd=0.005 / FULL_SCALE_FORCE,
    shape=lambda a, g: (a, 3), meaning="the accelerometers' response is curved", against="reading",
)  # fmt: skip
def accelerometer_nonlinearity(curvature, instant, predicted):
    """u_i + c_i u_i^2; the prior is 0.5 % of full scale, at full scale."""
    force = predicted.specific_force
    return predicted._replace(specific_force=force + curvature * force**2)


OBLIQUE = 0.2  # of an axis, by which triads are mounted off the array's axes


def _axes_places(shape, axes):
    """The mean over triads of each axis' place; the mean place of a triad's axes: its position.

    The first of axes of the array: specific force takes it up, where all triads' are along them.
    """
    along, masks = np.round(axes), []
    if np.abs(along - axes).max() < OBLIQUE:
        for axis, coordinate in np.ndindex(3, 3):
            masks.append(along[:, axis, :, None] ** 2 * along[:, coordinate, None, :])
    for triad, coordinate in np.ndindex(shape[0], 3):
        masks.append(np.zeros(shape, bool))
        masks[-1][triad, :, coordinate] = True
    return masks


@effect(
    "size_effect", unit="m", prior_sd=5e-4, common_sd=5e-4, shape=lambda a, g: (a, 3, 3),
    sampling=True, gauge=_axes_places, against="lever arm",
    meaning="the three axes of an accelerometer sit at places of their own",
)  # fmt: skip
def size_effect(offset, instant, predicted):
    """Axis i of triad k sits at r_k + R_k d_ki, d_ki in the chip's axes.

    ``offset`` (A, axis, xyz).
    """
    here = kinematics.specific_force(instant.motion, instant.positions)

    def seen_by(axis):
        arm = jnp.einsum("kij,kj->ki", instant.axes, offset[:, axis])
        moved = kinematics.specific_force(instant.motion, instant.positions + arm)
        along = instant.axes[:, :, axis]
        return along * jnp.sum(along * (moved - here), axis=1, keepdims=True)

    change = sum(seen_by(axis) for axis in range(3))
    return predicted._replace(specific_force=predicted.specific_force + change)


@effect(
    "gyroscope_bias", unit="rad s-1", prior_sd=0.005, shape=lambda a, g: (g, 3),
    meaning="the gyroscopes have an offset", against="time", own=True,
)  # fmt: skip
def gyroscope_bias(bias, instant, predicted):
    """omega + b."""
    return predicted._replace(angular_rate=predicted.angular_rate + bias)


@effect(
    "gyroscope_misalignment", unit="1", prior_sd=0.01, shape=lambda a, g: (g, 6), shown="rad",
    meaning="the gyroscopes' axes are skewed against each other", against="angular rate",
)  # fmt: skip
def gyroscope_misalignment(entries, instant, predicted):
    """omega + M omega, M without diagonal: xy, xz, yx, yz, zx, zy."""
    return predicted._replace(angular_rate=_skewed(predicted.angular_rate, entries))


@effect(
    "gyroscope_g_sensitivity", unit="rad s m-1", prior_sd=2e-4, shape=lambda a, g: (g, 3, 3),
    meaning="the gyroscopes respond to specific force", against="specific force",
)  # fmt: skip
def gyroscope_g_sensitivity(matrix, instant, predicted):
    """omega + G u, u the specific force at the same IMU."""
    force = kinematics.specific_force(instant.motion, instant.positions)
    at = jnp.arange(len(predicted.angular_rate)) % len(force)
    change = jnp.einsum("kij,kj->ki", matrix, force[at])
    return predicted._replace(angular_rate=predicted.angular_rate + change)


@effect(
    "gyroscope_nonlinearity", unit="s rad-1", prior_sd=0.002 / FULL_SCALE_RATE,
    shape=lambda a, g: (g, 3), meaning="the gyroscopes' response is curved", against="reading",
)  # fmt: skip
def gyroscope_nonlinearity(curvature, instant, predicted):
    """omega_i + c_i omega_i^2; the prior is 0.2 % of full scale, at full scale."""
    rate = predicted.angular_rate
    return predicted._replace(angular_rate=rate + curvature * rate**2)


@effect(
    "accelerometer_rate_square", unit="m rad-2", prior_sd=5e-4, shape=lambda a, g: (a, 3),
    critical=-9.0, gauge=each_mean, smooth=True, against="angular rate",
    meaning="accelerometers read more with the square of the rate",
)  # fmt: skip
def accelerometer_rate_square(growth, instant, predicted):
    """u + c omega^2, alike in all directions of omega; the mean of all is the motion's."""
    square = jnp.sum(instant.motion.angular_rate**2)
    return predicted._replace(specific_force=predicted.specific_force + growth * square)


@effect(
    "gyroscope_curve", unit="s rad-1, s2 rad-2",
    prior_sd=(0.001 / FULL_SCALE_RATE, 0.001 / FULL_SCALE_RATE**2),
    common_sd=(0.002 / FULL_SCALE_RATE, 0.002 / FULL_SCALE_RATE**2),
    shape=lambda a, g: (g, 2), components=(("curve", "cubic"),), smooth=True, critical=-9.0,
    meaning="the gyroscopes' scale changes with the rate", against="angular rate",
)  # fmt: skip
def gyroscope_curve(curvature, instant, predicted):
    """A scale of 1 + c abs(omega_i) + d omega_i^2, alike to both sides."""
    rate = jnp.abs(predicted.angular_rate)
    scale = 1.0 + curvature[:, :1] * rate + curvature[:, 1:] * rate**2
    return predicted._replace(angular_rate=scale * predicted.angular_rate)


data_effect(
    "stale_samples", kind="readings", meaning="former samples are repeated",
    remedy="repeated readings are left out", left_out=True,
)  # fmt: skip
data_effect(
    "saturation", kind="readings", meaning="readings pile up at a rail below the declared range",
    remedy="readings at the rail are left out", left_out=True,
)  # fmt: skip
data_effect(
    "axis_swap", kind="readings", meaning="axes are exchanged or reversed",
    remedy="the axes are turned back",
)  # fmt: skip
for _kind in KINDS:
    data_effect(
        f"{_kind}_noise", kind="noise", meaning=f"the {_kind}s' noise is not the declared one",
        remedy="the noise has the size given below",
    )  # fmt: skip
data_effect(
    "heavy_tails", kind="noise", meaning="a share of the readings is far noisier than the rest",
    remedy="the noise is a mixture of two normals; the readings of the wide one are left out of the"
    " fit",
)  # fmt: skip
data_effect(
    "shock", kind="noise", meaning="motion faster than the IMUs' instants are alike shakes them",
    remedy="shaken samples are left out, and weighed down in the robust estimate",
)  # fmt: skip
data_effect(
    "coloured_noise", kind="noise", meaning="noise is autocorrelated from sample to sample",
    remedy="noise is autocorrelated, AR(1), and widths allow for it",
)  # fmt: skip
