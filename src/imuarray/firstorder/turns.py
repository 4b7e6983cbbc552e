"""A sensor's 3 x 3 matrix: its nearest orthogonal one, scale, misalignment, orientation."""

import numpy as np
from scipy.linalg import rq

from imuarray.errors import InputError

TURNED = np.radians(5.0)  # more than a mount is off by accident
SKEW = np.triu_indices(3, 1)


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


def parts_of(matrices) -> dict[str, np.ndarray]:
    """Scale, misalignment (xy, xz, yz) and orientation (rotation vector) of (K, 3, 3), (K, 3)."""
    from scipy.spatial.transform import Rotation

    uppers, rotations = map(np.array, zip(*map(upper_times_rotation, matrices), strict=True))
    scale = np.einsum("kii->ki", uppers)
    return {
        "scale": scale,
        "misalignment": uppers[:, *SKEW] / scale[:, SKEW[0]],
        "orientation": Rotation.from_matrix(rotations).as_rotvec(),
    }


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
