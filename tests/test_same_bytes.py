"""A kernel that has just been compiled gives the bytes of one that comes from the cache."""

import os
import subprocess
import sys

SCRIPT = """
import hashlib
import numpy as np
from imuarray.estimation import calibrate_bcd, calibrate_gauss_newton
from imuarray.geometry import mimu4444
from imuarray.model import ArrayModel
from imuarray.motion import normal_motion
from imuarray.posterior import Likelihood
from imuarray.simulation import measure

model = ArrayModel.isotropic(mimu4444(), 0.04, 1e-3)
rng = np.random.default_rng(1)
motion = normal_motion(rng, (50,), 17.0, 600.0, 20.0)
force, rate, _ = measure(model, motion, model.array.relative, rng)
likelihood = Likelihood.of(model, force, rate)
slow, fast = calibrate_bcd(model, force, rate, limit=30), calibrate_gauss_newton(model, force, rate)
found = [
    likelihood.realisations(model.array.relative, 4, 20, np.random.default_rng(3)),
    likelihood.estimate(model.array.relative, 25, np.random.default_rng(3)),
    slow.positions, slow.cost, fast.positions, fast.covariance,
]
for part in found:
    print(hashlib.sha256(np.asarray(part).tobytes()).hexdigest())
"""


def test_compiled_or_from_the_cache(tmp_path):
    environment = os.environ | {"NUMBA_CACHE_DIR": str(tmp_path)}
    said = [
        subprocess.run(
            [sys.executable, "-c", SCRIPT], env=environment, capture_output=True, text=True,
            check=True, timeout=600,
        ).stdout
        for _ in range(2)
    ]  # fmt: skip
    assert len(said[0].split()) == 6 and said[0] == said[1]
