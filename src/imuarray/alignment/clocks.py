"""Clock and axes of one gyroscope against another's, from the rates of one rigid body."""

from typing import NamedTuple

import numpy as np

from imuarray.alignment.resample import Sensor, Splines
from imuarray.alignment.settings import SETTINGS
from imuarray.errors import InputError, require
from imuarray.firstorder.gyroscopes import SLOWEST
from imuarray.firstorder.settings import SETTINGS as FIRSTORDER
from imuarray.firstorder.turns import nearest_orthogonal, procrustes
from imuarray.linear import scaled_inverse
from imuarray.tails import MEDIAN, t4


class Clock(NamedTuple):
    """A stamp t of the log is the instant t - offset - drift (t - middle) of the first's clock.

    ``map`` (3, 3): rates of the log = map @ rates of the first + bias; ``covariance`` (14, 14) of
    offset, drift, map row by row and bias. ``residual`` rad/s, rms of one axis, robust, and
    ``stray`` s, how far off (rms) stamps would have to be that make it.
    """

    offset: float
    drift: float
    middle: float
    map: np.ndarray = np.eye(3)
    covariance: np.ndarray = np.zeros((14, 14))
    residual: float = 0.0
    stray: float = 0.0

    def instants(self, stamps) -> np.ndarray:
        """On the first log's clock, s."""
        return stamps - self.offset - self.drift * (stamps - self.middle)

    @property
    def rotation(self) -> np.ndarray:
        """From the first's axes to the log's, (3, 3)."""
        return nearest_orthogonal(self.map)

    @property
    def turn_covariance(self) -> np.ndarray:
        """(3, 3) of a small rotation vector, rad, in the log's axes."""
        # map = (1 + E) rotation; the antisymmetric part of E turns
        signs = np.zeros((3, 9))
        for i, (j, k) in enumerate(((1, 2), (2, 0), (0, 1))):
            signs[i, 3 * k + j], signs[i, 3 * j + k] = 0.5, -0.5
        back = signs @ np.kron(np.eye(3), self.rotation)
        return back @ self.covariance[2:11, 2:11] @ back.T


def compare(first: Sensor, other: Sensor, ahead: float = 0.0) -> Clock:
    """Clock and map of a gyroscope against another by robust least squares.

    ``ahead`` s: by which the first's stamps are said to count from a later instant.
    InputError where they show no common motion, or a mirror image.
    """
    splines = Splines(first)
    middle, offset, drift = _coarse(first, other, ahead)
    clock = Clock(offset, drift, middle)
    at = clock.instants(other.time)
    base = splines(at)
    used = ~(first.near_rail(at).any(axis=1) | other.railed.any(axis=1))
    used &= np.linalg.norm(np.nan_to_num(base), axis=1) > SLOWEST
    least = FIRSTORDER.least_moving
    expected = f"{least} readings in turning motion off the rails to find rotation and clock from"
    require(used.sum() >= least, other.name, expected, used.sum())
    turn = procrustes(other.values[used], base[used])
    _require_turning(base[used], turn, other.name)
    found = _fit(splines, other, clock._replace(map=turn), used)
    wild = found.stray > SETTINGS.wild * max(first.step, other.step)
    far = f"rates as far from the first's as if stamps were {1e3 * found.stray:.2g} ms wrong"
    hint = "let the sensor or its driver stamp the readings"
    require(not wild, other.name, "stamps that tell when it was read", f"{far}; {hint}")
    return found


def _require_turning(rate, turn, name: str) -> None:
    """InputError for a mirror image, and for motion about one axis."""
    hint = "is the sign of one of its axes wrong, or of the first's?"
    found = f"those of a mirror image of the first's; {hint}"
    require(np.linalg.det(turn) >= 0, name, "right-handed axes", found)
    values = np.linalg.eigvalsh(rate.T @ rate)
    hint = "turn the rig about other axes, too"
    found = f"one axis only: the rotation of this IMU about it is not determined; {hint}"
    several = values[1] >= FIRSTORDER.weakest_axis * values[2]
    require(several, name, "motion about two axes at least", found)


def _fit(splines: Splines, other: Sensor, clock: Clock, used) -> Clock:
    """Offset, drift, map and bias by Gauss-Newton with Student-t weights (4 degrees of freedom)."""
    time, wanted, turn = other.time[used], other.values[used], clock.map
    values = np.concatenate([[clock.offset, clock.drift], turn.ravel(), np.zeros(3)])
    far = time - clock.middle
    ridge = np.zeros(14)
    for step in range(SETTINGS.steps):
        at = time - values[0] - values[1] * far
        rate, slope = splines(at), splines(at, 1)
        here = np.isfinite(rate).all(axis=1)
        found, map_ = np.nan_to_num(rate), values[2:11].reshape(3, 3)
        left = wanted - found @ map_.T - values[11:]
        squares = np.sum(left**2, axis=1)
        size = max(np.median(squares[here]) / MEDIAN, 1e-30)
        weight, bend = (here * part for part in t4(squares, size))
        columns = np.zeros((len(time), 3, 14))
        columns[..., 0] = -np.nan_to_num(slope) @ map_.T
        columns[..., 1] = columns[..., 0] * far[:, None]
        for i in range(3):
            columns[:, i, 2 + 3 * i : 5 + 3 * i], columns[:, i, 11 + i] = found, 1.0
        ridge[2:11] = size / SETTINGS.slack**2
        flat = (columns * weight[:, None, None]).reshape(-1, 14)
        inverse = scaled_inverse(flat.T @ columns.reshape(-1, 14) + np.diag(ridge))
        slope_ = flat.T @ left.ravel() - ridge * (values - np.r_[0, 0, turn.ravel(), 0, 0, 0])
        change = inverse @ slope_
        values = values + change
        if step > 3 and abs(change[0]) + abs(change[1]) * np.ptp(far) < SETTINGS.close:
            break
    flat = (columns * bend[:, None, None]).reshape(-1, 14)
    inverse = scaled_inverse(flat.T @ columns.reshape(-1, 14) + np.diag(ridge))
    covariance = _sandwich(columns, weight, left, time, inverse)
    residual = float(np.sqrt(size))
    stray = residual / np.sqrt(np.mean(columns[here, :, 0] ** 2))
    found = values[2:11].reshape(3, 3)
    return Clock(values[0], values[1], clock.middle, found, covariance, residual, float(stray))


