"""Logarithms of tail probabilities by scipy.special: scipy.stats is slow to import."""

import numpy as np
from scipy import special

QUARTILE = special.ndtri(0.75)  # of a standard normal: the median of |z|
MEDIAN = 2.37  # of chi-square of three readings


def log_normal(z):
    """log P(Z > z) of a standard normal."""
    return special.log_ndtr(-np.asarray(z))


def log_chi_square(statistic, freedom) -> float:
    """log of the chi-square's tail, also where the tail itself underflows."""
    tail = special.chdtrc(freedom, statistic)
    if tail > 1e-280:
        return float(np.log(tail))
    a, x = freedom / 2, statistic / 2
    return float((a - 1) * np.log(x) - x - special.gammaln(a) - np.log1p(-(a - 1) / x))


def t4(squares, size) -> tuple[np.ndarray, np.ndarray]:
    """(weights, slopes) of three readings' scores by their sums of ``squares`` (n,).

    Student's t with 4 degrees of freedom, ``size`` its variance; slopes fall more than weights, as
    these change with the residuals, too.
    """
    weight = 7.0 / (4.0 + squares / size)
    return weight, weight * (1 - 2 / 3 * squares / (4 * size + squares))


def log_poisson(count, expected):
    """log P(N >= count), 0 where count is; -inf where the tail underflows."""
    with np.errstate(divide="ignore"):
        tail = np.log(special.pdtrc(np.maximum(np.asarray(count) - 1, 0), expected))
    return np.where(np.asarray(count) > 0, tail, 0.0)
