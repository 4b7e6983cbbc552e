"""The noise of a recording's longest still stretches: Allan deviation, spectrum, terms.

White noise on a random walk of any start is diagonal in the discrete cosine transform, so what is
fitted is the exact likelihood of coefficients that are independent and normal.
"""

from typing import NamedTuple

import numpy as np
import pandas as pd
from scipy.fft import dct
from scipy.optimize import nnls
from scipy.special import chdtrc

from imuarray.errors import InputError
from imuarray.firstorder.report import allan_table, axes_table
from imuarray.firstorder.settings import SETTINGS
from imuarray.firstorder.still import still_poses
from imuarray.recording import Recording
from imuarray.recording.record import KINDS

WHITE, FLICKER, WALK = range(3)
TERMS = ("noise_density", "bias_instability", "random_walk")
UNITS = {
    "accelerometer": ("m s-2 Hz-1/2", "m s-2", "m s-3 Hz-1/2"),
    "gyroscope": ("rad s-1 Hz-1/2", "rad s-1", "rad s-2 Hz-1/2"),
}
OPEN = "left open: not seen in a record of this length"


class Spectrum(NamedTuple):
    """Powers in bins of an eighth of an octave.

    Attributes
    ----------
    frequency : (F,) Hz, means of the bins
    power : (F, ...) unit^2/Hz, two-sided: white noise of density N lies at N^2
    count : (F,) coefficients in each
    shape : (F, 3) power of white noise, flicker and random walk of size 1 (IEEE Std 952, C)
    """

    frequency: np.ndarray
    power: np.ndarray
    count: np.ndarray
    shape: np.ndarray


class Terms(NamedTuple):
    """Noise terms N (unit Hz^-1/2), B (unit), K (unit s^-1 Hz^-1/2), each (3, ...).

    ``value`` and ``sd`` are NaN where the readings do not show the term; ``below`` is then what it
    stays below with 95 %, NaN where it shows.
    """

    value: np.ndarray
    sd: np.ndarray
    below: np.ndarray


def spectrum(pieces, step: float) -> Spectrum:
    """Spectrum of still pieces (n, ...), readings ``step`` s apart, pooled."""
    lowest = 0.5 / (step * max(len(piece) for piece in pieces))
    size = int(SETTINGS.bins * np.log2(0.5 / step / lowest)) + 1
    count, sums = np.zeros(size), np.zeros((size, 4))
    power = np.zeros((size, *pieces[0].shape[1:]))
    for piece in pieces:
        squares = step * dct(piece, axis=0, norm="ortho")[1:] ** 2
        frequency = np.arange(1, len(piece)) / (2 * step * len(piece))
        place = np.minimum(SETTINGS.bins * np.log2(frequency / lowest) + 1e-9, size - 1).astype(int)
        begin = np.flatnonzero(np.diff(place, prepend=-1))
        walk = (step / (2 * np.sin(np.pi * frequency * step))) ** 2
        shape = np.stack([frequency, np.ones_like(walk), 1 / (2 * np.pi * frequency), walk], axis=1)
        count[place[begin]] += np.diff(begin, append=len(place))
        sums[place[begin]] += np.add.reduceat(shape, begin)
        power[place[begin]] += np.add.reduceat(squares, begin)
    there = count > 0
    count, means = count[there], sums[there] / count[there, None]
    power = power[there] / count.reshape(-1, *(1,) * (power.ndim - 1))
    return Spectrum(means[:, 0], power, count, means[:, 1:])


def noise_terms(found: Spectrum, rate: float) -> Terms:
    """White noise, bias instability and random walk by maximum likelihood; ``rate`` in Hz.

    Flicker and walk are there where the likelihood gains by them as by three sds. Lines are left
    out; where the spectrum scatters more than chance allows, sds and that limit grow.
    """
    slow = found.frequency <= rate / SETTINGS.slowest
    own = found.power.shape[1:]
    flat = found.power[slow].reshape(slow.sum(), -1).T
    terms = np.array([_one(powers, found.count[slow], found.shape[slow]) for powers in flat])
    return Terms(*np.moveaxis(terms, 0, 2).reshape(3, 3, *own))


class _Fit(NamedTuple):
    squares: np.ndarray  # (3,) of the terms
    sd: np.ndarray  # (3,) of those; infinite of terms that are not fitted
    nats: float
    scatter: float  # of the powers, 1 by chance


def _one(power, count, shape) -> np.ndarray:
    """Value, sd and limit (3, 3) of one axis."""
    kept = _without_lines(power, count, shape)
    power, count, shape = power[kept], count[kept], shape[kept]
    terms, best = [WHITE], _fit(power, count, shape, [WHITE])
    while len(terms) < 3:
        tried = [sorted([*terms, new]) for new in (FLICKER, WALK) if new not in terms]
        fits = [_fit(power, count, shape, some) for some in tried]
        # where a record cannot tell them apart, the one that filters know
        nats = [
            f.nats + SETTINGS.noise_close * (WALK in some)
            for f, some in zip(fits, tried, strict=True)
        ]
        most = int(np.argmax(nats))
        if fits[most].nats - best.nats < SETTINGS.noise_gain * max(fits[most].scatter, 1.0):
            break
        terms, best = tried[most], fits[most]
    value, sd, below = np.full((3, 3), np.nan)
    size = np.sqrt(best.squares[terms])
    value[terms], sd[terms] = size, best.sd[terms] / (2 * size)
    whole = _fit(power, count, shape, [WHITE, FLICKER, WALK])
    # a term that is left open may be a part of those that are not
    sd[terms] = np.maximum(sd[terms], whole.sd[terms] / (2 * size))
    for term in {FLICKER, WALK} - set(terms):
        below[term] = np.sqrt(_limit(power, count, shape, term, whole))
    return np.array([value, sd, below])


