"""A scene: one array, one smooth motion, the true positions; what ideal sensors would read.

The rigid-body formula is written out here once more, on purpose: an injector that shared the
measurement model with the diagnosis would share its mistakes too.
"""

from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple, Self

import numpy as np

from imuarray.geometry import Array, mimu4444, mimu4444_corners
from imuarray.geometry.boards import UNDERSIDE_ROTATION
from imuarray.motion import SmoothMotion, hand_twisting

GYROSCOPE_RAIL = np.radians(2000.0)  # rad/s
ACCELEROMETER_RAIL = 156.9  # m/s^2, 16 g
POSITION_ERROR_SD = 5e-4  # m, between nominal and true positions


class Pair(NamedTuple):
    """Something for the accelerometers and the same for the gyroscopes."""

    force: np.ndarray | None  # (T, A, 3) m/s^2
    rate: np.ndarray | None  # (T, G, 3) rad/s


class States(NamedTuple):
    """Motion of the reference triad at (T, K) instants (K = 1: the same for all sensors)."""

    rate: np.ndarray  # w, (T, K, 3) rad/s
    acceleration: np.ndarray  # w', (T, K, 3) rad/s^2
    force: np.ndarray  # s, (T, K, 3) m/s^2

    def columns(self, sensors) -> Self:
        """The states at the instants of some sensors, (T, n, 3)."""
        if self.rate.shape[1] == 1:
            return self
        return States(*(x[:, list(sensors)] for x in self))

    def lever(self, arms: np.ndarray) -> np.ndarray:
        """w x (w x r) + w' x r for arms r (K, 3) or (T, K, 3) in metres; (T, K, 3) m/s^2."""
        inner = np.cross(self.rate, arms)
        return np.cross(self.rate, inner) + np.cross(self.acceleration, arms)


class Field(NamedTuple):
    """True quantities at each sensor's own instants, for the errors to be computed from."""

    force: np.ndarray  # u_k, (T, A, 3) m/s^2
    rate: np.ndarray  # w, (T, G, 3) rad/s
    force_at_gyroscopes: np.ndarray  # u_k of each IMU at its gyroscope's instants, (T, G, 3) m/s^2
    states: States | None  # at the accelerometers' instants; None of a measured recording

    def of(self, sensors) -> Self:
        """The quantities of some sensors, (T, n, 3)."""
        parts = (x[:, list(sensors)] for x in self[:3])
        return Field(*parts, self.states and self.states.columns(sensors))


def _waves(waves, time: np.ndarray, orders) -> list[np.ndarray]:
    """Derivatives of a sum of sinusoids at ``time`` (T,), each (T, 3).

    Equal to ``SmoothMotion.at`` (a test holds them together); one sine and one cosine a wave
    instead of thirty make an IMU with a clock of its own affordable.
    """
    angle = np.multiply.outer(time, waves.frequency)
    sine, cosine = np.sin(angle), np.cos(angle)
    found = []
    for order in orders:
        gain = waves.amplitude * waves.frequency[:, None] ** order
        turned = waves.phase + order * np.pi / 2
        found.append(sine @ (gain * np.cos(turned)) + cosine @ (gain * np.sin(turned)))
    return found


