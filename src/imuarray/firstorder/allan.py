"""Allan deviation of still readings: which part of the noise averaging can remove."""

import numpy as np

WINDOW, BLOCK = 1.0, 0.25  # s


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
    widths = widths[2 * widths <= longest]
    sums = [_sums(piece) for piece in pieces]
    return widths * step, np.array([_deviation(sums, n) for n in widths])


def _sums(piece) -> np.ndarray:
    """Of its readings less their mean, before each of them and after all."""
    return np.concatenate([np.zeros((1, *piece.shape[1:])), np.cumsum(piece - piece.mean(0), 0)])


def _deviation(sums, width: int) -> np.ndarray:
    """Of averages over ``width`` samples, from the pieces that are long enough."""
    total, count = 0.0, 0
    for s in sums:
        if len(s) > 2 * width:
            second = (s[2 * width :] - 2 * s[width:-width] + s[: -2 * width]) / width
            total, count = total + np.sum(second**2, axis=0), count + len(second)
    return np.sqrt(total / (2 * count))


def reading_sd(pieces, step: float) -> np.ndarray:
    """Noise sd of one reading, (...), within WINDOW: blind to what drifts more slowly."""
    squares, freedom = 0.0, 0
    for piece in pieces:
        count = max(round(len(piece) * step / WINDOW), 1)
        for part in np.array_split(piece, count):
            squares = squares + np.sum((part - part.mean(axis=0)) ** 2, axis=0)
            freedom += len(part) - 1
    return np.sqrt(squares / max(freedom, 1))


def averaged_sd(pieces, step: float) -> np.ndarray:
    """Sd of white noise of which averages scatter as those of BLOCK do, (...).

    Behind a filter neighbours are alike: averages scatter more than one reading's sd says.
    """
    usual = int(np.median([len(piece) for piece in pieces]))
    width = max(min(round(BLOCK / step), usual // 4), 1)
    return _deviation([_sums(piece) for piece in pieces], width) * np.sqrt(width)


def lag_correlation(pieces, lag: int = 1) -> np.ndarray:
    """Correlation of readings ``lag`` samples apart, (...); zero for white noise."""
    centred = [piece - piece.mean(axis=0) for piece in pieces]
    products = np.concatenate([x[lag:] * x[:-lag] for x in centred])
    squares = np.concatenate([x**2 for x in centred])
    return products.mean(axis=0) / squares.mean(axis=0)
