"""Logs of loose IMUs as one recording: common axes, common clock, common instants.

Stamps may jitter or be rounded, of readings that a sensor makes at an even pace.
"""

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np
from scipy.interpolate import make_interp_spline, make_lsq_spline

from imuarray.alignment.clocks import Clock, compare
from imuarray.alignment.found import KINDS, Alignment
from imuarray.alignment.resample import Sensor, Splines
from imuarray.alignment.settings import SETTINGS
from imuarray.errors import require
from imuarray.firstorder.rails import rails_shown
from imuarray.firstorder.turns import angle_of
from imuarray.recording import Recording, record
from imuarray.recording.record import pieces
from imuarray.recording.rig import Log


def steadied(time, values, enough: float = 1.0) -> tuple[np.ndarray, float]:
    """Instants (N,) s of readings (N, 3), and how far (rms, s) their stamps ``time`` are off them.

    A smooth function of the readings' numbers, if the readings are rough in it by at most
    ``enough`` times what they are in the stamps: those that a logger rounds or writes late are
    smoother. Else the stamps.
    """
    steps = np.diff(time)
    parts = pieces(steps > SETTINGS.run * np.median(steps))
    even = np.concatenate([_paced(time[part]) for part in parts])
    off = float(np.sqrt(np.mean((even - time) ** 2)))
    if (np.diff(even) <= 0).any() or _roughness(even, values) > enough * _roughness(time, values):
        return time, 0.0
    return even, off


def _paced(time) -> np.ndarray:
    """Stamps of a run as a line in the readings' numbers, or a spline where that tells."""
    if len(time) < SETTINGS.least_run:
        return time
    steps, every = np.diff(time), np.arange(float(len(time)))
    usual = steps[steps < 1.5 * np.median(steps)]
    step = np.mean(usual)
    missed = np.concatenate([[0.0], np.cumsum(np.maximum(np.round(steps / step), 1.0))])
    # Where stamps jitter by half a step, rounding would see gaps that are none.
    tried = [_line(time, number, pace) for number in (every, missed) for pace in SETTINGS.paces]
    lines = [found for _, found in tried[:: len(SETTINGS.paces)]]
    rounded = len(np.unique(np.round(usual, 7))) <= SETTINGS.rounded
    if rounded:  # a spline would follow the rounding's jumps
        lines = [found for found in lines if np.abs(found - time).max() <= np.ptp(usual)]
        tried = [(0.0, found) for found in lines[:1]] or tried
    return min(tried, key=lambda one: one[0])[1]


def _line(time, number, pace: float) -> tuple[float, np.ndarray]:
    """Schwarz' criterion, by which each knot has to earn its place, and the instants (N,)."""
    inner = np.arange(1.0, (time[-1] - time[0]) / pace - 0.5) * pace
    inner *= number[-1] / (time[-1] - time[0])
    degree = 3 if len(inner) else 1
    knots = np.concatenate([[0.0] * (degree + 1), inner, [number[-1]] * (degree + 1)])
    found = make_lsq_spline(number, time - time[0], knots, degree, method="norm-eq")(number)
    left = np.mean((time - time[0] - found) ** 2)
    cost = len(time) * np.log(max(left, 1e-20)) + len(knots) * np.log(len(time))
    return float(cost), time[0] + found


def _roughness(time, values) -> float:
    """Distance of every other reading from a spline through the rest, at fast changes."""
    change = np.linalg.norm(np.diff(values, axis=0), axis=1)[:-1:2]
    spline = make_interp_spline(time[::2], values[::2], 3)
    odd = slice(1, 2 * len(change), 2)
    off = np.linalg.norm(values[odd] - spline(time[odd]), axis=1)
    return float(np.median(off[change >= np.quantile(change, SETTINGS.fast_quantile)]))


