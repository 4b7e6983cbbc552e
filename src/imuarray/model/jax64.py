"""JAX in double precision: the one place that imports and configures it."""

import jax

jax.config.update("jax_enable_x64", True)

jnp = jax.numpy

__all__ = ["jax", "jnp"]