@dataclass(frozen=True, eq=False)
class Scene:
    """The motion and the board before any effect is injected.

    Attributes
    ----------
    array : Array
        Nominal geometry; as many gyroscopes as accelerometers.
    sampling_rate : float, Hz
    duration : float, seconds
    motion : SmoothMotion
    positions : ndarray (A, 3), metres
        True, relative to the reference triad; row 0 is zero.
    noise, limits : tuple of two floats
        Declared noise and ranges of accelerometers (m/s^2) and gyroscopes (rad/s); ranges may be
        infinite.
    position_prior_sd : float, metres
    """

    array: Array
    sampling_rate: float
    duration: float
    motion: SmoothMotion
    positions: np.ndarray
    limits: tuple[float, float]
    noise: tuple[float, float] = (0.04, float(np.radians(0.06)))
    position_prior_sd: float = 3e-3
    measured = False  # a class attribute: see `measured.MeasuredScene`

    @classmethod
    def draw(
        cls, rng, imus: int = 8, sampling_rate=125.0, duration=24.0, rails: bool = False
    ) -> Self:
        """Draw motion and true positions; ``imus`` is 8 or 32, ``rails`` wants 2000 deg/s, 16 g."""
        boards = {8: mimu4444_corners, 32: mimu4444}
        if imus not in boards:
            raise ValueError(f"imus: expected 8 or 32, found {imus}")
        if not 62.5 <= sampling_rate <= 500:
            raise ValueError(f"sampling_rate: expected 62.5 to 500 Hz, found {sampling_rate}")
        array = boards[imus]()
        under = array.positions[:, 2] < 0
        axes = np.where(under[:, None, None], UNDERSIDE_ROTATION, np.eye(3))
        array = replace(array, axes=axes)
        error = POSITION_ERROR_SD * rng.standard_normal((imus, 3))
        error[0] = 0.0
        limits = (ACCELEROMETER_RAIL, GYROSCOPE_RAIL) if rails else (np.inf, np.inf)
        motion = _draw_motion(
            rng, np.arange(round(duration * sampling_rate)) / sampling_rate, rails
        )
        return cls(array, sampling_rate, duration, motion, array.relative + error, limits)

    @cached_property
    def time(self) -> np.ndarray:
        """Instants at which the host reads, (T,) seconds."""
        return np.arange(round(self.duration * self.sampling_rate)) / self.sampling_rate

    @property
    def accelerometers(self) -> int:
        """Number A of accelerometer triads, and of gyroscope triads."""
        return len(self.positions)

    def _states_at(self, time: np.ndarray) -> list[np.ndarray]:
        """w, w', s at ``time`` (T,), each (T, 3)."""
        return _waves(self.motion.rotation, time, (0, 1)) + _waves(self.motion.force, time, (0,))

    @cached_property
    def nominal(self) -> States:
        """Motion at the host's instants, (T, 1, 3)."""
        return States(*(x[:, None] for x in self._states_at(self.time)))

    def states(self, ages: np.ndarray | None) -> States:
        """Exact motion ``ages`` (T, K) seconds after the host's instants; None: at these."""
        if ages is None or not ages.any():
            return self.nominal
        columns = [
            self._states_at(self.time + age) if age.any() else [x[:, 0] for x in self.nominal]
            for age in ages.T
        ]
        return States(*(np.stack(x, axis=1) for x in zip(*columns, strict=True)))

    def ideal(self) -> Pair:
        """Readings without noise or error: u_k (T, A, 3) m/s^2 and w (T, G, 3) rad/s."""
        here = self.field(Pair(None, None))
        return Pair(here.force, here.rate)

    def field(self, ages: Pair) -> Field:
        """True quantities ``ages`` (T, A) and (T, G) s after the host's instants, None: at them."""
        states = self.states(ages.force)
        same = ages.force is ages.rate or np.array_equal(ages.force, ages.rate)
        turning = states if same else self.states(ages.rate)
        force = force_at(states, self.positions)
        rate = np.broadcast_to(turning.rate, force.shape)
        return Field(force, rate, force if same else force_at(turning, self.positions), states)


def force_at(states: States, positions: np.ndarray) -> np.ndarray:
    """u_k = w x (w x r_k) + w' x r_k + s, (T, A, 3) m/s^2."""
    return states.lever(positions) + states.force


def _draw_motion(rng, time: np.ndarray, rails: bool) -> SmoothMotion:
    """Twisting by hand; with ``rails`` a gyroscope is at its rail in 2 to 8 % of the samples."""
    rate = np.radians(rng.uniform(400.0, 700.0))
    force = rng.uniform(8.0, 12.0)
    bandwidth = rng.uniform(3.0, 5.0)
    share = rng.uniform(0.02, 0.08)
    seed = rng.integers(2**63)
    motion = hand_twisting(np.random.default_rng(seed), rate, force, bandwidth)
    if not rails:
        return motion
    # the motion is linear in its sd, so the quantile says by how much to turn faster
    peak = np.abs(_waves(motion.rotation, time, (0,))[0]).max(axis=1)
    rate *= GYROSCOPE_RAIL / np.quantile(peak, 1 - share)
    return hand_twisting(np.random.default_rng(seed), rate, force, bandwidth)
