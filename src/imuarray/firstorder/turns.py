"""Orthogonal matrices nearest to a linear map; which axis has the wrong sign where one reflects."""

import numpy as np

from imuarray.errors import InputError

TURNED = np.radians(5.0)  # more than a mount is off by accident


def nearest_orthogonal(matrix) -> np.ndarray:
    """Polar factors of matrices (..., 3, 3): rotations, or reflections where det < 0."""
    left, _, right = np.linalg.svd(matrix)
    return left @ right


def procrustes(readings, reference) -> np.ndarray:
    """Orthogonal Q (3, 3) with readings (P, 3) = Q reference (P, 3) + offset, by least squares.

    A reflection only where the data leave no doubt: all three directions are in them.
    """
    first, second = (x - x.mean(axis=0) for x in (readings, reference))
    left, values, right = np.linalg.svd(first.T @ second)
    if values[2] < 1e-2 * values[0]:
        left[:, 2] *= np.sign(np.linalg.det(left @ right))
    return left @ right


def require_rotations(maps, labels, kind: str) -> None:
    """InputError, with triad and axis, where any of (K, 3, 3) maps of axes onto others reflects.

    ``maps[k]`` leads from what triad k should read to what it reads. Where most reflect, it is the
    first one, which they are compared with, that does.
    """
    wrong = np.linalg.det(maps) < 0
    if not wrong.any():
        return
    if 2 * wrong.sum() > len(maps):
        k, seen = 0, maps[np.argmax(wrong)].T
    else:
        k = int(np.argmax(wrong))
        seen = maps[k]
    axis = "xyz"[int(np.argmin(np.diag(seen)))]
    raise InputError(
        f"{kind} {labels[k]!r}: expected right-handed axes, found those of a mirror image; is the"
        f" sign of its {axis} axis wrong, or are two axes exchanged?"
    )


def shared_turn(rotations) -> np.ndarray:
    """The one of rotations (K, 3, 3) that more than half of them agree with, or the identity."""
    apart = angle_of(np.swapaxes(rotations, 1, 2)[:, None] @ rotations)
    agree = (apart < TURNED).sum(axis=1)
    most = int(np.argmax(agree))
    common = 2 * agree[most] > len(rotations) and angle_of(rotations[most]) > TURNED
    return rotations[most] if common else np.eye(3)


def angle_of(rotations) -> np.ndarray:
    """Angles (...) rad of rotations (..., 3, 3)."""
    return np.arccos(np.clip((np.einsum("...ii", rotations) - 1) / 2, -1.0, 1.0))
