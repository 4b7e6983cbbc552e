"""JAX in double precision: the one place that configures it; small factorisations in it.

Batched LAPACK calls inside jitted functions are slow on CPUs and have been seen to hang; these are
plain arithmetic on static sizes (up to 15 or so).
"""

import jax

from imuarray.caches import keep_compiled

jax.config.update("jax_enable_x64", True)
keep_compiled(jax)

jnp = jax.numpy
__all__ = ["jax", "jnp"]


def cholesky(matrix):
    """Lower Cholesky factor of one (n, n) positive definite matrix."""
    n = matrix.shape[0]
    columns = []
    for j in range(n):
        column = matrix[:, j]
        for done in columns:
            column = column - done * done[j]
        column = column / jnp.sqrt(column[j])
        columns.append(jnp.where(jnp.arange(n) >= j, column, 0.0))
    return jnp.stack(columns, axis=1)


def solve_lower(factor, right):
    """factor^-1 right for a lower factor (n, n) and right (n, m)."""
    rows = []
    for i in range(factor.shape[0]):
        value = right[i]
        for j, row in enumerate(rows):
            value = value - factor[i, j] * row
        rows.append(value / factor[i, i])
    return jnp.stack(rows)


def solve_upper(factor, right):
    """factor'^-1 right for a lower factor (n, n) and right (n, m)."""
    n = factor.shape[0]
    rows = [None] * n
    for i in reversed(range(n)):
        value = right[i]
        for j in range(i + 1, n):
            value = value - factor[j, i] * rows[j]
        rows[i] = value / factor[i, i]
    return jnp.stack(rows)


def log_determinant(factor):
    """log |F F'| of a lower factor."""
    return 2.0 * jnp.sum(jnp.log(jnp.diagonal(factor)))
