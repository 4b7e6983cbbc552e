"""Symmetric positive systems whose parameters have different units, scaled to a unit diagonal.

Metres beside seconds and radians make eigenvalues meaningless and inverses inexact; divided by
the square roots of the diagonal's numbers, they are those of a correlation matrix.
"""

from typing import NamedTuple

import numpy as np
from scipy.linalg import eigh_tridiagonal

CHECKED = 6  # steps of Lanczos' method between two looks at what they add
FLOOR = 1e-12  # of the scaled eigenvalues, beneath which rounding is all that they are made of


class ScaledEigen(NamedTuple):
    """matrix = D V diag(values) V' D with D = diag(scale), values ascending."""

    values: np.ndarray  # (n,)
    vectors: np.ndarray  # (n, n), a column each
    scale: np.ndarray  # (n,)


def scaled_eigh(matrix, scale=None) -> ScaledEigen:
    """Eigen-decomposition of a symmetric matrix (n, n) over the outer product of ``scale`` (n,).

    By default the scale is the square root of the diagonal, so that the scaled one is of ones.
    """
    if scale is None:
        scale = np.sqrt(np.maximum(np.diag(matrix), 1e-300))
    return ScaledEigen(*np.linalg.eigh(matrix / np.outer(scale, scale)), scale)


def scaled_inverse(matrix, cutoff: float = FLOOR) -> np.ndarray:
    """Inverse (n, n) of a symmetric positive matrix.

    Scaled eigenvalues below ``cutoff`` (no unit, 1 is a parameter by itself) count as that large:
    directions of which nothing is known get a large variance, but a finite one.
    """
    values, vectors, scale = scaled_eigh(matrix)
    return (vectors / np.maximum(values, cutoff)) @ vectors.T / np.outer(scale, scale)


def scaled_square(matrix, vector, cutoff: float, scale=None) -> tuple[float, int]:
    """(vector' matrix^-1 vector, rank) within the directions above ``cutoff``: a score test's."""
    values, vectors, scale = scaled_eigh(matrix, scale)
    informed = values > cutoff
    along = vectors[:, informed].T @ (vector / scale)
    return float(np.sum(along**2 / values[informed])), int(informed.sum())


def diagonal_blocks(matrix, size: int) -> np.ndarray:
    """(k, size, size), the blocks on the diagonal of a matrix (k size, k size)."""
    count = len(matrix) // size
    return matrix.reshape(count, size, count, size)[range(count), :, range(count)]


def shared_walk(time) -> np.ndarray:
    """(P, P) s, how long a walk both ways from time 0 is the same at each two of ``time`` (P,)."""
    return np.where(np.multiply.outer(time, time) > 0, np.minimum.outer(abs(time), abs(time)), 0.0)


def scaled_solve(information, right):
    """(solution, sds) of a positive definite system, scaled to a unit diagonal first."""
    values, vectors, scale = scaled_eigh(information)
    values = np.maximum(values, 1e-13)
    solution = (vectors @ ((vectors.T @ (right / scale)) / values)) / scale
    return solution, np.sqrt(np.sum(vectors**2 / values, axis=1)) / scale


def triangular_inverse(factor) -> np.ndarray:
    """Inverse (..., n, n) of lower triangular matrices, row by row for all of them at once.

    NumPy's takes them for full ones: four times as long.
    """
    out, diagonal = np.zeros_like(factor), 1 / np.diagonal(factor, axis1=-2, axis2=-1)
    for i in range(factor.shape[-1]):
        row = factor[..., i, None, :i] @ out[..., :i, :i]
        out[..., i, :i] = -diagonal[..., i, None] * row[..., 0, :]
        out[..., i, i] = diagonal[..., i]
    return out


def matrix_function(product, vector, function, tolerance: float = 1e-13) -> np.ndarray:
    """function(M) @ vector (n,) of a symmetric M (n, n), by Lanczos' method.

    ``product``: M @ v (n,) of a v (n,). ``function`` takes eigenvalues (k,). Some twenty products
    instead of all eigenvectors: ends where more would add no more than the ``tolerance`` of it.
    """
    size, count = float(np.linalg.norm(vector)), len(vector)
    if size == 0.0:
        return np.zeros_like(vector)
    basis, diagonal, beside, before = np.empty((count, count)), [], [], np.zeros(count)
    basis[0] = vector / size
    while True:
        k = len(diagonal)
        after, known = product(basis[k]), basis[: k + 1]
        diagonal.append(basis[k] @ after)
        for _ in range(2):  # once leaves rounding of what was taken out
            after = after - known.T @ (known @ after)
        norm = float(np.linalg.norm(after))
        last = k + 1 == count or norm <= tolerance * max(np.abs(diagonal))
        if last or k % CHECKED == CHECKED - 1:
            values, vectors = eigh_tridiagonal(diagonal, beside)
            found = size * known.T @ (vectors @ (function(values) * vectors[0]))
            if last or np.linalg.norm(found - before) <= tolerance * np.linalg.norm(found):
                return found
            before = found
        beside.append(norm)
        basis[k + 1] = after / norm
