"""Logs of loose IMUs as one recording: common axes, common clock, common instants."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
import xarray as xr

from imuarray.alignment.clocks import Clock, compare, itself
from imuarray.alignment.resample import Sensor, Splines
from imuarray.alignment.stamps import steadied
from imuarray.errors import InputError
from imuarray.firstorder.correct import rails_shown
from imuarray.firstorder.turns import TURNED, angle_of
from imuarray.recording import Recording
from imuarray.recording.log import Log
from imuarray.recording.record import AXES

KINDS = {"accelerometer": ("m/s^2", 1.0), "gyroscope": ("deg/s", 180 / np.pi)}  # as lines show them
SLOWER = 1.5  # times the common rate, from which a sensor's readings are averaged
LITTLE = 0.3  # of the noise that is left, what averaging may miss
SHORTEST = 100  # readings of a sensor, and common instants
NOISY = 3.0  # times the noise, from which the residual is explained
SHOWN = 5e-6  # s of jitter
RAIL = 1 - 1e-6  # of the range


@dataclass(frozen=True, eq=False)
class Alignment:
    """How K logs lie to one another.

    Attributes
    ----------
    labels : K str
    rotation : (K, 3, 3) from each chip's axes to the array's
    declared : (K,) rad, between the rotation found and the one declared; NaN where none was
    clocks : K of `Clock`, each against the first log's
    rate : (K, 2) Hz, of accelerometer and gyroscope by the first log's clock
    jitter : (K, 2) s, rms, of the stamps about the even instants that were taken for them
    error, noise : (K, 2) m/s^2 and rad/s
        Rms of what interpolation misses in motion, and the declared noise in an interpolated
        reading.
    agreement : (K,) residual of each gyroscope against the first, over the declared noise of both
    step : s, between common instants
    origin : s, the first log's stamp at the recording's instant zero
    count, left_out : common instants, and those that gaps in the logs cost beside
    """

    labels: tuple[str, ...]
    rotation: np.ndarray
    declared: np.ndarray
    clocks: tuple[Clock, ...]
    rate: np.ndarray
    jitter: np.ndarray
    error: np.ndarray
    noise: np.ndarray
    agreement: np.ndarray
    step: float
    origin: float
    count: int
    left_out: int

    @property
    def angle(self) -> np.ndarray:
        """(K,) rad, between each chip's axes and the first's."""
        return angle_of(np.swapaxes(self.rotation, 1, 2) @ self.rotation[0])

    @property
    def angle_sd(self) -> np.ndarray:
        """(K,) rad, about one axis, mean over axes."""
        return np.sqrt([np.trace(clock.turn_covariance) / 3 for clock in self.clocks])

    def lines(self) -> list[str]:
        """For a person: what was found of each log, and how well readings are carried over."""
        gaps = f"; {self.left_out} more in gaps left out" if self.left_out else ""
        rate = f"{1 / self.step:.2f} Hz, the slowest sensor's rate"
        out = [f"{self.count} common instants at {rate}{gaps}"]
        for k, label in enumerate(self.labels):
            if k:
                out.append(f"IMU {label}: {self._lies(k)}")
            out.append(f"IMU {label}: {self._carried(k)}")
        return out

    def _lies(self, k: int) -> str:
        clock, (ahead, faster) = self.clocks[k], np.sqrt(np.diag(self.clocks[k].covariance)[:2])
        text = (
            f"turned by {np.degrees(self.angle[k]):.4f} +- {np.degrees(self.angle_sd[k]):.4f}"
            f" degrees against IMU {self.labels[0]}; its clock is"
            f" {1e3 * clock.offset:+.4f} +- {1e3 * ahead:.4f} ms ahead at its middle and"
            f" {1e6 * clock.drift:+.2f} +- {1e6 * faster:.2f} ppm fast; rates agree to"
            f" {self.agreement[k]:.2f} times the noise"
        )
        if self.agreement[k] > NOISY:
            text += f", as if its stamps were {1e3 * clock.stray:.2g} ms wrong"
        if self.declared[k] > TURNED:
            text += f"; {np.degrees(self.declared[k]):.1f} degrees off its declared axes"
        return text

    def _carried(self, k: int) -> str:
        shown = [
            f"{kind} at {rate:.2f} Hz{_said(off)}, interpolation misses {scale * error:.2g} {unit}"
            f" where noise is {scale * noise:.2g}"
            for (kind, (unit, scale)), rate, off, error, noise in zip(
                KINDS.items(),
                self.rate[k],
                self.jitter[k],
                self.error[k],
                self.noise[k],
                strict=True,
            )
        ]
        return "; ".join(shown)

    def dataset(self) -> xr.Dataset:
        """The same as the recording's file keeps it: dimensions imu, axis, kind."""
        clocks, sds = self.clocks, np.array([np.diag(c.covariance)[:2] ** 0.5 for c in self.clocks])
        s, ppm = {"units": "s"}, {"units": "1"}
        per_kind = {"units": "m s-2 and rad s-1"}
        imu = "imu"
        return xr.Dataset(
            {
                "rotation": ((imu, "axis", "axis_other"), self.rotation, {"units": "1"}),
                "angle_sd": (imu, self.angle_sd, {"units": "rad"}),
                "clock_offset": (imu, np.array([c.offset for c in clocks]), s),
                "clock_offset_sd": (imu, sds[:, 0], s),
                "clock_drift": (imu, np.array([c.drift for c in clocks]), ppm),
                "clock_drift_sd": (imu, sds[:, 1], ppm),
                "clock_middle": (imu, np.array([c.middle for c in clocks]), s),
                "rate": ((imu, "kind"), self.rate, {"units": "Hz"}),
                "jitter": ((imu, "kind"), self.jitter, {"units": "s"}),
                "interpolation_error": ((imu, "kind"), self.error, per_kind),
                "interpolated_noise": ((imu, "kind"), self.noise, per_kind),
                "agreement": (imu, self.agreement, {"units": "1"}),
            },
            {
                imu: np.array(self.labels, object),
                "kind": np.array(list(KINDS), object),
                "axis": np.array(AXES, object),
            },
            {"step": self.step, "origin": self.origin, "left_out": self.left_out},
        )