def _sandwich(columns, weight, left, time, inverse) -> np.ndarray:
    """Covariance (14, 14) that allows residuals within one block of time to be alike."""
    _, block = np.unique(time // SETTINGS.block, return_inverse=True)
    scores = np.zeros((block.max() + 1, 14))
    np.add.at(scores, block, np.einsum("n,nim,ni->nm", weight, columns, left))
    scores = scores @ inverse
    count = len(scores)
    return scores.T @ scores * count / max(count - 14, 1)


def _coarse(first: Sensor, other: Sensor, ahead: float) -> tuple[float, float, float]:
    """(middle, offset, drift) to some milliseconds, from the speeds' correlation."""
    base, start = _speed(first)
    speed, own = _speed(other)
    length = min(round(SETTINGS.window / SETTINGS.coarse), len(speed), len(base))
    begin, lag = _placed(base, speed, length, start - own + ahead, other.name)
    # further pieces of the same log, about where the first one lies
    half = round(SETTINGS.ahead / SETTINGS.coarse)
    short = min(length, round(SETTINGS.hop / SETTINGS.coarse))
    centre, found = begin + length // 2, []
    for place in range(0, len(speed) - short + 1, short):
        around = half + int(SETTINGS.fastest_clock * abs(place + short // 2 - centre))
        low = place + lag - around
        part = base[max(low, 0) : place + lag + short + around]
        if low < 0 or len(part) < short + 2 * around:
            continue
        score = _match(part, speed[place : place + short])
        best = int(np.argmax(score))
        if score[best] > SETTINGS.same_motion and 0 < best < len(score) - 1:
            a, b, c = score[best - 1 : best + 2]
            peak = best + 0.5 * (a - c) / (a - 2 * b + c)
            found.append((place + short / 2, low + peak - place))
    if not found:
        found = [(centre, lag)]
    places, lags = np.array(found).T
    middle, (drift, here) = places.mean(), _line(places - places.mean(), lags)
    # a lag leads from the other's grid to the first's
    offset = own + SETTINGS.coarse * middle - (start + SETTINGS.coarse * (middle + here))
    return float(own + SETTINGS.coarse * middle), float(offset), float(-drift)


def _line(x, y) -> tuple[float, float]:
    """Slope and value at 0 of a line through most points."""
    if np.ptp(x) == 0:
        return 0.0, float(np.median(y))
    weight = np.ones(len(x))
    for _ in range(5):
        slope, value = np.polyfit(x, y, 1, w=np.sqrt(weight))
        left = np.abs(y - slope * x - value)
        weight = 1 / (1 + (left / max(np.median(left), 1e-3)) ** 2)
    return (slope, value) if abs(slope) < SETTINGS.fastest_clock else (0.0, float(np.median(y)))


def _speed(sensor: Sensor) -> tuple[np.ndarray, float]:
    """|rate| on the coarse grid, rad/s, and where that starts."""
    start = float(sensor.time[0])
    grid = start + SETTINGS.coarse * np.arange(int((sensor.time[-1] - start) / SETTINGS.coarse) + 1)
    return np.interp(grid, sensor.time, np.linalg.norm(sensor.values, axis=1)), start


def _match(base, part) -> np.ndarray:
    """Correlation of ``part`` with each piece of ``base`` as long as it is."""
    from scipy.signal import correlate  # slow to import, and every log comes by here

    count, part = len(part), part - part.mean()
    base = base - base.mean()
    sums = np.cumsum(np.concatenate([[0.0], base]))
    squares = np.cumsum(np.concatenate([[0.0], base**2]))
    mean = (sums[count:] - sums[:-count]) / count
    spread = np.maximum((squares[count:] - squares[:-count]) / count - mean**2, 1e-12)
    product = correlate(base, part, "valid", "fft") / count
    return product / np.sqrt(spread * max(np.mean(part**2), 1e-12))


def _placed(base, speed, length: int, zero: float, name: str) -> tuple[int, int]:
    """Where the piece of most motion that the first log shows, too, begins, and its lag.

    Of places that fit equally well the one where the stamps agree best.
    """
    from scipy.signal import argrelextrema  # as in `_match`

    hop, best = max(length // 4, 1), 0.0
    begins = np.arange(0, len(speed) - length + 1, hop)
    spread = np.array([speed[b : b + length].std() for b in begins])
    for begin in begins[np.argsort(-spread)][: SETTINGS.pieces]:
        part = speed[begin : begin + length]
        if part.std() < SLOWEST / 4:
            break
        score = _match(base, part)
        best = max(best, score.max())
        if best > SETTINGS.same_motion:
            peaks = argrelextrema(score, np.greater_equal)[0]
            lags = peaks[score[peaks] > best - SETTINGS.nearly] - begin
            return int(begin), int(lags[np.argmin(np.abs(SETTINGS.coarse * lags + zero))])
    raise InputError(
        f"{name}: expected the turning motion that the first log shows, too, found none alike"
        f" (correlation {best:.2f}); are both on one rigid body, and do the logs overlap?"
    )
