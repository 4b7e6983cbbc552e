"""The no-U-turn sampler on the exact marginal likelihood, against quadrature and PmMH."""

from functools import cache, partial

import numpy as np
import pytest
import xarray as xr

import imuarray
from imuarray.analysis import noise
from imuarray.analysis.density import posterior_of
from imuarray.cli import main
from imuarray.errors import InputError
from imuarray.geometry import positions_of, sub_array
from imuarray.model.jax64 import jnp
from imuarray.posterior.diagnostics import ess, rhat
from imuarray.posterior.nuts import White, run_nuts
from imuarray.recording import write_recording
from imuarray_papers import sampling
from imuarray_papers.blind.cases import Case, make
from imuarray_papers.posterior.likelihood import Likelihood
from tests.papers import test_pmmh_targets

pytestmark = pytest.mark.slow


@cache
def chains():
    """Four chains on the six unknowns that the PmMH sampler is tested on."""
    model, force, rate, prior = test_pmmh_targets.problem()
    likelihood = Likelihood.of(model, force, rate)
    thetas, weights = test_pmmh_targets.exact(0.5)
    mean = weights @ thetas
    covariance = (thetas - mean).T @ (weights[:, None] * (thetas - mean))
    marginal = likelihood.marginal(np.vstack([np.zeros(3), mean.reshape(-1, 3)]), 7)

    def density(theta):
        return marginal.log_density(theta) - 0.5 * jnp.sum(((theta - prior.mean) / prior.sd) ** 2)

    starts = prior.mean + 1e-3 * np.random.default_rng(3).standard_normal((4, 6))
    return run_nuts(density, mean, covariance, starts, 300, 1000, seed=3, quiet=True)


def test_quantiles_agree_with_quadrature():
    """Five quantiles of six unknowns within five standard errors, as for PmMH."""
    draws = chains().draws
    assert rhat(draws).max() < 1.01
    assert ess(draws).min() > 1200
    assert np.abs(test_pmmh_targets.deviations(draws, 0.5)).max() < 5


def test_whitening_goes_both_ways():
    rng = np.random.default_rng(1)
    factor = np.tril(rng.standard_normal((4, 4))) + 4 * np.eye(4)
    white = White(rng.standard_normal(4), factor, ())
    theta = rng.standard_normal((2, 3, 4))
    np.testing.assert_allclose(white.theta(white.white(theta)), theta, rtol=1e-12)


def test_same_seed_same_draws():
    def density(theta):
        return -0.5 * jnp.sum(theta**2)

    def run(seed):
        starts = np.ones((2, 3))
        return run_nuts(density, np.zeros(3), np.eye(3), starts, 20, 30, seed, quiet=True).draws

    np.testing.assert_array_equal(run(1), run(1))
    assert not np.any(run(1)[:, -1] == run(2)[:, -1])
    assert not np.any(run(1)[0, -1] == run(1)[1, -1])


def test_a_start_without_a_density_is_refused():
    with pytest.raises(InputError, match="finite"):
        run_nuts(
            lambda t: jnp.log(t[0]), np.ones(2), np.eye(2), -np.ones((2, 2)), 10, 10, 1, quiet=True
        )


def test_command(tmp_path):
    """`imuarray sample` as it is: the truth within the claimed widths, noise as it was made."""
    recording, truth = make(Case("nuts", duration=2.0), 1)
    write_recording(recording, tmp_path / "rec.nc")
    out = tmp_path / "posterior.nc"
    code = main(["sample", str(tmp_path / "rec.nc"), "--seed", "2", "--quiet", "--out", str(out)])
    assert code == 0
    with xr.open_datatree(out, engine="h5netcdf") as tree:
        assert tree.attrs["sampler"] == "independent" and tree.attrs["rhat_max"] <= 1.01
        assert tree["posterior"]["position"].sizes["chain"] == 4
        sd = tree["posterior"]["sd"].mean(("chain", "draw")).sel(quantity="accelerometer_noise")
    assert float(sd) == pytest.approx(recording.accelerometer_noise_sd, rel=0.1)


def test_a_chain_that_falls_into_the_flat_priors_hole_is_told():
    """Under the flat motion prior the density grows as d^-T towards triads on one line, d apart.

    These four are nearly on one; from this seed's first start NUTS finds the others' place.
    """
    array = sub_array(imuarray.mimu4444(), 4)
    recording, _ = imuarray.simulate(array, duration=5.0, sampling_rate=50.0, seed=1)
    said = []
    few = imuarray.select(recording, 20)
    found = sampling.sample(few, "nuts", 100, 1, accelerometer_noise=0.04, notify=said.append)
    assert found.attrs["on_a_line"] and not found.attrs["converged"]
    assert any("no bound" in text for text in said)


def test_a_mode_that_was_not_reached_is_told(monkeypatch):
    recording, _ = imuarray.simulate(imuarray.mimu4444(), duration=2.0, sampling_rate=50.0, seed=1)
    said: list[str] = []
    posterior_of(recording, notify=said.append)
    assert not said
    monkeypatch.setattr(noise, "estimate", partial(noise.estimate, steps=1))
    posterior_of(recording, notify=said.append)
    (text,) = said
    assert "did not converge" in text


def test_the_density_has_no_bound_towards_triads_on_one_line():
    """T nats for each factor e by which they come nearer, once near (T = 20: d^-20)."""
    array = sub_array(imuarray.mimu4444(), 4)
    recording, _ = imuarray.simulate(array, duration=5.0, sampling_rate=50.0, seed=1)
    recording = imuarray.select(recording, 20)
    target = sampling.flat(recording)
    posterior, log_density = target.posterior, target.exact()
    positions = positions_of(posterior.mode)
    centred = positions - positions.mean(axis=0)
    along = np.linalg.svd(centred)[2][0]
    line = centred @ np.outer(along, along)
    values = [
        float(log_density((d * positions + (1 - d) * (line - line[0]))[1:].ravel()))
        for d in (1e-3, 1e-4)
    ]
    assert values[1] - values[0] == pytest.approx(20 * np.log(10), abs=1.0)