def align(
    logs: Sequence[Log], *, position_prior_sd: float, source: str = ""
) -> tuple[Recording, Alignment]:
    """One recording of several IMUs' own logs, on the first one's clock and in the array's axes.

    Rotations and clocks follow from the rates. The array's axes are those that the first log
    declares, or its chip's own. All readings are carried to instants at the slowest sensor's rate.

    Parameters
    ----------
    logs : two at least; stamps may have any epoch
    position_prior_sd : m, of the nominal positions
    source : where the logs are from

    InputError for logs that do not turn together, turn about one axis only, hardly overlap, or are
    mirrored, and where the motion is too fast for a sensor's rate: naming it and the remedy.
    """
    pairs, origins = _sensors(logs)
    _require_slow([sensor for pair in pairs for sensor in pair])
    gyroscopes = [pair[1] for pair in pairs]
    ahead = _ahead(logs, gyroscopes, origins)
    clocks = [Clock(0.0, 0.0, float(np.mean(gyroscopes[0].time[[0, -1]])))]
    clocks += map(compare, gyroscopes[:1] * len(ahead), gyroscopes[1:], ahead)
    frame = np.eye(3) if logs[0].axes is None else logs[0].axes
    rotation = np.array([frame @ clock.rotation.T for clock in clocks])
    sensors = [
        replace(sensor, time=clock.instants(sensor.time))
        for pair, clock in zip(pairs, clocks, strict=True) for sensor in pair
    ]  # fmt: skip
    grid, step = _grid(sensors)
    knots, facts = zip(*(_carried(sensor, grid, step) for sensor in sensors), strict=True)
    recording, whole = _recording(logs, rotation, grid, sensors, knots)
    noise = np.sqrt(np.mean(np.reshape([noise**2 for *_, noise in facts], (-1, 2)), axis=0))
    both = np.hypot(gyroscopes[0].noise_sd, [g.noise_sd for g in gyroscopes])
    agreement = np.array([np.nan, *(clock.residual for clock in clocks[1:])]) / both
    unknown = np.full((3, 3), np.nan)
    declared = np.array([unknown if log.axes is None else log.axes for log in logs])
    found = Alignment(
        recording.accelerometer_labels, rotation,
        angle_of(np.swapaxes(rotation, 1, 2) @ declared),
        _of_stamps(clocks, gyroscopes, origins), agreement,
        np.reshape(facts, (-1, 2, 4)), step, origins[0], int(whole.sum()),
        int((~whole).sum()), np.array([log.epoch for log in logs]), tuple(_ends(sensors)),
    )  # fmt: skip
    return replace(
        recording, accelerometer_noise_sd=float(noise[0]), gyroscope_noise_sd=float(noise[1]),
        position_prior_sd=position_prior_sd, source=source, alignment=found.dataset(),
    ), found  # fmt: skip


def _sensors(logs: Sequence[Log]) -> tuple[list[tuple[Sensor, Sensor]], list[float]]:
    """Accelerometer and gyroscope of each log, their stamps from the log's own zero, and that."""
    require(len(logs) >= 2, "logs", "two IMUs at least", len(logs))
    out, origins = [], []
    for log in logs:
        parts = [
            (f"{kind} {log.label!r}", getattr(log, f"{kind}_time"), getattr(log, values),
             getattr(log, f"{kind}_range"), getattr(log, f"{kind}_noise_sd"))
            for kind, values in record.KINDS.items()
        ]  # fmt: skip
        for name, time, *_ in parts:
            count = len(time)
            expected = f"{SETTINGS.shortest} readings at least"
            require(count >= SETTINGS.shortest, name, expected, count)
            step, lasts = np.quantile(np.diff(time), 0.99), time[-1] - time[0]
            paused = step > 0 and lasts > SETTINGS.paused * count * step
            days = f"within {lasts / 86400:.3g} days"
            found = f"{count} readings {step:.3g} s apart or less {days}"
            require(not paused, name, "stamps of one recording", found)
        origins.append(float(min(time[0] for _, time, *_ in parts)))
        out.append(tuple(
            Sensor(name, *steadied(time - origins[-1], values), values,
                   np.abs(values) >= record.RAIL * limit, noise)
            for name, time, values, limit, noise in parts
        ))  # fmt: skip
    return out, origins


def _ahead(logs, gyroscopes, origins) -> list[float]:
    """By how much (s) the first log begins later than each other, 0 where stamps do not tell."""
    ends = [start + one.time[-1] for start, one in zip(origins, gyroscopes, strict=True)]
    return [
        origins[0] - origin
        if log.epoch == logs[0].epoch and origin < ends[0] and origins[0] < end else 0.0
        for log, origin, end in zip(logs, origins, ends, strict=True)
    ][1:]  # fmt: skip


def _ends(sensors: Sequence[Sensor]) -> Iterator[str]:
    """A line for each sensor that ends long before the others, or begins long after them."""
    first, last = min(s.time[0] for s in sensors), max(s.time[-1] for s in sensors)
    for sensor in sensors:
        for late, what in (
            (sensor.time[0] - first, "begins {:.1f} s after"),
            (last - sensor.time[-1], "ends {:.1f} s before"),
        ):
            if late > SETTINGS.uneven:
                yield f"{sensor.name} {what.format(late)} the others: what it has not is left out"


def _grid(sensors: Sequence[Sensor]) -> tuple[np.ndarray, float]:
    """Even instants while all sensors log, at the slowest one's steps and on its readings."""
    slowest = max(sensors, key=lambda sensor: sensor.step)
    first = max(sensor.time[0] for sensor in sensors)
    last = min(sensor.time[-1] for sensor in sensors)
    begin = slowest.time[np.searchsorted(slowest.time, first).clip(max=len(slowest.time) - 1)]
    grid = np.arange(begin, last, slowest.step)
    _require_common(len(grid))
    return grid, slowest.step


