"""The seam for effects: one small function reaches simulation, ML and the likelihood."""

import numpy as np
import pytest

from imuarray.engine.readings import measured
from imuarray.errors import InputError
from imuarray.estimation.bcd import calibrate_bcd
from imuarray.estimation.gauss_newton import calibrate_gauss_newton
from imuarray.geometry import mimu4444_corners
from imuarray.model import EFFECTS, ArrayModel, Noise, effect
from imuarray.motion import Motion, hand_twisting
from imuarray.posterior.generic import GenericLikelihood
from imuarray.posterior.likelihood import Likelihood
from imuarray.posterior.pmmh import run_chains
from imuarray.posterior.target import GaussianPrior, GenericTarget
from imuarray.simulation.measure import measure
from tests import oracles

RATE = np.radians(0.06)


def packed(model, motion):
    """(T, 9 or 15)."""
    return np.hstack([np.asarray(field) for field in motion[: model.motion_size // 3]])


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


CASES = {
    "gyroscope_scale": lambda rng: {"gyroscope_scale": 0.01 * rng.standard_normal((8, 3))},
    "sensor_delay": lambda rng: {"sensor_delay": 5e-4 * rng.standard_normal(8)},
}


@pytest.mark.parametrize("name", CASES)
def test_effect_changes_the_simulation_as_its_equation_says(name):
    model, *_, positions, parameters, motion = simulated((name,), CASES[name])
    base = ArrayModel(model.array, model.noise)
    with_effect = model.predict_many(motion, positions, parameters)
    without = base.predict_many(motion, positions)
    if name == "gyroscope_scale":
        scale = 1 + parameters.reshape(8, 3)
        np.testing.assert_allclose(with_effect.angular_rate, scale * without.angular_rate)
        np.testing.assert_array_equal(with_effect.specific_force, without.specific_force)
    else:
        # the exact motion tau later, to second order in tau
        rng = np.random.default_rng(5)
        rng.standard_normal((8, 3))
        path = hand_twisting(rng, np.radians(1000), 10.0)
        time = 0.02 * np.arange(len(with_effect.angular_rate))
        for k, delay in enumerate(parameters):
            late = base.predict_many(path.at(time + delay), positions)
            error = with_effect.specific_force[:, k] - late.specific_force[:, k]
            change = late.specific_force[:, k] - without.specific_force[:, k]
            assert np.abs(error).max() <= 0.1 * np.abs(change).max() + 1e-12
            error = with_effect.angular_rate[:, k] - late.angular_rate[:, k]
            change = late.angular_rate[:, k] - without.angular_rate[:, k]
            assert np.abs(error).max() <= 0.1 * np.abs(change).max() + 1e-12


@pytest.mark.slow
@pytest.mark.parametrize("name", CASES)
def test_ml_recovers_the_effect_and_its_uncertainty(name):
    """Seed 5; all |errors| below 4.5 sd: false alarm below 1e-3 over some 45 parameters."""
    model, force, rate, positions, parameters, _ = simulated((name,), CASES[name])
    prior = (model.array.parameters, 3e-3)
    found = oracles.joint_map(model, force, rate, prior=prior)
    assert found.converged
    errors = np.concatenate([found.positions[1:].ravel(), found.effects])
    errors -= np.concatenate([positions[1:].ravel(), parameters])
    z = errors / np.sqrt(np.diag(found.covariance))
    assert np.abs(z).max() < 4.5
    wrong = calibrate_gauss_newton(
        ArrayModel(model.array, model.noise), force, rate, position_prior=prior
    )
    assert wrong.cost[-1] > 2 * found.cost


@pytest.mark.slow
def test_likelihood_prefers_the_true_effect():
    model, force, rate, positions, parameters, motion = simulated(
        ("sensor_delay",), CASES["sensor_delay"], samples=30
    )
    start = packed(model, motion)
    likelihood = GenericLikelihood(model, measured(model, force, rate), start, draws=2)
    normals = np.random.default_rng(1).standard_normal((30, 2, 3))
    truth = np.concatenate([positions[1:].ravel(), parameters])
    nothing = np.concatenate([positions[1:].ravel(), np.zeros(8)])
    assert likelihood.on(truth, normals) > likelihood.on(nothing, normals) + 100


@pytest.mark.slow
def test_sampler_runs_on_an_extended_model_near_its_mode():
    """The posterior of the delays from PmMH covers the truth (seed 5; 5 sd)."""
    model, force, rate, positions, parameters, _ = simulated(
        ("sensor_delay",), CASES["sensor_delay"], samples=12
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
    change = {}
    for name, used in (("flat", model), ("proper", model.with_motion(motion))):
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


def test_gauss_newton_finds_the_optimum_of_bcd():
    model, force, rate, *_ = simulated((), lambda rng: {}, samples=40)
    joint = calibrate_gauss_newton(model, force, rate)
    alternating = calibrate_bcd(model, force, rate, tolerance=1e-13, limit=20000)
    np.testing.assert_allclose(joint.positions, alternating.positions, atol=1e-8)
    assert len(joint.cost) <= 10 < len(alternating.cost)


def test_a_new_effect_is_ten_lines_and_needs_nothing_else():
    """An effect unknown to the package, defined here, is simulated, estimated and judged."""

    @effect("test_bias", unit="m s-2", prior_sd=0.1, shape=lambda a, g: (a, 3))
    def bias(value, instant, predicted):
        return predicted._replace(specific_force=predicted.specific_force + value)

    try:
        model, force, rate, _, parameters, motion = simulated(
            ("test_bias",), lambda rng: {"test_bias": 0.05 * rng.standard_normal((8, 3))}
        )
        prior = (model.array.parameters, 3e-3)
        found = oracles.joint_map(model, force, rate, prior=prior)
        sd = np.sqrt(np.diag(found.covariance)[21:])
        assert np.max(np.abs(found.effects - parameters) / sd) < 4.5
        likelihood = GenericLikelihood(
            model, measured(model, force, rate), packed(model, motion), draws=1
        )
        normals = np.zeros((len(force), 1, 3))
        flat = found.positions[1:].ravel()
        with_bias = likelihood.on(np.concatenate([flat, found.effects]), normals)
        assert with_bias > likelihood.on(np.concatenate([flat, np.zeros(24)]), normals)
    finally:
        del EFFECTS["test_bias"]


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
