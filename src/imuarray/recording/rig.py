"""IMUs that logged each by itself: their readings in order, on one origin of time."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from imuarray.errors import LARGEST, InputError, require
from imuarray.recording.layout import numbers, positions, rotation
from imuarray.recording.record import KINDS, Recording
from imuarray.recording.settings import SETTINGS


@dataclass(frozen=True, eq=False)
class Log:
    """Readings of one IMU as its logger stamped them; a blank reading is not there.

    Attributes
    ----------
    label : str
    accelerometer_time : ndarray (N,), seconds on the logger's clock, strictly increasing
    specific_force : ndarray (N, 3), m/s^2, in the chip's own axes
    gyroscope_time : ndarray (M,), seconds on the same clock, strictly increasing
        The two kinds may have different rates.
    angular_rate : ndarray (M, 3), rad/s, in the chip's own axes
    position : ndarray (3,), metres, nominal, in the array frame
    axes : ndarray (3, 3), or None
        Rotation from the chip's axes to the array's; None where nobody knows it.
    accelerometer_noise_sd, accelerometer_range : float, m/s^2
    gyroscope_noise_sd, gyroscope_range : float, rad/s
    epoch : float, the stamp in s from which the times are counted
    """

    label: str
    accelerometer_time: np.ndarray
    specific_force: np.ndarray
    gyroscope_time: np.ndarray
    angular_rate: np.ndarray
    position: np.ndarray
    axes: np.ndarray | None
    accelerometer_noise_sd: float
    accelerometer_range: float
    gyroscope_noise_sd: float
    gyroscope_range: float
    epoch: float = 0.0


@dataclass(frozen=True, eq=False)
class Readings:
    """One kind of one IMU as logged: stamps (N,) of ``unit`` s, values (N, 3) in SI units.

    Where either is NaN there is no reading; ``where`` is for messages, ``lines`` say what was done.
    """

    stamps: np.ndarray
    unit: float
    values: np.ndarray
    where: str
    lines: tuple[str, ...] = ()


class Rig(NamedTuple):
    """Logs of one rig, the sd of its positions in m, what was left out, and from where.

    ``stamped``: stamps were logged, so that equal ones are of one time.
    """

    logs: list[Log]
    position_prior_sd: float
    lines: list[str]
    source: str
    stamped: bool = True


def to_rig(imus: Mapping[str, dict], read: Mapping[str, list[Readings]], layout, where, source):
    """The YAML's ``imus`` with what was ``read`` of each, accelerometer and gyroscope, as a `Rig`.

    The first IMU's axes are the array's where the YAML says nothing else; the others' are then
    unknown. Times are from the earliest stamp of all, of an IMU whose clock has another origin
    from its own. InputError for stamps out of order.
    """
    places = positions(imus, layout, f"{where}: imus")
    whole = {label: [_in_order(one) for one in kinds] for label, kinds in read.items()}
    lines = [
        f"{label}: {kind}: {line}"
        for label, kinds in whole.items() for kind, one in zip(KINDS, kinds, strict=True)
        for line in one.lines
    ]  # fmt: skip
    first, apart = _origins(list(whole.values()))
    lines += [
        f"{label}: its stamps are at no time those of {next(iter(whole))}: both are taken to begin"
        " at once"
        for label, alone in zip(whole, apart, strict=True) if alone
    ]  # fmt: skip
    logs = []
    for place, origin, (label, kinds) in zip(places, first, whole.items(), strict=True):
        own = f"{where}: imus {label!r}"
        axes = imus[label].get("axes", None if logs else list("xyz"))
        given = numbers(layout | imus[label], own)
        prior = given.pop("position_prior_sd")
        times = [_time(kind, origin) for kind in kinds]
        logs.append(Log(
            label, times[0], kinds[0].values, times[1], kinds[1].values, place,
            None if axes is None else rotation(axes, own), **given,
            epoch=float(origin.unit * origin.stamps[0]),
        ))  # fmt: skip
    return Rig(logs, prior, lines, source)


def pair(value: Any) -> list:
    """The accelerometer's and the gyroscope's: a list of two, or one for both."""
    return value if isinstance(value, list) and len(value) == 2 else [value, value]


def _origins(imus: list[list[Readings]]) -> tuple[list[Readings], list[bool]]:
    """Readings that begin each IMU's time, and whether by a clock of their own."""
    begin = [min(kinds, key=lambda r: r.unit * r.stamps[0]) for kinds in imus]
    start = np.array([r.unit * r.stamps[0] for r in begin])
    end = np.array([max(r.unit * r.stamps[-1] for r in kinds) for kinds in imus])
    apart = (start > end[0]) | (end < start[0])
    shared = begin[np.argmin(np.where(apart, np.inf, start))]
    return [own if alone else shared for own, alone in zip(begin, apart, strict=True)], list(apart)


