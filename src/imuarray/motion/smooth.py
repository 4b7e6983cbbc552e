"""Smooth continuous motion with exact derivatives, sampled at any instants."""

from dataclasses import dataclass

import numpy as np

from imuarray.motion.state import Motion


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
            self.rotation.derivative(time),
            self.rotation.derivative(time, 1),
            self.force.derivative(time),
            self.rotation.derivative(time, 2),
            self.force.derivative(time, 1),
        )


def hand_twisting(
    rng: np.random.Generator,
    angular_rate_sd: float,
    specific_force_sd: float,
    bandwidth: float = 5.0,
    waves: int = 40,
) -> SmoothMotion:
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