def _said(jitter: float) -> str:
    return f", its stamps {1e3 * jitter:.2g} ms off even readings" if jitter > SHOWN else ""


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
    sensors, origins = _sensors(logs)
    _require_slow([sensor for pair in sensors for sensor in pair])
    gyroscopes = [pair[1] for pair in sensors]
    clocks = [itself(gyroscopes[0].time), *(compare(gyroscopes[0], g) for g in gyroscopes[1:])]
    frame = np.eye(3) if logs[0].axes is None else logs[0].axes
    rotation = np.array([frame @ clock.rotation.T for clock in clocks])
    sensors = [
        [replace(sensor, time=clock.instants(sensor.time)) for sensor in pair]
        for pair, clock in zip(sensors, clocks, strict=True)
    ]
    grid, step = _grid([sensor for pair in sensors for sensor in pair])
    carried = [[_carry(sensor, grid, step) for sensor in pair] for pair in sensors]
    recording, whole = _recording(logs, rotation, grid, carried)
    rate, jitter, error, noise = (
        np.array([[value(sensor, one) for sensor, one in zip(*pairs, strict=True)]
                  for pairs in zip(sensors, carried, strict=True)])
        for value in (lambda s, _: 1 / s.step, lambda s, _: s.jitter, lambda _, c: c.error,
                      lambda _, c: c.noise_sd)
    )  # fmt: skip
    # the instants that stand for jittering stamps are means of them
    unsure = np.array([g.jitter / np.sqrt(len(g.time)) for g in gyroscopes])
    unsure = np.where(np.arange(len(logs)) > 0, np.hypot(unsure, unsure[0]), 0.0)
    own = [
        clock.of_stamps(origin, origins[0], sd)
        for clock, origin, sd in zip(clocks, origins, unsure, strict=True)
    ]
    both = np.hypot(gyroscopes[0].noise_sd, [g.noise_sd for g in gyroscopes])
    agreement = np.array([np.nan, *(clock.residual for clock in clocks[1:])]) / both
    found = Alignment(
        recording.accelerometer_labels, rotation, _declared(logs, rotation), tuple(own), rate,
        jitter, error, noise, agreement, step, origins[0], int(whole.sum()), int((~whole).sum()),
    )  # fmt: skip
    return replace(
        recording, position_prior_sd=position_prior_sd, source=source, alignment=found.dataset()
    ), found


class _Carried(NamedTuple):
    """A sensor on T common instants: values (T, 3), NaN in gaps; railed (T, 3); error, noise."""

    values: np.ndarray
    railed: np.ndarray
    error: float
    noise_sd: float


