"""Every compiled kernel, called 200 times from two threads at once, comes back.

JAX on two cores has been seen to stop for ever, using no CPU (conventions, JAX fact 1):
they run in a process of their own that is killed after a time limit.
"""

import subprocess
import sys

import pytest

LIMIT = 300  # s, some twenty times what all take with their compilation

SETUP = """
import faulthandler
from concurrent.futures import ThreadPoolExecutor
import numpy as np
from imuarray_papers.estimation.bcd import calibrate_bcd
from imuarray_papers.estimation.collapsed import estimate_motion
from imuarray.model import ArrayModel, kinematics
from imuarray.model.jax64 import jax
from imuarray.model.structure import _force
from imuarray_papers.posterior.likelihood import CompiledTarget
from imuarray.posterior.prior import GaussianPrior
from imuarray_papers.posterior.likelihood import Likelihood
from tests.cases import noises, simulate, small_array

faulthandler.dump_traceback_later({limit} - 10, exit=True)
rng = np.random.default_rng(1)
array = small_array(5, 2)
model = ArrayModel.isotropic(array, 0.04, 0.02)
general = ArrayModel(array, noises(rng, 5, 2)["crosstalk"])
effects = ArrayModel.isotropic(array, 0.04, 0.02, ("gyroscope_scale", "sensor_delay"))
motion, force, rate = simulate(rng, model, 50)
r = array.relative
likelihood = Likelihood.of(model, force, rate)
correlated = Likelihood.of(general, force, rate)
target = CompiledTarget(likelihood, GaussianPrior.of(array.parameters, 1e-3), 10)
parameters = np.full(effects.effect_size, 1e-4)
rates = np.repeat(motion.angular_rate[:, None], 10, axis=1)
motions = [motion.select(slice(0, n)) for n in (50, 20)]
forces = jax.jit(jax.vmap(_force, (None, None, 0)))
force_rate = jax.jit(kinematics.force_rate)

def two_hundred(thread):
    own = np.random.default_rng(thread)
    return [np.asarray(kernel(thread, own)).shape for _ in range(200)]

for name, kernel in [{kernels}]:
    print(name, flush=True)
    with ThreadPoolExecutor(2) as pool:
        one, two = pool.map(two_hundred, range(2))
    assert len(one) == len(two) == 200
print("all came back")
"""

CALLS = {
    "predict_many": "model.predict_many(motions[thread], r).specific_force",
    "predict_many, effects": "effects.predict_many(motions[thread], r, parameters).specific_force",
    "structure": "forces(np.ones(3), np.ones(6), r)",
    "force_rate": "force_rate(motion.select(thread), r)",
    "fixed_draws": "likelihood.on(r, rates)",
    "fixed_draws, general": "correlated.on(r, rates)",
    "fresh_draws": "likelihood.estimate(r, 10, own)",
    "repeated": "likelihood.realisations(r, 10, 3, own)",
    "transitions": "target.transitions(array.parameters.copy(), -1e9, 1e-4, 5, own)",
    "angular_rates": "estimate_motion(model, force, rate).cost",
    "angular_rates, general": "estimate_motion(general, force, rate).cost",
    "descend": "calibrate_bcd(model, force, rate, limit=20).positions",
}


JAX = [name for name in CALLS if name.split(",")[0] in ("predict_many", "structure", "force_rate")]
NUMBA = [name for name in CALLS if name not in JAX]


@pytest.mark.parametrize("names", [JAX, NUMBA], ids=["jax", "numba"])
def test_kernels_come_back(names, pytestconfig):
    """Standard output names the kernel that was running when the time was up."""
    kernels = ", ".join(f'("{name}", lambda thread, own: {CALLS[name]})' for name in names)
    done = subprocess.run(
        [sys.executable, "-c", SETUP.format(limit=LIMIT, kernels=kernels)],
        timeout=LIMIT,
        capture_output=True,
        text=True,
        cwd=pytestconfig.rootpath,
    )
    assert done.returncode == 0, f"{done.stdout}\n{done.stderr[-3000:]}"
    assert done.stdout.splitlines() == [*names, "all came back"]
