"""Gyroscopes against each other: how each one is turned, scaled and skewed beside their mean."""

from typing import NamedTuple

import numpy as np

from imuarray.errors import InputError
from imuarray.firstorder.turns import nearest_orthogonal, require_rotations

SLOWEST = np.radians(20.0)  # rad/s; slower samples say little of scales
FEWEST = 100  # moving samples
FLATTEST = 1e-3  # smallest share of the weakest axis in the mean squared rate
SIZES = 0.5, 2.0  # of one gyroscope's rates over another's; beyond, a channel is not what it says
BLOCK = 1.0  # s, within which residuals may be alike
ROBUST_STEPS = 5


class Relative(NamedTuple):
    """Each gyroscope's reading, free of its offset, is ``turn @ map @ mean``.

    ``turn`` (G, 3, 3) rotations onto the mean's frame, ``map`` (G, 3, 3) of mean the identity,
    ``covariance`` (G, 9, 9) of the maps row by row, ``samples`` how many they are from.
    """

    turn: np.ndarray
    map: np.ndarray
    covariance: np.ndarray
    samples: int


def compare(rate, time, usable, turn, labels) -> Relative | str:
    """Relative maps by least squares, or why there are none.

    Parameters
    ----------
    rate : (T, G, 3) rad/s, offsets taken out
    time : (T,) s
    usable : (T,) bool, neither still nor at a rail
    turn : (G, 3, 3) how far each is believed to be turned against the array's frame
    labels : of the gyroscopes

    InputError for one that is mirrored, or whose readings are no rates like the others'.
    """
    first = np.einsum("kji,tkj->tki", turn, rate)
    usable = usable & (np.linalg.norm(np.median(first, axis=1), axis=1) > SLOWEST)
    # a derivative needs both neighbours
    usable[1:-1] &= np.diff(time)[1:] < 1.5 * np.median(np.diff(time))
    usable[1:-1] &= np.diff(time)[:-1] < 1.5 * np.median(np.diff(time))
    usable[[0, -1]] = False
    if usable.sum() < FEWEST:
        return f"fewer than {FEWEST} moving samples off the rails"
    if _flat(first[usable]):
        return "the array was turned about one or two axes only"
    turn = turn @ _turns(first[usable], turn, labels)
    aligned = np.einsum("kji,tkj->tki", turn, rate)
    maps, covariance = _maps(aligned, time, usable)
    return Relative(turn, maps, covariance, int(usable.sum()))


def _flat(rate) -> bool:
    values = np.linalg.eigvalsh(np.einsum("tki,tkj->kij", rate, rate))
    return bool(np.median(values[:, 0] / values[:, 2]) < FLATTEST)


def _turns(rate, turn, labels) -> np.ndarray:
    """Rotation (G, 3, 3) of each against the one that agrees best with all, by their rates."""
    count = rate.shape[1]
    flat = rate.reshape(len(rate), -1)
    products = (flat.T @ flat).reshape(count, 3, count, 3).swapaxes(1, 2)
    own = products[range(count), range(count)]
    # how l's rates become k's, by least squares; a dead axis has no inverse
    maps = np.einsum("klij,ljm->klim", products, np.linalg.pinv(own, hermitian=True))
    middle = np.argmin(np.median(np.linalg.norm(maps - np.eye(3), axis=(2, 3)), axis=1))
    seen = maps[:, middle]
    sizes = np.linalg.norm(turn @ seen, axis=2)
    wrong = np.argwhere((sizes < SIZES[0]) | (sizes > SIZES[1]))
    if len(wrong):
        k, axis = wrong[0]
        raise InputError(
            f"gyroscope {labels[k]!r}: expected angular rates like the others', found its"
            f" {'xyz'[axis]} axis to read {round(sizes[k, axis], 3):.3g} times theirs"
        )
    found = nearest_orthogonal(seen)
    require_rotations(turn @ found @ np.swapaxes(turn, 1, 2), labels, "gyroscope")
    return found


def _maps(rate, time, usable) -> tuple[np.ndarray, np.ndarray]:
    """Each gyroscope on the mean of all, robustly.

    The mean's derivatives are beside it: a gyroscope that is read late would seem too small.
    """
    mean = rate.mean(axis=1)
    slope = np.gradient(mean, time, axis=0)
    columns = np.hstack([mean, slope, np.gradient(slope, time, axis=0)])[usable]
    columns /= np.sqrt(np.mean(columns**2, axis=0))
    size = np.sqrt(np.mean(mean[usable] ** 2, axis=0))
    block = (time[usable] // BLOCK).astype(int)
    found = [_regress(columns, rate[usable, k], block) for k in range(rate.shape[1])]
    maps = np.array([solution[:, :3] / size for solution, _ in found])
    back = np.tile(1 / size, 3)
    return maps, np.array([cov * np.outer(back, back) for _, cov in found])


def _regress(columns, wanted, block) -> tuple[np.ndarray, np.ndarray]:
    """Rows (3, 9) with wanted = columns @ rows', by Student-t weights; covariance of their first 3.

    The covariance allows residuals within one block of time to be alike.
    """
    weight = np.ones(len(wanted))
    for _ in range(ROBUST_STEPS):
        normal = (columns * weight[:, None]).T @ columns
        inverse = np.linalg.pinv(normal, hermitian=True)
        rows = (inverse @ (columns * weight[:, None]).T @ wanted).T
        left = wanted - columns @ rows.T
        squares = np.sum(left**2, axis=1)
        # 2.37 is the median of a chi-squared variable with three degrees of freedom
        size = np.median(squares) / 2.37
        weight = 7.0 / (4.0 + squares / size)
    # the scores' slope: weights fall as residuals grow
    bend = weight * (1 - 2 / 3 * squares / (4 * size + squares))
    inverse = np.linalg.pinv((columns * bend[:, None]).T @ columns, hermitian=True)
    _, block = np.unique(block, return_inverse=True)
    scores = np.zeros((block.max() + 1, 3, columns.shape[1]))
    np.add.at(scores, block, weight[:, None, None] * left[:, :, None] * columns[:, None])
    scores = scores @ inverse
    covariance = np.einsum("bim,bjn->imjn", scores[..., :3], scores[..., :3]).reshape(9, 9)
    return rows, covariance * len(scores) / max(len(scores) - 9, 1)