def _time(readings: Readings, first: Readings) -> np.ndarray:
    """Seconds from the stamp that ``first`` begins with; integers of the same unit lose nothing."""
    origin = first.stamps[0]
    if first.unit != readings.unit:
        origin = origin * (first.unit / readings.unit)
    return readings.unit * (readings.stamps - origin)


def _in_order(readings: Readings) -> Readings:
    """With stamps that increase: without blank readings, and those logged twice."""
    stamps, values, where = readings.stamps, readings.values, readings.where
    there = ~np.isnan(stamps) & ~np.isnan(values).any(axis=1)
    require(there.any(), where, "readings", "none")
    rows = np.flatnonzero(there)
    wild = np.abs(values[rows]).max(axis=1) > LARGEST
    at = rows[np.argmax(wild)]
    require(not wild.any(), where, "finite numbers", f"{values[at]} in reading {at + 1}")
    steps = np.diff(stamps[rows])
    # a logger that runs faster than a sensor writes its last reading again
    again = (steps == 0) & (values[rows[1:]] == values[rows[:-1]]).all(axis=1)
    for wrong, expected in (
        ((steps <= 0) & ~again, "that increase"),
        (readings.unit * steps > SETTINGS.longest_gap, "of one day (was the clock set meanwhile?)"),
    ):
        if wrong.any():
            i = int(np.argmax(wrong))
            raise InputError(
                f"{where}: expected stamps {expected}, found {stamps[rows[i + 1]]} after"
                f" {stamps[rows[i]]} in reading {rows[i + 1] + 1} ({wrong.sum()} such steps)"
            )
    kept = rows[np.concatenate([[True], ~again])]
    counts = (("no reading", len(stamps) - len(rows)), ("the last one again", again.sum()))
    lines = (*readings.lines, *(f"{what} in {n} of {len(stamps)}" for what, n in counts if n))
    return Readings(stamps[kept], readings.unit, values[kept], where, lines)


def recording_of(rig: Rig) -> Recording | None:
    """The samples as they are, where all IMUs share stamps, noise, ranges, and axes are known.

    Not where a clock has an origin of its own: that logs begin at once is a guess then.
    """
    logs = rig.logs
    if any(log.epoch != logs[0].epoch for log in logs):
        return None
    time = logs[0].accelerometer_time
    shared = all(
        np.array_equal(t, time) for x in logs for t in (x.accelerometer_time, x.gyroscope_time)
    )
    names = "accelerometer_noise_sd", "accelerometer_range", "gyroscope_noise_sd", "gyroscope_range"
    given = {name: getattr(logs[0], name) for name in names}
    alike = all(getattr(log, name) == value for log in logs for name, value in given.items())
    if not (rig.stamped and shared and alike) or any(log.axes is None for log in logs):
        return None
    labels = tuple(log.label for log in logs)
    return Recording(
        time=time, specific_force=np.stack([x.specific_force @ x.axes.T for x in logs], axis=1),
        angular_rate=np.stack([x.angular_rate @ x.axes.T for x in logs], axis=1),
        accelerometer_position=np.array([x.position for x in logs]), accelerometer_labels=labels,
        gyroscope_labels=labels, accelerometer_axes=np.array([x.axes for x in logs]),
        position_prior_sd=rig.position_prior_sd, source=rig.source,
        **given,
    )  # fmt: skip
