"""Motion of a rigid array from its raw readings by plain least squares, to hold readings against.

Quick and without a model of errors: what does not agree here to some per cent is no matter of
noise. Sensors that are known to be wrong can be left out.
"""

from typing import NamedTuple

import numpy as np

from imuarray.motion.state import lever
from imuarray.recording import Recording
from imuarray.trust.settings import SETTINGS

# of the integral over the middle one of three intervals: exact for cubics
WEIGHTS = np.array([-1.0, 13.0, 13.0, -1.0]) / 24


class Turning(NamedTuple):
    """Angular rate by the gyroscopes, the rest by the accelerometers, all (T, 3)."""

    rate: np.ndarray  # rad/s
    acceleration: np.ndarray  # rad/s^2, in the directions that are seen
    force: np.ndarray  # m/s^2, at the origin of the positions
    informed: np.ndarray  # (3, 3), onto those directions

    def at(self, positions) -> np.ndarray:
        """Specific force of triads at ``positions`` (A, 3) m, (T, A, 3) m/s^2."""
        turned = lever(self.rate[:, None], self.acceleration[:, None], positions)
        return turned + self.force[:, None]


def turning(force, rate, positions) -> Turning:
    """Motion from ``force`` (T, A, 3) and the rate (T, 3), triads at ``positions`` (A, 3) m."""
    middle = positions.mean(axis=0)
    arms = positions - middle
    left = force - np.cross(rate[:, None], np.cross(rate[:, None], arms))
    mean = left.mean(axis=1)
    moment = np.sum(arms**2) * np.eye(3) - arms.T @ arms
    sizes, axes = np.linalg.eigh(moment)
    informed = axes[:, sizes > SETTINGS.known_axis * sizes[-1]]
    inverse = informed @ np.diag(1 / sizes[sizes > SETTINGS.known_axis * sizes[-1]]) @ informed.T
    turn = np.cross(arms, left - mean[:, None]).sum(axis=1) @ inverse
    at_origin = mean - np.cross(rate, np.cross(rate, middle)) - np.cross(turn, middle)
    return Turning(rate, turn, at_origin, informed @ informed.T)


def runs(time) -> np.ndarray:
    """First indices (n,) of four samples each that follow each other at the usual step."""
    if len(time) < 4:
        return np.empty(0, int)
    steps = np.diff(time)
    usual = np.quantile(steps, 0.1)  # of a selection, many steps are longer
    even = np.abs(steps - usual) < SETTINGS.step_spread * usual
    return np.flatnonzero(even[:-2] & even[1:-1] & even[2:])


class Slope(NamedTuple):
    """Turning by the gyroscopes over that by the accelerometers: between two bounds, 1 if sound."""

    low: float  # the bounds of errors in either
    high: float
    sd: float  # the statistical one
    correlation: float
    coarse: float  # share that samples too far apart may leave out of the integral
    skipped: int = 0  # steps twice as long as their stamps say, 0 where no more than chance

    @property
    def off(self) -> bool:
        """True where no errors of measurement explain that it is not 1."""
        if self.correlation < SETTINGS.coherent:
            return self.correlation < -SETTINGS.coherent
        margin = SETTINGS.slope + 5 * self.sd + self.coarse
        return self.high < 1 - margin or self.low > 1 + margin


def slope(time, motion: Turning) -> Slope | None:
    """Change of the rate between neighbours against the integral of the acceleration.

    Of the half of the pairs where the acceleration changes least: fast changes are for the sensors'
    filters. None where there are too few pairs.
    """
    first = runs(time)
    if len(first) < SETTINGS.fewest_pairs:
        return None
    four = first[:, None] + np.arange(4)
    turn = motion.acceleration[four]
    steps = (time[first + 2] - time[first + 1])[:, None]
    change = (motion.rate[first + 2] - motion.rate[first + 1]) @ motion.informed
    whole = np.einsum("k,tkc->tc", WEIGHTS, turn) * steps
    size = np.sum(whole**2, axis=1)
    share = np.sum(change * whole, axis=1)[size > np.median(size)] / size[size > np.median(size)]
    twice, never = (int(np.sum(np.abs(share - at) < SETTINGS.near_twice)) for at in (2, 0))
    # the instants of the two kinds may differ
    late = turn[:, 2] - turn[:, 1]
    jerk = np.linalg.norm(late, axis=1)
    smooth = jerk <= np.median(jerk)
    x, y, lag = (part[smooth].ravel() for part in (whole, change, late))
    if lag @ lag > 0:
        x, y = (part - lag * (lag @ part) / (lag @ lag) for part in (x, y))
    # the trapezium's error is (w dt)^2 / 12 of a wave, this rule's 11 / 720 (w dt)^4
    trapezium = (turn[:, 1] + turn[:, 2]) / 2 * steps
    rough = np.sum((whole - trapezium)[smooth] ** 2) / max(np.sum(whole[smooth] ** 2), 1e-300)
    xx, yy, xy = x @ x, y @ y, x @ y
    if not (xx > 0 and yy > 0) or xy == 0:
        return None
    forward, reverse = xy / xx, yy / xy
    correlation = xy / np.sqrt(xx * yy)
    sd = np.sqrt(np.sum((y - forward * x) ** 2) / xx / smooth.sum())
    low, high = sorted((float(forward), float(reverse)))
    return Slope(
        low, high, float(sd), float(correlation), float(SETTINGS.coarse * rough),
        twice if twice > SETTINGS.least_skipped * (1 + never) else 0,
    )  # fmt: skip


def elsewhere(recording: Recording, positions) -> list[str]:
    """One sentence where accelerometers fit better off ``positions`` (A, 3) m, not calibrated anew.

    By the ratio of residuals before and after they are moved.
    """
    if len(recording.time) < SETTINGS.few_samples:
        return []
    force, places = recording.specific_force, np.array(positions)
    rate = np.median(recording.angular_rate, axis=1)
    left = []
    for _ in range(SETTINGS.moves):
        motion = turning(force, rate, places)
        off = force - motion.at(places)
        left.append(np.sqrt(np.mean(off**2)))
        arms = np.moveaxis(motion.at(np.eye(3)) - motion.at(np.zeros((1, 3))), 1, 2)  # (T, 3, 3)
        known = np.einsum("tia,tib->ab", arms, arms)
        places += np.linalg.lstsq(known, np.einsum("tia,tki->ak", arms, off), rcond=1e-9)[0].T
    moved, ratio = places - places[0] - (positions - positions[0]), left[0] / max(left[-1], 1e-300)
    if ratio < SETTINGS.better_elsewhere:
        return []
    return [
        f"this recording fits positions {1e3 * np.sqrt(np.mean(moved**2)):.2g} mm rms from the"
        f" calibration's better, with {ratio:.2g} times less residual: is it the calibration of"
        " another board?"
    ]


def kept(recording: Recording) -> Recording:
    """Moving samples off the rails; of a long recording, stretches spread over it."""
    lost = recording.at_rail("accelerometer") | recording.at_rail("gyroscope")
    index = np.flatnonzero(~(lost | recording.still()))
    if len(index) > SETTINGS.most_samples:
        stretches = np.array_split(index, len(index) // SETTINGS.stretch)
        index = np.concatenate(stretches[:: -(-len(index) // SETTINGS.most_samples)])
    return recording.select(index).in_memory()
