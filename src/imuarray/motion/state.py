"""The motion of the array: at one or many instants, random draws, smooth paths.

Random motion is one independent draw a sample, as the two papers simulate it; a smooth path has
exact derivatives at any instants.
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

# Of the fields of `Motion`, in datasets: those that measurements determine, and the higher ones.
UNITS = {"angular_rate": "rad s-1", "angular_acceleration": "rad s-2", "specific_force": "m s-2"}
HIGHER_UNITS = {"angular_jerk": "rad s-3", "force_rate": "m s-3"}


class Motion(NamedTuple):
    """Motion of the array's reference triad in the array frame (paper 2021, eq. 4).

    Every field has shape (..., 3). The last two are needed only by effects that look
    a little forward or back in time (delays, clocks); they are zero where unknown.
    """

    angular_rate: np.ndarray  # omega, rad/s
    angular_acceleration: np.ndarray  # omega dot, rad/s^2
    specific_force: np.ndarray  # s, m/s^2
    angular_jerk: np.ndarray  # omega double dot, rad/s^3
    force_rate: np.ndarray  # s dot, m/s^3

    @classmethod
    def of(cls, angular_rate, angular_acceleration, specific_force) -> "Motion":
        """A motion whose higher derivatives are not known (zero)."""
        nothing = np.zeros_like(np.asarray(angular_rate, float))
        return cls(angular_rate, angular_acceleration, specific_force, nothing, nothing)

    def select(self, index) -> "Motion":
        """The samples that ``index`` picks along the first axis."""
        return Motion(*(np.asarray(field)[index] for field in self))


@dataclass(frozen=True)
class MotionEstimate:
    """Motion per sample with its convergence.

    ``motion`` fields (T, 3); ``cost`` (T,) twice the negative log likelihood up to a
    constant; ``iterations`` (T,) steps; ``converged`` (T,) bool.
    """

    motion: Motion
    cost: np.ndarray
    iterations: np.ndarray
    converged: np.ndarray


def lever(rate, acceleration, arm) -> np.ndarray:
    """Specific force that turning adds at an arm: omega x (omega x r) + omega_dot x r, (..., 3)."""
    return np.cross(rate, np.cross(rate, arm)) + np.cross(acceleration, arm)


def directions(rng: np.random.Generator, shape) -> np.ndarray:
    """Unit vectors uniform on the sphere, shape (*shape, 3)."""
    raw = rng.standard_normal((*shape, 3))
    return raw / np.linalg.norm(raw, axis=-1, keepdims=True)


def sphere_motion(rng, shape, angular_rate, angular_acceleration, specific_force) -> Motion:
    """Fixed magnitudes, directions uniform on the sphere (paper 2017, section IV).

    Parameters
    ----------
    shape : tuple
        Leading shape of the samples, (N,) or (realisations, N).
    angular_rate, angular_acceleration, specific_force : float
        Magnitudes in rad/s, rad/s^2, m/s^2.
    """
    magnitudes = (angular_rate, angular_acceleration, specific_force)
    return Motion.of(*(size * directions(rng, shape) for size in magnitudes))


def normal_motion(
    rng, shape, angular_rate_sd, angular_acceleration_sd, specific_force_sd, angular_jerk_sd=0.0,
    force_rate_sd=0.0,
) -> Motion:  # fmt: skip
    """Zero-mean normal motion, independent in time (paper 2021, section IV-A).

    Standard deviations per axis in rad/s, rad/s^2, m/s^2 (and rad/s^3, m/s^3 for the
    derivatives that only delays see).
    """
    sds = (
        angular_rate_sd, angular_acceleration_sd, specific_force_sd, angular_jerk_sd, force_rate_sd,
    )  # fmt: skip
    return Motion(*(sd * rng.standard_normal((*shape, 3)) for sd in sds))


@dataclass(frozen=True)
class _Waves:
    """A 3-vector signal: a sum of sinusoids, differentiable exactly to any order."""

    frequency: np.ndarray  # (M,) rad/s
    phase: np.ndarray  # (M, 3) rad
    amplitude: np.ndarray  # (M, 3)

    def derivative(self, time, order=0) -> np.ndarray:
        """The order-th time derivative at ``time`` (T,), shape (T, 3)."""
        angle = np.multiply.outer(time, self.frequency)[..., None] + self.phase
        gain = self.amplitude * self.frequency[:, None] ** order
        return (gain * np.sin(angle + order * np.pi / 2)).sum(axis=-2)


@dataclass(frozen=True)
class SmoothMotion:
    """A band-limited motion defined for all time; see `hand_twisting`."""

    rotation: _Waves
    force: _Waves

    def at(self, time) -> Motion:
        """Motion and its derivatives at ``time`` (T,) seconds, each field (T, 3)."""
        time = np.asarray(time, float)
        return Motion(
            self.rotation.derivative(time), self.rotation.derivative(time, 1),
            self.force.derivative(time), self.rotation.derivative(time, 2),
            self.force.derivative(time, 1),
        )  # fmt: skip


def hand_twisting(
    rng: np.random.Generator, angular_rate_sd: float, specific_force_sd: float,
    bandwidth: float = 5.0, waves: int = 40,
) -> SmoothMotion:  # fmt: skip
    """Twisting by hand: Gaussian-like angular rate and specific force, band-limited.

    Parameters
    ----------
    angular_rate_sd : float, rad/s, per axis
    specific_force_sd : float, m/s^2, per axis
    bandwidth : float, Hz
        Frequencies are uniform on (0.05, 1) x bandwidth, so the angular acceleration
        has about 0.6 x 2 pi x bandwidth x angular_rate_sd.
    """

    def draw(sd):
        frequency = 2 * np.pi * bandwidth * rng.uniform(0.05, 1.0, waves)
        phase = rng.uniform(0, 2 * np.pi, (waves, 3))
        amplitude = sd * np.sqrt(2.0 / waves) * np.sqrt(rng.exponential(1.0, (waves, 3)))
        return _Waves(frequency, phase, amplitude)

    return SmoothMotion(draw(angular_rate_sd), draw(specific_force_sd))
