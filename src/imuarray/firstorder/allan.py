"""Allan deviation of still readings: which part of the noise averaging can remove."""

import numpy as np


def allan_deviation(pieces, step: float) -> tuple[np.ndarray, np.ndarray]:
    """Overlapping Allan deviation pooled over still pieces.

    Parameters
    ----------
    pieces : list of (n, ...) arrays, readings of still poses, equally spaced
    step : float, s, between samples

    Returns
    -------
    taus (S,) s, octaves up to a third of the longest piece, and deviations (S, ...) in the
    readings' unit. Each piece counts with its number of overlapping differences; pieces shorter
    than 2 tau + 1 samples do not count.
    """
    longest = max(len(piece) for piece in pieces)
    widths = 2 ** np.arange(int(np.log2(max(longest / 3, 1))) + 1)
    widths = widths[2 * widths < longest]
    sums = [np.concatenate([np.zeros((1, *x.shape[1:])), np.cumsum(x - x.mean(0), 0)])
            for x in pieces]  # fmt: skip
    deviations = []
    for n in widths:
        total, count = 0.0, 0
        for s in sums:
            if len(s) > 2 * n:
                second = (s[2 * n :] - 2 * s[n:-n] + s[: -2 * n]) / n
                total, count = total + np.sum(second**2, axis=0), count + len(second)
        deviations.append(np.sqrt(total / (2 * count)))
    return widths * step, np.array(deviations)


def white_noise_sd(pieces) -> np.ndarray:
    """Noise sd of one reading, (...), from differences of neighbours, blind to slow drift."""
    differences = np.concatenate([np.diff(piece, axis=0) for piece in pieces])
    return np.sqrt(np.mean(differences**2, axis=0) / 2)


def lag_correlation(pieces, lag: int = 1) -> np.ndarray:
    """Correlation of readings ``lag`` samples apart, (...); zero for white noise."""
    centred = [piece - piece.mean(axis=0) for piece in pieces]
    products = np.concatenate([x[lag:] * x[:-lag] for x in centred])
    squares = np.concatenate([x**2 for x in centred])
    return products.mean(axis=0) / squares.mean(axis=0)
