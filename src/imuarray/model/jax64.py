"""JAX in double precision: the one place that imports and configures it."""

import jax

from imuarray.caches import keep_compiled

jax.config.update("jax_enable_x64", True)
keep_compiled(jax)

jnp = jax.numpy

__all__ = ["jax", "jnp"]
