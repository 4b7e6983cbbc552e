"""A recording arranged for its diagnosis: readings by IMU, which of them count, runs of time."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import NamedTuple, Self

import numpy as np
from numpy.polynomial.legendre import legvander
from scipy.ndimage import binary_dilation

from imuarray.engine.settings import SETTINGS
from imuarray.errors import InputError
from imuarray.geometry import Array
from imuarray.linear import shared_walk
from imuarray.model import ArrayModel
from imuarray.model.effects import KINDS
from imuarray.model.structure import design
from imuarray.recording import Recording, array_of


class ResidualMaps(NamedTuple):
    """Maps and offsets that a first-order correction left in the readings, as uncertain as it says.

    ``maps`` covariance (n, n) as `Recording.map_covariance`; ``offsets`` (N, 6, 4, 4) of each
    channel's offset as a polynomial of time, as `bias_drift` has it, of degree 0 where none
    ``walks``; ``removed`` (n,) inverses of the maps that were taken out, None where unknown.
    """

    maps: np.ndarray
    offsets: np.ndarray
    removed: np.ndarray | None = None

    @property
    def walks(self) -> bool:
        """True where some offset changes along the recording."""
        return bool(self.offsets[..., 1:, 1:].any())

    def is_of(self, other: Self) -> bool:
        """True where one calibration corrected both: each may have made it, begun with its own."""
        if self.maps.shape != other.maps.shape:
            return False
        if self.removed is None or other.removed is None:
            return np.array_equal(self.maps, other.maps)
        sds = np.sqrt(np.maximum(np.diag(self.maps), np.diag(other.maps)))
        return bool(
            np.all(np.abs(self.removed - other.removed) <= SETTINGS.same_maps * sds + SETTINGS.same)
        )


@dataclass(frozen=True)
class Readings:
    """T samples of N IMUs, six readings each: specific force x, y, z, angular rate x, y, z.

    Attributes
    ----------
    time : (T,) s since the recording's first sample; span : s, the recording's length
    values : (T, N, 6) m/s^2 and rad/s; zero where an IMU has no such triad
    keep : (T, N, 6) bool, readings to use
    exists : (N, 2) bool, which IMUs have an accelerometer and a gyroscope
    declared : (N, 2) declared noise sd, m/s^2 and rad/s
    sd : (N, 2) the noise sd in use
    run : (T,) number of the gapless run a sample is in
    origin : s, where time begins in the recording's own
    scale_sd : of a scale common to all gyroscopes, NaN where nothing is known of it
    left : `ResidualMaps`, or None where no correction was made
    gapless : bool, whether samples have neighbours that say something of time derivatives
    trust : (T, N, 2) square roots of a robust loss' weights, or None for all one
    period : s, of the clocks of sensors that have one, NaN where it is not declared
    clock_sd : relative, of the steps of time
    resolution : (N, 2) least step between a triad's readings
    clock_deviation : (T, N) turns by which clocks depart from a steady drift, or None for none
    labels : N str
    """

    array: Array
    time: np.ndarray
    span: float
    values: np.ndarray
    keep: np.ndarray
    exists: np.ndarray
    declared: np.ndarray
    sd: np.ndarray
    run: np.ndarray
    labels: tuple[str, ...]
    position_prior_sd: float
    gapless: bool = True
    origin: float = 0.0
    scale_sd: float = np.nan
    left: ResidualMaps | None = None
    trust: np.ndarray | None = None
    clock_deviation: np.ndarray | None = None
    period: float = np.nan
    clock_sd: float = 0.0
    resolution: np.ndarray | None = None

    @property
    def weights(self) -> np.ndarray:
        """Square roots of the readings' weights, (T, N, 6): 1 / sd, 0 where left out."""
        return self.weights_of(slice(None))

    def weights_of(self, index) -> np.ndarray:
        """Weights of some samples."""
        found = self.keep[index] / np.repeat(self.sd, 3, axis=1)
        return found if self.trust is None else found * np.repeat(self.trust[index], 3, axis=2)

    @property
    def stretch(self) -> int:
        """Samples of the stretches in which a long recording is looked at: several windows."""
        return max(SETTINGS.stretch, 3 * self.window)

    @property
    def pair(self) -> bool:
        """True where two accelerometers leave omega_dot open about the line that joins them."""
        return self.array.accelerometers == 2

    @property
    def clock_deviations(self) -> np.ndarray:
        """`clock_deviation`, zeros where there is none."""
        none = np.zeros(self.values.shape[:2])
        return none if self.clock_deviation is None else self.clock_deviation

    @property
    def window(self) -> int:
        """Samples in a derivative's polynomial, odd, at least five."""
        return odd_window(self.time)

    def with_sd(self, sd) -> Self:
        """The readings with another noise sd (N, 2)."""
        return self.with_noise(sd, self.trust)

    def with_noise(self, sd, trust) -> Self:
        """The readings with another noise sd (N, 2), and a robust loss' weights (T, N, 2) or None.

        Two triads of a kind share their sd: the motion leaves but their difference.
        """
        sd = np.array(sd, float)
        for kind in np.flatnonzero(self.exists.sum(axis=0) == 2):
            own = self.exists[:, kind]
            sd[own, kind] = np.sqrt(np.mean(sd[own, kind] ** 2))
        return replace(self, sd=sd, trust=trust)

    def unweighted(self) -> Self:
        """The readings with the same say each, where a robust loss had weighed them."""
        return self if self.trust is None else replace(self, trust=np.ones_like(self.trust))

    def without(self, lost) -> Self:
        """The readings without those in ``lost`` (T, N, 6) bool."""
        return replace(self, keep=self.keep & ~lost)

    def select(self, used) -> Self:
        """The samples in ``used`` (T,) bool, in new runs."""
        time = self.time[used]
        trust, turns = (None if p is None else p[used] for p in (self.trust, self.clock_deviation))
        return replace(
            self, time=time, values=self.values[used], keep=self.keep[used], run=runs(time),
            trust=trust, clock_deviation=turns,
        )  # fmt: skip


