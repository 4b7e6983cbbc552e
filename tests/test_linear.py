"""Symmetric systems scaled to a unit diagonal."""

import numpy as np
import pytest

from imuarray.linear import (
    matrix_function,
    scaled_eigh,
    scaled_inverse,
    scaled_square,
    triangular_inverse,
)

UNITS = np.array([1e-6, 1.0, 1e5, 30.0])


def matrix():
    rng = np.random.default_rng(3)
    root = rng.standard_normal((4, 9))
    return np.outer(UNITS, UNITS) * (root @ root.T)


def test_decomposition_is_that_of_the_scaled_matrix():
    values, vectors, scale = scaled_eigh(matrix())
    np.testing.assert_allclose(scale**2, np.diag(matrix()))
    found = scale[:, None] * (vectors * values) @ vectors.T * scale
    np.testing.assert_allclose(found, matrix(), rtol=1e-12)
    assert values.sum() == pytest.approx(4.0)


def test_inverse_whatever_the_units():
    plain = scaled_inverse(matrix() / np.outer(UNITS, UNITS))
    np.testing.assert_allclose(scaled_inverse(matrix()), plain / np.outer(UNITS, UNITS), rtol=1e-11)
    np.testing.assert_allclose(plain, np.linalg.inv(matrix() / np.outer(UNITS, UNITS)), rtol=1e-9)


def test_a_direction_of_which_nothing_is_known_has_a_finite_variance():
    known = np.outer(UNITS, UNITS)  # of rank one
    assert np.all(np.isfinite(scaled_inverse(known)))
    assert np.linalg.norm(scaled_inverse(known, 1e-4) * known) <= 4e4


def test_square_leaves_out_what_lies_below_the_cutoff():
    vector = matrix() @ np.array([2e6, -1.0, 3e-5, 0.1])
    expected = vector @ np.linalg.solve(matrix(), vector)
    assert scaled_square(matrix(), vector, 1e-9) == (pytest.approx(expected), 4)
    found, rank = scaled_square(np.outer(UNITS, UNITS), UNITS, 1e-9)
    assert rank == 1 and found == pytest.approx(1.0)


@pytest.mark.parametrize("largest", [0.3, 1.0])
@pytest.mark.parametrize("count", [1, 5, 80])
def test_a_function_of_a_matrix_is_that_of_its_eigenvalues(count, largest):
    rng = np.random.default_rng(count)
    axes = np.linalg.qr(rng.standard_normal((count, count)))[0]
    values, vector = largest * rng.random(count) ** 2, rng.standard_normal(count)
    values[0] = largest  # where the function bends

    def function(x):
        return np.maximum(1 - x, 1e-3) ** -0.5

    found = matrix_function(((axes * values) @ axes.T).__matmul__, vector, function)
    np.testing.assert_allclose(found, axes @ (function(values) * (axes.T @ vector)), rtol=1e-9)
    assert np.all(matrix_function(np.copy, np.zeros(count), function) == 0.0)
    assert matrix_function(lambda v: v, np.ones(count), function) == pytest.approx(function(1.0))


@pytest.mark.parametrize("size", [0, 1, 9, 24])
def test_triangular_inverses_are_those_of_full_matrices(size):
    rng = np.random.default_rng(5)
    factor = np.tril(rng.standard_normal((40, size, size))) + 3.0 * np.eye(size)
    np.testing.assert_allclose(triangular_inverse(factor), np.linalg.inv(factor), atol=1e-12)
