"""Noise of each triad by restricted likelihood, and how far it is from normal: Student's t.

A triad's three readings of a sample share one weight, (nu + 3) / (nu + d^2) at a squared distance
d^2: normal noise keeps weights near one, a reading far out loses its say.
"""

import numpy as np
from scipy.special import gammaln

from imuarray.engine.passes import Pass
from imuarray.engine.readings import Readings

FREEDOMS = np.array([3.0, 4.0, 6.0, 10.0, 20.0, 50.0, np.inf])
ROUNDS = 20  # of the scale that goes with each of them
LEAST = 1e-4  # of the declared noise
MEDIAN = 2.37  # of chi-square of three readings


def judged(readings: Readings, seen: Pass, owned, former: np.ndarray) -> Readings:
    """The readings with each triad's scale and weights as the residual of a pass shows them.

    ``owned`` (N, 2): parameters that a triad's readings have paid for. ``former`` (2,): degrees of
    freedom of t; infinite for normal noise.
    """
    free = seen.freedom.sum(axis=0)
    free = np.maximum(free - owned, 0.1 * free)
    number = readings.keep.reshape(*readings.keep.shape[:2], 2, 3).sum(axis=-1)
    trust = 1.0 if readings.trust is None else readings.trust
    squares, distance = seen.squares / trust**2, distances(readings, seen)
    ratio, weight, least = np.ones_like(free), np.ones_like(distance), least_ratio(readings)
    for kind, nu in enumerate(former):
        own = readings.exists[:, kind] & (free[:, kind] > 0)
        d, n, s = (part[:, own, kind] for part in (distance, number, squares))
        if not np.isfinite(nu):
            ratio[own, kind] = np.maximum(s.sum(axis=0) / free[own, kind], least[own, kind])
            continue
        scale = np.maximum(np.median(d, axis=0) / MEDIAN, least[own, kind])
        for _ in range(ROUNDS):
            scale = np.sum((nu + n) / (nu + d / scale) * s, axis=0) / free[own, kind]
            scale = np.maximum(scale, least[own, kind])
        ratio[own, kind], weight[:, own, kind] = scale, (nu + n) / (nu + d / scale)
    sd = readings.sd * np.sqrt(ratio)
    return readings.with_noise(sd, np.sqrt(weight) if np.isfinite(former).any() else None)


def least_ratio(readings: Readings) -> np.ndarray:
    """The least ratio (N, 2) of a triad's noise variance to that in use.

    Sensors that read in coarse steps may agree to the last digit, which is not without error.
    """
    steps = 0.0 if readings.resolution is None else readings.resolution / np.sqrt(12.0)
    return (np.maximum(steps, LEAST * readings.declared) / readings.sd) ** 2


def distances(readings: Readings, seen: Pass) -> np.ndarray:
    """Squared residuals of each triad in its own sds, its weight taken off, (T, N, 2)."""
    return seen.unit if readings.trust is None else seen.unit / readings.trust**2


def freedoms(readings: Readings, seen: Pass) -> np.ndarray:
    """Degrees of freedom (2,) that make the triads' distances likeliest, of each kind of sensor."""
    number = readings.keep.reshape(*readings.keep.shape[:2], 2, 3).sum(axis=-1)
    found, far = np.full(2, np.inf), distances(readings, seen)
    told = np.median(far, axis=0) / MEDIAN > least_ratio(readings)
    for kind in range(2):
        used = (number[..., kind] == 3) & told[:, kind]
        if used.any():
            d = far[..., kind][used]
            found[kind] = FREEDOMS[np.argmax([_log_likelihood(d, nu) for nu in FREEDOMS])]
    return found


def _log_likelihood(d, nu) -> float:
    """Of squared distances (n,) of three readings each, at the scale that suits them best."""
    scale = np.mean(d) / 3
    if np.isinf(nu):
        return float(-1.5 * len(d) * np.log(scale) - np.sum(d) / (2 * scale))
    for _ in range(ROUNDS):
        scale = np.mean((nu + 3) / (nu + d / scale) * d) / 3
    constant = gammaln((nu + 3) / 2) - gammaln(nu / 2) - 1.5 * np.log(nu / 2)
    tail = (nu + 3) / 2 * np.log1p(d / (nu * scale))
    return float(np.sum(constant - tail) - 1.5 * len(d) * np.log(scale))