def determined(readings: Readings, fewest: int = SETTINGS.least_samples) -> np.ndarray:
    """(T,) bool: samples whose readings determine the motion, if gapless in runs that do its
    derivatives.

    Each axis has a gyroscope, and the accelerometers determine omega_dot and s. InputError where
    fewer than ``fewest`` are left.
    """
    positions = readings.array.relative
    rows = design(positions)[:, 6:]
    if readings.pair:
        rows = rows[:, 3:]  # of two, omega_dot is the gyroscopes' matter
    kept = readings.keep[:, : len(positions), :3].reshape(len(readings.time), -1)
    least, whole = (
        np.linalg.eigvalsh(np.einsum("tr,ri,rj->tij", part.astype(float), rows, rows))[:, 0]
        for part in (kept, np.ones_like(kept[:1]))
    )
    good = (least > SETTINGS.weakest * whole) & readings.keep[..., 3:].any(axis=1).all(axis=1)
    if good.all():
        return good
    used = _long_runs(readings.time, good) if readings.gapless else good
    if used.sum() < fewest:
        raise InputError(
            f"recording: expected at least {fewest} sample(s) whose readings determine the motion,"
            f" found {used.sum()} of {used.size}"
        )
    return used


def part_of(readings: Readings, most: int) -> Readings:
    """All of up to ``most`` samples; of more, stretches of so many in all, spread evenly."""
    samples = len(readings.time)
    if samples <= most:
        return readings
    stretch = np.arange(samples) // readings.stretch
    chosen = np.linspace(0, stretch[-1], -(-most // readings.stretch)).round()
    return _stretches(readings, stretch, np.isin(stretch, chosen))


def most_informative(readings: Readings, notify: Callable[[str], None]) -> Readings:
    """Stretches of a long recording that say most of the positions, by their rates' squares.

    A third of them for each coordinate: a board that spins for long about one axis tells two.
    """
    samples, most = len(readings.time), max(SETTINGS.most // len(readings.labels), 1)
    if samples <= most:
        return readings
    used = np.where(readings.keep[..., 3:], readings.values[..., 3:], np.nan)
    rate = np.nan_to_num(np.nanmedian(used, axis=1))
    squares = (rate @ np.linalg.eigh(rate.T @ rate)[1]) ** 2
    across = (squares.sum(axis=1, keepdims=True) - squares) ** 2
    stretch = np.arange(samples) // (readings.stretch if readings.gapless else 1)
    best = np.zeros(stretch[-1] + 1, bool)
    number = max(int(most / samples * len(best)), 3)
    for coordinate, told in enumerate(across.T):
        mean = np.bincount(stretch, told) / np.bincount(stretch)
        mean[best] = -1.0
        best[np.argsort(-mean)[: (number + coordinate) // 3]] = True
    notify(f"using the most informative {most} of {samples} samples")
    return _stretches(readings, stretch, best[stretch])


def _stretches(readings: Readings, stretch, used) -> Readings:
    """The samples ``used`` (T,) bool, each ``stretch`` (T,) of a run a run of its own."""
    chosen = np.flatnonzero(used)
    both = readings.run[chosen] * (stretch[-1] + 1) + stretch[chosen]
    if readings.gapless:
        long = run_lengths(both) >= readings.window
        chosen, both = chosen[long], both[long]
    return replace(readings.select(chosen), run=np.unique(both, return_inverse=True)[1])


def run_lengths(run) -> np.ndarray:
    """(T,) how many samples are of a sample's run."""
    number = np.unique(run, return_inverse=True)[1]
    return np.bincount(number)[number]


def resolution(values) -> np.ndarray:
    """(N, 2) least steps between readings (T, N, 6) along x; zero where they read in none.

    Gaps of a few steps must be many, and multiples but for a log's rounding: few readings, or
    finer ones, have some least gap by chance.
    """
    values = values[:: max(1, len(values) // SETTINGS.few), :, ::3]
    gaps = np.diff(np.sort(values, axis=0), axis=0)
    apart = gaps > SETTINGS.same
    least = np.min(gaps, axis=0, initial=np.inf, where=apart)
    counts = gaps / least
    near = apart & (counts < SETTINGS.few_steps)
    odd = near & (np.abs(counts - np.round(counts)) > SETTINGS.off_step)
    many = near.sum(axis=0) > SETTINGS.seldom * apart.sum(axis=0)
    return np.where(many & (odd.sum(axis=0) <= SETTINGS.seldom * near.sum(axis=0)), least, 0.0)


def few_at_once(far) -> np.ndarray:
    """Outliers (T, N, 2) bool without the samples where a quarter of a kind stands out at once.

    Those are events of the whole array, and leaving them out would leave no motion, which takes
    three triads.
    """
    number = far.shape[1]
    crowd = far.sum(axis=1, keepdims=True) > min(max(1, number // 4), max(0, number - 3))
    return far & ~crowd


def odd_window(time, length=SETTINGS.window) -> int:
    """Samples in so many seconds, odd, at least five."""
    return max(5, 2 * int(length / np.median(np.diff(time)) / 2) + 1)


def runs(time) -> np.ndarray:
    """Number of the gapless run each sample is in, (T,): a gap is 1.5 sampling periods."""
    step = np.diff(time)
    return np.concatenate([[0], np.cumsum(step > 1.5 * np.median(step))])


def by_imu(force, rate) -> np.ndarray:
    """(T, N, 6) from (T, A, 3) and (T, G, 3), zero where a triad does not exist."""
    count = max(force.shape[1], rate.shape[1])
    out = np.zeros((len(force), count, 6), force.dtype)
    out[:, : force.shape[1], :3] = force
    out[:, : rate.shape[1], 3:] = rate
    return out


def by_triad(values) -> np.ndarray:
    """(T, N, 2) sums over the axes of (T, N, 6)."""
    return values.reshape(*values.shape[:2], 2, 3).sum(axis=-1)


def arrange(recording: Recording, sparse: bool = False) -> Readings:
    """`Readings` of the moving samples whose motion is seen; InputError where too few are left.

    Samples where some axis has no gyroscope off its rail are left out, as are their neighbours,
    still poses, and runs too short for a time derivative; where few samples are in runs, these
    are kept too if ``sparse``.
    """
    array = array_of(recording)
    force, rate = recording.saturated_accelerometers(), recording.saturated_gyroscopes()
    blind = rate.all(axis=1).any(axis=1)
    bad = binary_dilation(blind) | recording.still()
    used = _long_runs(recording.time, ~bad)
    step = np.median(np.diff(recording.time)) if len(bad) > 1 else np.inf
    dense = used.sum() > SETTINGS.dense * np.sum(~bad) and step < SETTINGS.longest_step
    gapless = bool(dense or not sparse)
    used = used if gapless else ~bad
    least = 1 if sparse else SETTINGS.least_samples
    if used.sum() < least:
        raise InputError(
            f"recording: expected at least {least} moving samples off the rails"
            f"{' in gapless runs' * gapless}, found {used.sum()} of {used.size}"
        )
    kinds = recording.specific_force.shape[1], recording.angular_rate.shape[1]
    count = max(kinds)
    exists = np.arange(count)[:, None] < np.array(kinds)
    noise = recording.accelerometer_noise_sd, recording.gyroscope_noise_sd
    lost = by_imu(force, rate)[used]
    longer = recording.accelerometer_labels if kinds[0] == count else recording.gyroscope_labels
    time = recording.time - recording.time[0]
    values = by_imu(recording.specific_force, recording.angular_rate)[used]
    return Readings(
        array, time[used], float(time[-1]) or 1.0, values,
        ~lost & np.repeat(exists, 3, axis=1), exists, np.tile(noise, (count, 1)),
        np.tile(noise, (count, 1)), runs(time[used]), tuple(longer), recording.position_prior_sd,
        gapless, float(recording.time[0]), recording.gyroscope_common_scale_sd,
        _left(recording, count), period=recording.output_period,
        clock_sd=float(np.nan_to_num(recording.clock_sd)), resolution=resolution(values),
    )  # fmt: skip


def _left(recording: Recording, count: int) -> ResidualMaps | None:
    if recording.map_covariance is None:
        return None
    offsets, removed = np.zeros((2, count, 3, 4, 4)), None
    if recording.correction is not None:
        inverses = [recording.correction[f"{kind}_inverse"].to_numpy().ravel() for kind in KINDS]
        removed = np.concatenate(inverses)[: len(recording.map_covariance)]
        course = _course(recording)
        for kind, own in zip(KINDS, offsets, strict=True):
            inverse, sd, walk = (
                np.nan_to_num(recording.correction[f"{kind}_{name}"].to_numpy())
                for name in ("inverse", "offset_sd", "offset_walk")
            )
            variance = np.einsum("kij,kj->ki", inverse**2, sd**2)
            own[: len(sd), :, 0, 0] = variance
            own[: len(sd)] += walk[:, None, None, None] ** 2 * course
    by_imu = np.moveaxis(offsets, 0, 1).reshape(count, 6, 4, 4)
    return ResidualMaps(recording.map_covariance, by_imu, removed)


def _course(recording: Recording) -> np.ndarray:
    """(4, 4) covariance of polynomials laid through a walk of 1 a second, known where it moves."""
    time = recording.time[~recording.still()]
    time = np.quantile(time, np.linspace(0, 1, SETTINGS.walk_instants))
    whole = recording.time[-1] - recording.time[0] or 1.0
    back = np.linalg.pinv(legvander(2 * (time - recording.time[0]) / whole - 1, 3))
    return back @ shared_walk(time - np.median(time)) @ back.T


def measured(
    model: ArrayModel, specific_force, angular_rate, saturated=None, time=None
) -> Readings:  # fmt: skip
    """`Readings` of all samples (T, A, 3) m/s^2, (T, G, 3) rad/s as they are, the model's noise.

    ``saturated`` (T, G, 3) bool: gyroscope axes at the rail, left out; ``time`` (T,) s. InputError
    where the axes of a triad differ in their noise, or triads' noise is correlated.
    """
    counts = model.array.accelerometers, model.array.gyroscopes
    sds, exists = np.ones((max(counts), 2)), np.arange(max(counts))[:, None] < np.array(counts)
    for kind, covariance in enumerate((model.noise.accelerometer, model.noise.gyroscope)):
        variances = np.diag(covariance)[::3]
        if not np.array_equal(covariance, np.diag(np.repeat(variances, 3))):
            raise InputError("noise: expected one sd for each triad, found a covariance")
        sds[: len(variances), kind] = np.sqrt(variances)
    force, rate = np.asarray(specific_force, float), np.asarray(angular_rate, float)
    lost = np.zeros(rate.shape, bool) if saturated is None else np.asarray(saturated, bool)
    keep = ~by_imu(np.zeros(force.shape, bool), lost) & np.repeat(exists, 3, axis=1)
    since, span = model.since(len(force), time)
    run = runs(since) if time is not None and len(since) > 1 else np.zeros(len(since), int)
    return Readings(
        model.array, since, span, by_imu(force, rate), keep, exists, sds, sds, run,
        model.array.labels, np.nan, False,
    )  # fmt: skip


def _long_runs(time, good) -> np.ndarray:
    """Good samples in gapless runs of at least a derivative's window, (T,) bool."""
    kept = np.zeros_like(good)
    if good.sum() > 1:
        # what is left out ends a run, too
        run = (runs(time) + np.cumsum(~good))[good]
        kept[good] = run_lengths(run) >= odd_window(time)
    return kept
