"""A kernel that has just been compiled gives the bytes of one that comes from the cache."""

import os
import subprocess
import sys

import pytest

SCRIPT = """
import hashlib
import numpy as np
from imuarray.geometry import mimu4444
from imuarray.model import ArrayModel
from imuarray.motion import normal_motion
from imuarray.model.jax64 import jax
from imuarray_papers.posterior.likelihood import Likelihood
from imuarray.posterior.marginal import Marginal
from imuarray.simulation.recordings import measure

model = ArrayModel.isotropic(mimu4444(), 0.04, 1e-3)
rng = np.random.default_rng(1)
motion = normal_motion(rng, (50,), 17.0, 600.0, 20.0)
force, rate, _ = measure(model, motion, model.array.relative, rng)
likelihood = Likelihood.of(model, force, rate)
found = [likelihood.estimate(model.array.relative, 25, np.random.default_rng(3))]
marginal = likelihood.marginal(model.array.relative, 3)
found.append(jax.jit(marginal.log_density)(model.array.parameters))
for part in found:
    print(hashlib.sha256(np.asarray(part).tobytes()).hexdigest())
"""


@pytest.mark.slow
def test_compiled_or_from_the_cache(tmp_path):
    environment = os.environ | {
        "NUMBA_CACHE_DIR": str(tmp_path), "JAX_COMPILATION_CACHE_DIR": str(tmp_path / "xla"),
        "JAX_PERSISTENT_CACHE_MIN_COMPILE_TIME_SECS": "0",
        "JAX_PERSISTENT_CACHE_MIN_ENTRY_SIZE_BYTES": "-1",
    }  # fmt: skip
    said = [
        subprocess.run(
            [sys.executable, "-c", SCRIPT], env=environment, capture_output=True, text=True,
            check=True, timeout=600,
        ).stdout
        for _ in range(2)
    ]  # fmt: skip
    assert any((tmp_path / "xla").iterdir())
    assert len(said[0].split()) == 2 and said[0] == said[1]