def _require_common(count: int) -> None:
    expected = f"{SETTINGS.shortest} instants at least that all sensors have readings around"
    require(count >= SETTINGS.shortest, "logs", expected, count)


def _carried(sensor: Sensor, grid, step: float) -> tuple[np.ndarray | None, tuple]:
    """The grid as knots where a sensor is averaged, or None; and `Alignment.carried` of it.

    Averaged is a faster one, where that misses nothing to speak of. What it and the slowest one
    keep of the motion is the same then, and no reading is thrown away.
    """
    left = sensor.noise_sd * np.sqrt(sensor.step / step)
    faster, missed = SETTINGS.slower * sensor.step < step, SETTINGS.averaging_missed * left
    averaged = faster and sensor.error(step) < missed
    knots, spacing = (grid, grid[1] - grid[0]) if averaged else (None, sensor.step)
    # any white noise shows what is left of it
    white = np.random.default_rng(0).standard_normal(sensor.values.shape)
    noise = sensor.noise_sd * np.sqrt(np.nanmean(Splines(sensor, white, knots)(grid) ** 2))
    return knots, (1 / sensor.step, sensor.jitter, sensor.error(spacing), noise)


def _of_stamps(clocks, gyroscopes, origins) -> tuple[Clock, ...]:
    """Clocks of the logs' own stamps; instants that stand for jittering ones are means of them."""
    unsure = np.array([g.jitter / np.sqrt(len(g.time)) for g in gyroscopes])
    unsure[1:], unsure[0] = np.hypot(unsure[1:], unsure[0]), 0.0
    found = []
    for clock, origin, sd in zip(clocks, origins, unsure, strict=True):
        covariance = clock.covariance.copy()
        covariance[0, 0] += sd**2
        offset, middle = clock.offset + origin - origins[0], clock.middle + origin
        found.append(clock._replace(offset=offset, middle=middle, covariance=covariance))
    return tuple(found)


def _require_slow(sensors: Sequence[Sensor]) -> None:
    """InputError, naming the worst sensor, where the motion is too fast for one's rate.

    And where readings are too scattered to tell.
    """
    for sensor in sensors:
        run = max(len(sensor.time[part]) for part in sensor.runs(SETTINGS.widest + 0.5))
        most = SETTINGS.widest - 1
        expected = f"stretches of {SETTINGS.unbroken} readings with at most {most} missing in a row"
        require(run >= SETTINGS.unbroken, sensor.name, expected, f"{run} at most")
    worst = max(sensors, key=lambda sensor: sensor.error(sensor.step) / sensor.noise_sd)
    missed = worst.error(worst.step)
    unit, scale = KINDS[worst.name.split()[0]]
    noise = f"their noise of {scale * worst.noise_sd:.2g} {unit}"
    found = f"motion too fast for {1 / worst.step:.4g} Hz: it misses {scale * missed:.2g}"
    hint = "log at a higher rate, move more slowly, or declare the noise as it is"
    expected = f"readings that interpolation carries over within {noise}"
    require(not missed > worst.noise_sd, worst.name, expected, f"{found}; {hint}")


def _recording(logs, rotation, grid, sensors, knots) -> tuple[Recording, np.ndarray]:
    """The recording in the array's axes, and which of the common instants (T,) are in it."""
    shape = len(logs), 2, len(grid), 3
    values = [Splines(sensor, None, own)(grid) for sensor, own in zip(sensors, knots, strict=True)]
    values = np.reshape(values, shape)
    widths = [0.0 if own is None else own[1] - own[0] for own in knots]
    railed = np.reshape([s.near_rail(grid, w) for s, w in zip(sensors, widths, strict=True)], shape)
    whole = np.isfinite(values).all(axis=(0, 1, 3))
    _require_common(int(whole.sum()))
    force, rate = np.einsum("kij,knTj->nTki", rotation, values[:, :, whole])
    force_rails, rate_rails = (
        rails_shown(rotation, railed[:, kind, whole].swapaxes(0, 1)) for kind in (0, 1)
    )
    labels = tuple(log.label for log in logs)
    return Recording(
        grid[whole], force, rate, np.array([log.position for log in logs]), labels, labels,
        np.nan, np.nan, max(log.accelerometer_range for log in logs),
        max(log.gyroscope_range for log in logs), np.nan, specific_force_saturated=force_rails,
        angular_rate_saturated=rate_rails, accelerometer_axes=rotation,
    ), whole  # fmt: skip