def _sensors(logs: Sequence[Log]) -> tuple[list[tuple[Sensor, Sensor]], list[float]]:
    """Accelerometer and gyroscope of each log, their stamps from the log's own zero, and that."""
    if len(logs) < 2:
        raise InputError(f"logs: expected two IMUs at least, found {len(logs)}")
    out, origins = [], []
    for log in logs:
        parts = (
            (log.accelerometer_time, log.specific_force, log.accelerometer_range,
             log.accelerometer_noise_sd),
            (log.gyroscope_time, log.angular_rate, log.gyroscope_range, log.gyroscope_noise_sd),
        )  # fmt: skip
        for kind, (time, *_) in zip(KINDS, parts, strict=True):
            if len(time) < SHORTEST:
                raise InputError(
                    f"{kind} {log.label!r}: expected {SHORTEST} readings at least, found"
                    f" {len(time)}"
                )
        origins.append(float(min(part[0][0] for part in parts)))
        out.append(tuple(
            Sensor(f"{kind} {log.label!r}", *steadied(time - origins[-1], values), values,
                   np.abs(values) >= RAIL * limit, noise)
            for kind, (time, values, limit, noise) in zip(KINDS, parts, strict=True)
        ))  # fmt: skip
    return out, origins


def _grid(sensors: Sequence[Sensor]) -> tuple[np.ndarray, float]:
    """Even instants while all sensors log, at the slowest one's steps and on its readings."""
    slowest = max(sensors, key=lambda sensor: sensor.step)
    first = max(sensor.time[0] for sensor in sensors)
    last = min(sensor.time[-1] for sensor in sensors)
    begin = slowest.time[np.searchsorted(slowest.time, first).clip(max=len(slowest.time) - 1)]
    return np.arange(begin, last, slowest.step), slowest.step


def _carry(sensor: Sensor, grid, step: float) -> _Carried:
    """A sensor's readings on the grid.

    A faster sensor is averaged to the grid's rate, where that misses nothing to speak of: what
    both keep of the motion is the same then, and no reading is thrown away.
    """
    left = sensor.noise_sd * np.sqrt(sensor.step / step)
    averaged = SLOWER * sensor.step < step and sensor.error(step) < LITTLE * left
    knots = grid if averaged else None
    error = sensor.error(step if averaged else sensor.step)
    # any white noise shows what is left of it
    white = np.random.default_rng(0).standard_normal(sensor.values.shape)
    noise = sensor.noise_sd * np.sqrt(np.nanmean(Splines(sensor, white, knots)(grid) ** 2))
    return _Carried(Splines(sensor, None, knots)(grid), sensor.near_rail(grid), error, noise)


def _require_slow(sensors: Sequence[Sensor]) -> None:
    """InputError, naming the worst sensor, where the motion is too fast for one's rate."""
    worst = max(sensors, key=lambda sensor: sensor.error(sensor.step) / sensor.noise_sd)
    missed = worst.error(worst.step)
    if missed > worst.noise_sd:
        unit, scale = KINDS[worst.name.split()[0]]
        raise InputError(
            f"{worst.name}: expected readings that interpolation carries over within their noise of"
            f" {scale * worst.noise_sd:.2g} {unit}, found motion too fast for {1 / worst.step:.4g}"
            f" Hz: it misses {scale * missed:.2g}; log at a higher rate, move more slowly, or"
            " declare the noise as it is"
        )


def _recording(logs, rotation, grid, carried) -> tuple[Recording, np.ndarray]:
    """The recording in the array's axes, and which of the common instants (T,) are in it."""
    values = np.array([[one.values for one in pair] for pair in carried])  # (K, 2, T, 3)
    railed = np.array([[one.railed for one in pair] for pair in carried])
    whole = np.isfinite(values).all(axis=(0, 1, 3))
    if whole.sum() < SHORTEST:
        raise InputError(
            f"logs: expected {SHORTEST} instants at least that all IMUs have readings around,"
            f" found {whole.sum()}"
        )
    force, rate = np.einsum("kij,knTj->nTki", rotation, values[:, :, whole])
    force_rails, rate_rails = (
        rails_shown(rotation, railed[:, kind, whole].swapaxes(0, 1)) for kind in (0, 1)
    )
    noise = np.array([[one.noise_sd for one in pair] for pair in carried])
    noise = np.sqrt(np.mean(noise**2, axis=0))
    labels = tuple(log.label for log in logs)
    return Recording(
        grid[whole], force, rate, np.array([log.position for log in logs]), labels, labels,
        float(noise[0]), float(noise[1]), max(log.accelerometer_range for log in logs),
        max(log.gyroscope_range for log in logs), np.nan, specific_force_saturated=force_rails,
        angular_rate_saturated=rate_rails, accelerometer_axes=rotation,
    ), whole  # fmt: skip


def _declared(logs: Sequence[Log], rotation) -> np.ndarray:
    """(K,) rad between rotations found and declared, NaN where there are none declared."""
    return np.array([
        np.nan if log.axes is None else angle_of(found.T @ log.axes)
        for log, found in zip(logs, rotation, strict=True)
    ])  # fmt: skip