def _limit(power, count, shape, term, whole) -> float:
    """The square that a term stays below: larger ones, the others refitted, are too unlikely."""
    others = [other for other in (WHITE, FLICKER, WALK) if other != term]
    least = whole.nats - SETTINGS.one_sided * max(whole.scatter, 1.0)
    low, high = whole.squares[term], whole.squares[term] + SETTINGS.limit_farthest * whole.sd[term]
    for _ in range(SETTINGS.limit_halvings):
        middle = np.sqrt(max(low, high / SETTINGS.limit_farthest**2) * high)
        fit = _fit(power, count, shape, others, middle * shape[:, term])
        low, high = (middle, high) if fit.nats > least else (low, middle)
    return high


def _without_lines(power, count, shape) -> np.ndarray:
    """Bins (F,) that all terms together explain: vibration and beats are no noise."""
    kept = np.ones(len(power), bool)
    for _ in range(10):
        fit = _fit(power[kept], count[kept], shape[kept], [WHITE, FLICKER, WALK])
        line = kept & (chdtrc(count, count * power / (shape @ fit.squares)) < SETTINGS.line)
        if not line.any() or kept.sum() - line.sum() < len(kept) / 2:
            break
        kept &= ~line
    return kept


def _fit(power, count, shape, terms, beside=0.0) -> _Fit:
    """Squares of ``terms`` that are not negative: scoring, each step weighted least squares.

    ``beside`` (F,): power that is there in any case.
    """
    unit = np.median(power)  # nothing of the readings' own unit is left
    powers, design = power / unit, shape[:, terms] / shape[:, terms].max(axis=0)
    model, best = np.ones_like(powers), (-np.inf, np.zeros(len(terms)), powers)
    beside = beside / unit * np.ones_like(powers)
    for _ in range(100):
        weight = np.sqrt(count / 2) / model
        squares, _ = nnls(design * weight[:, None], (powers - beside) * weight)
        model = np.maximum(design @ squares + beside, 1e-9)
        nats = -np.sum(count * (np.log(model) + powers / model)) / 2
        gained = nats - best[0]
        if gained > 0:
            best = nats, squares, model
        if abs(gained) < 1e-6:
            break
    nats, squares, model = best
    weighted = design * (np.sqrt(count / 2) / model)[:, None]
    freedom = max(len(count) - len(terms), 1)
    scatter = float(np.sum(count / 2 * (powers / model - 1) ** 2)) / freedom
    scale = unit / shape[:, terms].max(axis=0)
    out, sd = np.zeros(3), np.full(3, np.inf)
    covariance = np.linalg.inv(weighted.T @ weighted)
    out[terms] = squares * scale
    sd[terms] = np.sqrt(np.diag(covariance) * max(scatter, 1.0)) * scale
    return _Fit(out, sd, nats, scatter)


class StillNoise(NamedTuple):
    """Noise of each axis of each sensor, SI units, as tables with sensor, triad and axis.

    Attributes
    ----------
    deviation : DataFrame
        Overlapping Allan deviation: ``tau_s``, ``deviation`` and its ``sd``.
    spectrum : DataFrame
        ``frequency_hz`` and ``density`` per root Hz, two-sided: white noise lies at N.
    terms : DataFrame
        ``term``: ``noise_density`` N, ``bias_instability`` B (its floor is 0.664 B) and
        ``random_walk`` K; ``value`` and ``sd``, NaN where ``says`` leaves it open, ``below``
        (95 %) then; ``unit``.
    rate_hz : float, of the readings
    stretches_s : tuple of float, how long the still stretches are
    """

    deviation: pd.DataFrame
    spectrum: pd.DataFrame
    terms: pd.DataFrame
    rate_hz: float
    stretches_s: tuple[float, ...]


def allan(recording: Recording) -> StillNoise:
    """Noise density, bias instability and random walk from the longest still stretches.

    IEEE Std 952-1997, annex C: the Allan variance is N^2 / tau + (2 ln 2 / pi) B^2 + K^2 tau / 3.
    The terms are fitted by maximum likelihood to the spectrum below a sixteenth of the rate.
    InputError where nothing is still, or nothing long enough.
    """
    poses = still_poses(recording)
    longest = max(pose.stop - pose.start for pose in poses)
    poses = [pose for pose in poses if pose.stop - pose.start >= SETTINGS.long_stretch * longest]
    rate = float(f"{1 / np.median(np.diff(recording.time)):.10g}")
    lengths = [pose.stop - pose.start for pose in poses]
    least = SETTINGS.least_coefficients * SETTINGS.slowest // 2
    if sum(lengths) < least:
        raise InputError(
            f"recording: expected still stretches of {least} samples at least, found {sum(lengths)}"
        )
    spectra, terms = [], []
    for kind, units in UNITS.items():
        found = spectrum([getattr(recording, KINDS[kind])[pose] for pose in poses], 1 / rate)
        density = {"density": np.sqrt(found.power)}
        spectra.append(axes_table(density, recording, kind, frequency_hz=found.frequency))
        fitted = noise_terms(found, rate)._asdict()
        table = axes_table(fitted, recording, kind, term=TERMS)
        table["unit"] = table.term.map(dict(zip(TERMS, units, strict=True)))
        terms.append(table)
    table = pd.concat(terms, ignore_index=True)
    table["says"] = np.where(table.value.isna(), OPEN, "")
    return StillNoise(
        allan_table(poses, recording), pd.concat(spectra, ignore_index=True), table, rate,
        tuple(length / rate for length in lengths),
    )  # fmt: skip
