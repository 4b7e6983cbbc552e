"""Results of aligning logs: in lines for a person, and as a file keeps them."""

from dataclasses import dataclass

import numpy as np
import xarray as xr

from imuarray.alignment.clocks import Clock
from imuarray.alignment.settings import SETTINGS
from imuarray.firstorder.turns import TURNED, angle_of
from imuarray.recording.record import AXES

KINDS = {"accelerometer": ("m/s^2", 1.0), "gyroscope": ("deg/s", 180 / np.pi)}  # as lines show them


@dataclass(frozen=True, eq=False)
class Alignment:
    """Clocks and axes of K logs against one another.

    Attributes
    ----------
    labels : K str
    rotation : (K, 3, 3) from each chip's axes to the array's
    declared : (K,) rad, between the rotation found and the one declared; NaN where none was
    clocks : K of `Clock`, each against the first log's
    agreement : (K,) residual of each gyroscope against the first, over the declared noise of both
    carried : (K, 2, 4) of accelerometer and gyroscope
        Rate, Hz by the first log's clock; jitter of the stamps, s; rms of what interpolation misses
        in motion, and the declared noise in an interpolated reading, m/s^2 or rad/s.
    step : s, between common instants
    origin : s, the first log's stamp at the recording's instant zero
    count, left_out : common instants, and those that gaps in the logs cost beside
    epochs : (K,) s, the logs' stamps at the zeros of their times; `dataset` counts by stamps
    ends : a line for each sensor that ends long before the others, or begins long after them
    """

    labels: tuple[str, ...]
    rotation: np.ndarray
    declared: np.ndarray
    clocks: tuple[Clock, ...]
    agreement: np.ndarray
    carried: np.ndarray
    step: float
    origin: float
    count: int
    left_out: int
    epochs: np.ndarray
    ends: tuple[str, ...]

    @property
    def angle_sd(self) -> np.ndarray:
        """(K,) rad, about one axis, mean over axes."""
        return np.sqrt([np.trace(clock.turn_covariance) / 3 for clock in self.clocks])

    def lines(self) -> list[str]:
        """For a person: what was found of each log, and how well readings are carried over."""
        gaps = f"; {self.left_out} more in gaps left out" if self.left_out else ""
        rate = f"{1 / self.step:.2f} Hz, the slowest sensor's rate"
        out = [f"{self.count} common instants at {rate}{gaps}", *self.ends]
        for k, (label, pair) in enumerate(zip(self.labels, self.carried, strict=True)):
            out += [f"IMU {label}: {self._lies(k)}"] if k else []
            shown = (_carried(kind, *one) for kind, one in zip(KINDS, pair, strict=True))
            out.append(f"IMU {label}: {'; '.join(shown)}")
        return out

    def _lies(self, k: int) -> str:
        clock, (ahead, faster) = self.clocks[k], np.sqrt(np.diag(self.clocks[k].covariance)[:2])
        angle = angle_of(self.rotation[k].T @ self.rotation[0])
        text = (
            f"turned by {_with(np.degrees(angle), np.degrees(self.angle_sd[k]))} degrees"
            f" against IMU {self.labels[0]}; its clock is"
            f" {_with(1e3 * abs(clock.offset), 1e3 * ahead)}"
            f" ms {'behind' if clock.offset < 0 else 'ahead'} at its middle and"
            f" {_with(1e6 * abs(clock.drift), 1e6 * faster)} ppm"
            f" {'slow' if clock.drift < 0 else 'fast'}; rates"
            f" agree to {self.agreement[k]:.2f} times the noise"
        )
        if self.agreement[k] > SETTINGS.noisy_residual:
            text += f", as if its stamps were {1e3 * clock.stray:.2g} ms wrong"
        if self.declared[k] > TURNED:
            text += f"; {np.degrees(self.declared[k]):.1f} degrees off its declared axes"
        return text

    def dataset(self) -> xr.Dataset:
        """Dataset of the alignment for the recording's file: dimensions imu, axis, kind."""
        offset, drift, middle = np.array([clock[:3] for clock in self.clocks]).T
        sds = np.sqrt([np.diag(clock.covariance)[:2] for clock in self.clocks]).T
        rate, jitter, error, noise = np.moveaxis(self.carried, -1, 0)
        own, kinds, both = ("imu",), ("imu", "kind"), "m s-2 and rad s-1"
        found = {
            "clock_offset": (own, offset + (self.epochs - self.epochs[0]), "s"),
            "clock_drift": (own, drift, "1"),
            "clock_middle": (own, middle + self.epochs, "s"),
            "clock_offset_sd": (own, sds[0], "s"),
            "clock_drift_sd": (own, sds[1], "1"),
            "angle_sd": (own, self.angle_sd, "rad"),
            "agreement": (own, self.agreement, "1"),
            "rate": (kinds, rate, "Hz"),
            "jitter": (kinds, jitter, "s"),
            "interpolation_error": (kinds, error, both),
            "interpolated_noise": (kinds, noise, both),
            "rotation": (("imu", "axis", "axis_other"), self.rotation, "1"),
        }
        named = {"imu": self.labels, "kind": KINDS, "axis": AXES}
        origin = self.origin + self.epochs[0]
        return xr.Dataset(
            {name: (dims, values, {"units": unit}) for name, (dims, values, unit) in found.items()},
            {name: np.array(list(labels), object) for name, labels in named.items()},
            {"step": self.step, "origin": origin, "left_out": self.left_out},
        )


def _carried(kind: str, rate: float, jitter: float, error: float, noise: float) -> str:
    """One sensor's numbers of `Alignment.carried` for a person."""
    unit, scale = KINDS[kind]
    off = f", stamps {1e3 * jitter:.2g} ms off even readings" if jitter > SETTINGS.jitter else ""
    return (
        f"{kind} at {rate:.2f} Hz{off}, interpolation misses"
        f" {scale * error:.2g} {unit} where noise is {scale * noise:.2g}"
    )


def _with(value: float, sd: float) -> str:
    """A value with its sd to two digits; a bound where that is less than SMALLEST."""
    least = SETTINGS.smallest_sd
    if sd < least:
        return f"{value:.4f} +- < {least:.4f}" if value >= least else f"< {least:.4f}"
    digits = int(np.clip(1 - np.floor(np.log10(sd)), 0, 4))
    return f"{value:.{digits}f} +- {sd:.{digits}f}"
