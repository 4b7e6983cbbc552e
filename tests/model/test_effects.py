"""The seam for effects: one small function reaches simulation, ML and the likelihood."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from imuarray.engine.readings import measured
from imuarray.errors import InputError
from imuarray.geometry import mimu4444_corners
from imuarray.model import EFFECTS, ArrayModel, Noise
from imuarray.model.array_model import _predict_many
from imuarray.model.effects import effect
from imuarray.motion import Motion, hand_twisting
from imuarray.posterior.prior import GaussianPrior
from imuarray.simulation.recordings import measure
from imuarray_papers.posterior.likelihood import Likelihood
from imuarray_papers.posterior.pmmh import run_chains
from tests import oracles
from tests.generic import GenericLikelihood, GenericTarget

RATE = np.radians(0.06)


def packed(model, motion):
    """(T, 9 or 15)."""
    return np.hstack([np.asarray(field) for field in motion[: 3 + 2 * model.needs_derivatives]])


def simulated(effects, values, samples=120, seed=5):
    """A model, its measurements of hand twisting, true positions and effect parameters."""
    rng = np.random.default_rng(seed)
    array = mimu4444_corners()
    model = ArrayModel.isotropic(array, 0.04, RATE, effects)
    positions = array.relative + 2e-4 * rng.standard_normal((8, 3))
    positions -= positions[0]
    motion = hand_twisting(rng, np.radians(1000), 10.0).at(0.02 * np.arange(samples))
    parameters = model.join(values(rng))
    force, rate, _ = measure(model, motion, positions, rng, parameters)
    return model, force, rate, positions, parameters, motion


@pytest.mark.slow
def test_sampler_runs_on_an_extended_model_near_its_mode():
    """The posterior of the delays from PmMH covers the truth (seed 5; 5 sd)."""
    model, force, rate, positions, parameters, _ = simulated(
        ("sensor_delay",), lambda rng: {"sensor_delay": 5e-4 * rng.standard_normal(8)}, 12
    )
    prior_mean = np.concatenate([model.array.parameters, np.zeros(8)])
    found = oracles.joint_map(model, force, rate, prior=(model.array.parameters, 3e-3))
    mode = np.concatenate([found.positions[1:].ravel(), found.effects])
    sds = np.sqrt(np.diag(found.covariance))
    estimate = GenericLikelihood(model, measured(model, force, rate), found.motion, draws=2)
    factor = np.linalg.cholesky(found.covariance)
    prior_sd = np.concatenate([np.full(21, 3e-3), model.effect_prior_sd])
    target = GenericTarget(estimate, GaussianPrior.of(prior_mean, prior_sd), factor)
    chains = run_chains(target, [mode, mode], 0.1, 300, 2, 0, quiet=True)
    assert np.all(chains.acceptance > 0.02) and np.all(chains.acceptance < 0.98)
    truth = np.concatenate([positions[1:].ravel(), parameters])
    assert np.all(np.abs(chains.draws.mean(axis=(0, 1)) - truth) < 6 * sds)


@pytest.mark.slow
def test_generic_likelihood_equals_the_collapsed_one_up_to_a_constant():
    """Differences between thetas agree within Monte Carlo error (seed 3, 5 sd)."""
    model, force, rate, positions, _, motion = simulated((), lambda rng: {}, samples=20)
    collapsed = Likelihood.of(model, force, rate)
    generic = GenericLikelihood(model, measured(model, force, rate), packed(model, motion), draws=8)
    rng = np.random.default_rng(3)
    differences = []
    for _ in range(3):
        moved = positions + 2e-5 * rng.standard_normal((8, 3))
        moved -= moved[0]
        values = collapsed.realisations(moved, 2000, 40, rng)
        differences.append(
            (generic(moved[1:].ravel(), rng) - values.mean(), values.std() / 40**0.5)
        )
    offsets, errors = np.array(differences).T
    assert np.ptp(offsets) < 5 * np.max(errors) * 2**0.5 + 1e-4


@pytest.mark.slow
def test_no_reward_along_a_gauge_with_a_proper_motion_prior():
    """omega -> omega / (1 + c), r -> r (1 + c)^2 leaves the data alone: log p-hat must be flat.

    With the flat prior it is not: each sample then gains -9 log(1 + c), which this shows too.
    """
    model, force, rate, positions, _, motion = simulated(
        ("gyroscope_scale",), lambda rng: {}, samples=60
    )
    normals = np.random.default_rng(2).standard_normal((60, 4, 3))
    change, sds = {}, [float(np.sqrt(np.mean(np.square(field)))) for field in motion[:3]]
    proper = replace(model, motion_sd=tuple(sds))
    for name, used in (("flat", model), ("proper", proper)):
        likelihood = GenericLikelihood(
            used, measured(used, force, rate), packed(model, motion), steps=6
        )
        values = []
        for c in (0.0, -0.03):
            theta = np.concatenate([(positions[1:] * (1 + c) ** 2).ravel(), np.full(24, c)])
            values.append(likelihood.on(theta, normals))
        change[name] = values[1] - values[0]
    assert change["flat"] == pytest.approx(-9 * 60 * np.log(0.97), rel=0.02)
    assert abs(change["proper"]) < 3.0


def test_an_effect_is_drawn_against_what_there_is():
    register = effect("far", unit="m", prior_sd=1.0, shape=lambda a, g: (a,), against="distance")
    with pytest.raises(ValueError, match="effect far: .*'distance'"):
        register(lambda far, instant, predicted: predicted)
    assert "far" not in EFFECTS


def test_unknown_effect_is_an_input_error():
    with pytest.raises(InputError, match="sensor_delay.*found gremlin"):
        ArrayModel.isotropic(mimu4444_corners(), 0.04, RATE, ("gremlin",)).predict(
            Motion.of(*np.zeros((3, 3))), np.zeros((8, 3))
        )


def test_models_with_different_derivative_priors_do_not_share_compiled_code():
    array = mimu4444_corners()
    noise = Noise.of(8, 8, 0.04, RATE)
    one = ArrayModel(array, noise, ("sensor_delay",), (1e4, 100.0))
    two = ArrayModel(array, noise, ("sensor_delay",), (2e4, 100.0))
    assert one != two and hash(one) != hash(two)


def test_boards_turned_otherwise_share_compiled_code_and_have_their_own_axes():
    """Each recording's first order estimates its axes: another must not compile all again."""
    array, rng = mimu4444_corners(), np.random.default_rng(3)
    values = rng.normal(size=72)
    motion = Motion(*rng.normal(size=(5, 4, 3)))
    counts = []
    for turns in Rotation.random(16, random_state=3).as_matrix().reshape(2, 8, 3, 3):
        model = ArrayModel.isotropic(replace(array, axes=turns), 0.04, RATE, ("size_effect",))
        seen = model.predict_many(motion, array.relative, values)
        counts.append(_predict_many._cache_size())
        for t in range(4):
            now = Motion(*(field[t] for field in motion))
            alone = model.predict(now, array.relative, values)
            np.testing.assert_allclose(seen.specific_force[t], alone.specific_force, rtol=1e-12)
    assert counts[0] == counts[1]
