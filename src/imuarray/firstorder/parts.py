"""Scale, misalignment and orientation of a sensor's 3 x 3 matrix, and how well they are known."""

from __future__ import annotations

import numpy as np
from scipy.linalg import rq

SKEW = np.triu_indices(3, 1)


def parts_of(matrices) -> dict[str, np.ndarray]:
    """Scale, misalignment (xy, xz, yz) and orientation (rotation vector) of (K, 3, 3), (K, 3)."""
    values = [_parts(matrix) for matrix in matrices]
    return {name: np.array([value[name] for value in values]) for name in values[0]}


def parts_sd_of(matrices, covariances) -> dict[str, np.ndarray]:
    """Their sds, (K, 3) each, with the covariances (K, 9, 9) of the matrices row by row."""
    out: dict[str, list] = {}
    for matrix, covariance in zip(matrices, covariances, strict=True):
        for name, slope in _part_slopes(matrix).items():
            out.setdefault(name, []).append(np.sqrt(np.diag(slope @ covariance @ slope.T)))
    return {name: np.array(value) for name, value in out.items()}


def upper_times_rotation(matrix) -> tuple[np.ndarray, np.ndarray]:
    """matrix = U R, U upper triangular with a positive diagonal but for its first, R a rotation."""
    upper, rotation = rq(matrix)
    signs = np.sign(np.diag(upper))
    signs[0] *= np.sign(np.linalg.det(rotation * signs[:, None]))  # so that R stays a rotation
    return upper * signs, rotation * signs[:, None]


def _parts(matrix) -> dict[str, np.ndarray]:
    """Scale, misalignment (xy, xz, yz) and rotation vector of one triad's matrix, (3,) each."""
    from scipy.spatial.transform import Rotation

    upper, rotation = upper_times_rotation(matrix)
    scale = np.diag(upper)
    return {
        "scale": scale,
        "misalignment": upper[SKEW] / scale[SKEW[0]],
        "orientation": Rotation.from_matrix(rotation).as_rotvec(),
    }


def _part_slopes(matrix) -> dict[str, np.ndarray]:
    """Derivatives (3, 9) of each part in the matrix's entries, orientation as a small turn.

    U^-1 dM R' = U^-1 dU + dR R', upper triangular and skew-symmetric: the latter follows from what
    is beneath the diagonal.
    """
    upper, rotation = upper_times_rotation(matrix)
    both = np.linalg.inv(upper) @ np.eye(9).reshape(9, 3, 3) @ rotation.T
    below = np.tril(both, -1)
    turn = below - np.swapaxes(below, 1, 2)
    change = upper @ (both - turn)
    scale, diagonal = np.diag(upper), change[:, range(3), range(3)]
    first = scale[SKEW[0]]
    skew = change[:, *SKEW] / first - upper[SKEW] / first**2 * diagonal[:, SKEW[0]]
    small = np.stack([turn[:, 2, 1], turn[:, 0, 2], turn[:, 1, 0]])
    return {"scale": diagonal.T, "misalignment": skew.T, "orientation": small}
