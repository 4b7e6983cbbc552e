"""Every compiled kernel, called 200 times from two threads at once, comes back.

JAX on two cores has been seen to stop for ever, using no CPU (conventions, JAX fact 1):
each call runs in a process of its own that is killed after a time limit.
"""

import subprocess
import sys

import pytest

LIMIT = 120  # s, some fifty times what a kernel takes with its compilation

SETUP = """
import faulthandler
from concurrent.futures import ThreadPoolExecutor
import numpy as np
from imuarray.estimation import calibrate_bcd, estimate_motion
from imuarray.model import ArrayModel, kinematics
from imuarray.model.jax64 import jax
from imuarray.model.structure import _coefficients
from imuarray.posterior import CompiledTarget, GaussianPrior, Likelihood
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
coefficients = jax.jit(jax.vmap(_coefficients))
force_rate = jax.jit(kinematics.force_rate)

def kernel(seed):
    own = np.random.default_rng(seed)
    return {call}

def two_hundred(thread):
    return [np.asarray(kernel(thread)).shape for _ in range(200)]

with ThreadPoolExecutor(2) as pool:
    one, two = pool.map(two_hundred, range(2))
assert len(one) == len(two) == 200
print("came back")
"""

CALLS = {
    "predict_many": "model.predict_many(motions[seed], r).specific_force",
    "predict_many, effects": "effects.predict_many(motions[seed], r, parameters).specific_force",
    "structure": "coefficients(r)",
    "force_rate": "force_rate(motion.select(seed), r)",
    "fixed_draws": "likelihood.on(r, rates)",
    "fixed_draws, general": "correlated.on(r, rates)",
    "fresh_draws": "likelihood.estimate(r, 10, own)",
    "fresh_draws, threads": "likelihood.estimate(r, 10, own, threads=2)",
    "repeated": "likelihood.realisations(r, 10, 3, own)",
    "transitions": "target.transitions(array.parameters.copy(), -1e9, 1e-4, 5, own)",
    "angular_rates": "estimate_motion(model, force, rate).cost",
    "angular_rates, general": "estimate_motion(general, force, rate).cost",
    "descend": "calibrate_bcd(model, force, rate, limit=20).positions",
}


@pytest.mark.parametrize("name", CALLS)
def test_kernel_comes_back(name, pytestconfig):
    script = SETUP.format(limit=LIMIT, call=CALLS[name])
    done = subprocess.run(
        [sys.executable, "-c", script],
        timeout=LIMIT,
        capture_output=True,
        text=True,
        cwd=pytestconfig.rootpath,
    )
    assert done.returncode == 0, done.stderr[-3000:]
    assert done.stdout.split() == ["came", "back"]
