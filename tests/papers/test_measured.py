"""Selection, centred draws, and positions of measured-like recordings with their agreement."""

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from scipy.ndimage import binary_dilation
from scipy.optimize import least_squares
from scipy.stats import multivariate_normal

from imuarray.analysis.selection import disjoint, select_dynamic
from imuarray.cli import main
from imuarray.errors import InputError
from imuarray.geometry import mimu4444_corners
from imuarray.model import ArrayModel
from imuarray.motion import hand_twisting, normal_motion
from imuarray.recording import write_recording
from imuarray.simulation.recordings import simulate_recording, simulate_samples
from imuarray_papers.estimation.newton import calibrate_gauss_newton
from imuarray_papers.measured.positions import (
    agreement,
    bcd_positions,
    locate,
    locate_table,
    pairwise,
    simulate_subset,
)
from imuarray_papers.measured.residuals import compare
from imuarray_papers.posterior.likelihood import Likelihood
from imuarray_papers.posterior.proposals import log_weights, sample_covariance

BOARD = mimu4444_corners()


def samples(rng, count=120, force_sd=0.3, rate_sd=0.02, rate=15.0):
    """Independent samples of the corners board, positions off by 0.5 mm: (recording, truth)."""
    model = ArrayModel.isotropic(BOARD, force_sd, rate_sd)
    motion = normal_motion(rng, (count,), rate, 300.0, 10.0)
    positions = BOARD.relative + 5e-4 * rng.standard_normal(BOARD.relative.shape)
    positions[0] = 0.0
    return simulate_samples(model, motion, positions, BOARD.positions, rng)


def twisting(rng, seconds=20.0, **options):
    """A continuous recording of the corners board twisted by hand."""
    model = ArrayModel.isotropic(BOARD, 0.04, 1e-3)
    motion = hand_twisting(rng, 9.0, 10.0, 5.0)
    return simulate_recording(
        model, motion, BOARD.positions, BOARD.positions, rng, 62.5, seconds, **options
    )[0]


def test_every_sample_is_kept_or_counted_once():
    recording = twisting(np.random.default_rng(0), gyroscope_range=20.0)
    still = np.zeros(len(recording.time), bool)
    still[:100] = True
    found = select_dynamic(replace(recording, stationary=still))
    assert len(found.informative) + sum(found.removed.values()) == len(recording.time)
    assert found.removed["still pose"] == 100
    rails = recording.saturated_gyroscopes().any(axis=(1, 2))
    assert rails.any() and not binary_dilation(rails)[found.usable].any()
    speed = np.linalg.norm(recording.angular_rate[found.usable].mean(axis=1), axis=1)
    assert np.degrees(speed.min()) >= 100 and found.usable.min() >= 100
    assert set(found.informative) <= set(found.usable)


def test_subsets_share_no_sample_and_span_the_recording():
    found = select_dynamic(twisting(np.random.default_rng(1)))
    sets = disjoint(found.informative, [5, 50, 300])
    together = np.concatenate(list(sets.values()))
    assert len(set(together.tolist())) == 355
    for count, index in sets.items():
        assert len(index) == count and np.all(np.diff(index) > 0)
        assert index[-1] - index[0] > 0.7 * (found.informative[-1] - found.informative[0])
    with pytest.raises(InputError, match="at least 100000 informative"):
        disjoint(found.informative, [100_000])


def test_a_recording_at_rest_has_nothing_to_select():
    recording = twisting(np.random.default_rng(2))
    with pytest.raises(InputError, match="expected moving samples"):
        select_dynamic(replace(recording, angular_rate=0 * recording.angular_rate))


def test_log_weight_is_the_difference_of_the_log_densities():
    rng = np.random.default_rng(3)
    mean, other = rng.standard_normal((2, 4, 3))
    factors = rng.standard_normal((2, 4, 3, 3)) + 2 * np.eye(3)
    first, second = factors @ factors.transpose(0, 1, 3, 2)
    found = log_weights(mean, first, other, second)
    for t in range(4):
        x, y, z = w = rng.standard_normal(3)
        value = found[:, t] @ [1, x, y, z, x * x, y * y, z * z, x * y, x * z, y * z]
        expected = multivariate_normal.logpdf(w, mean[t], first[t])
        expected -= multivariate_normal.logpdf(w, other[t], second[t])
        assert value == pytest.approx(expected, abs=1e-9)


@pytest.fixture(scope="module")
def wide():
    """Three samples whose gyroscopes say little: (likelihood, true positions)."""
    rng = np.random.default_rng(4)
    recording, truth = samples(rng, count=3, force_sd=0.5, rate_sd=0.3)
    model = ArrayModel.isotropic(BOARD, 0.5, 0.3)
    spread = sample_covariance(recording.angular_rate)
    likelihood = Likelihood.of(
        model, recording.specific_force, recording.angular_rate, rate_distribution=spread
    )
    return likelihood, truth["position"].to_numpy()


@pytest.mark.parametrize("shift", [0.0, 3e-4])
def test_centred_draws_are_unbiased_and_of_smaller_variance(wide, shift):
    """Seed 5: means of 2000 against brute force; 4.5 standard errors, false alarm 1e-5."""
    likelihood, truth = wide
    positions = truth + shift * np.sin(np.arange(24)).reshape(8, 3)
    positions -= positions[0]
    rng = np.random.default_rng(5)
    plain = likelihood.realisations(positions, 200_000, 20, rng)
    centred = likelihood.centred(truth).realisations(positions, 20, 2000, rng)
    top = plain.max()
    reference, values = np.exp(plain - top), np.exp(centred - top)
    error = np.hypot(reference.std() / np.sqrt(20), values.std() / np.sqrt(2000))
    assert abs(values.mean() - reference.mean()) < 4.5 * error
    assert error < 0.05 * reference.mean()
    few = likelihood.realisations(positions, 20, 2000, rng)
    assert centred.var() < 0.1 * few.var()


def test_gauss_newton_with_a_covariance_for_each_sample():
    rng = np.random.default_rng(6)
    recording, _ = samples(rng, count=6)
    factors = 0.02 * (rng.standard_normal((6, 3, 3)) + 2 * np.eye(3))
    covariance = factors @ factors.transpose(0, 2, 1)
    board = replace(BOARD, gyroscopes=1)
    model = ArrayModel.isotropic(board, 0.3, 1.0)
    mean = recording.angular_rate.mean(axis=1)
    prior = BOARD.parameters, 1e-3
    found = calibrate_gauss_newton(
        model, recording.specific_force, mean[:, None], position_prior=prior,
        rate_covariance=covariance, tolerance=1e-9, limit=200,
    )  # fmt: skip
    whiten = np.linalg.cholesky(np.linalg.inv(covariance)).transpose(0, 2, 1)

    def residual(x):
        r = np.vstack([np.zeros(3), x[:21].reshape(7, 3)])
        rate, turn, force = x[21:].reshape(3, 6, 1, 3)
        predicted = np.cross(rate, np.cross(rate, r)) + np.cross(turn, r) + force
        parts = [(recording.specific_force - predicted).ravel() / 0.3,
                 np.einsum("tij,tj->ti", whiten, mean - rate[:, 0]).ravel(),
                 (x[:21] - prior[0]) / prior[1]]  # fmt: skip
        return np.concatenate(parts)

    start = np.concatenate([prior[0], mean.ravel(), np.zeros(18), np.zeros(18)])
    plain = least_squares(residual, start, x_scale="jac", xtol=1e-15, ftol=1e-15, gtol=1e-15)
    np.testing.assert_allclose(found.positions[1:].ravel(), plain.x[:21], atol=1e-8)


def test_positions_and_noise_are_recovered_within_their_widths():
    """12 recordings, seed 7. Mean squared z of 252 coordinates, correlated: 0.6 ... 1.6."""
    squares, noises = [], []
    for seed in range(12):
        recording, truth = samples(np.random.default_rng([7, seed]))
        found = locate(recording, None)
        assert found.converged
        assert found.accelerometer_sd == pytest.approx(found.residual_sd, rel=0.01)
        z = (found.mean - truth["position"].to_numpy())[1:] / found.sd
        squares.append(np.mean(z**2))
        noises.append(found.residual_sd)
    assert 0.6 < np.mean(squares) < 1.6
    assert np.mean(noises) == pytest.approx(0.3, rel=0.03)


def test_the_residual_tells_a_wrong_sigma():
    recording, _ = samples(np.random.default_rng(8))
    assert locate(recording, 0.79).residual_sd == pytest.approx(0.3, rel=0.1)


def test_bcd_lies_at_the_same_place():
    recording, truth = samples(np.random.default_rng(9), count=400)
    found, other = locate(recording, 0.3), bcd_positions(recording, 0.3)
    assert other.converged
    assert np.abs(other.mean - found.mean)[1:].max() < 2 * found.sd.max()


def test_simulated_twins_have_the_assumed_noise():
    recording, _ = samples(np.random.default_rng(10), count=300)
    twin, truth = simulate_subset(recording, 0.79, np.random.default_rng(11))
    np.testing.assert_allclose(truth["position"], locate(recording, 0.79).mean)
    assert locate(twin, 0.79).residual_sd == pytest.approx(0.79, rel=0.05)


def made_up(values, sd=1.0):
    """A table of one coordinate and three recordings."""
    rows = [(name, "2", "x", value, sd) for name, value in zip("abc", values, strict=True)]
    return pd.DataFrame(rows, columns=["recording", "accelerometer", "axis", "mean_m", "sd_m"])


def test_pairs_and_agreement_of_known_numbers():
    table = made_up([0.0, 1.0, 4.0])
    pairs = pairwise(table)
    np.testing.assert_allclose(sorted(pairs.z.abs()), np.array([1, 3, 4]) / np.sqrt(2))
    found = agreement(pairs, table)
    assert found["coverage_50"] == 0.0 and found["coverage_95"] == pytest.approx(1 / 3)
    assert found["z_rms"] == pytest.approx(np.sqrt(26 / 6))
    assert found["spread_m"] == pytest.approx(np.std([0, 1, 4], ddof=1))
    assert found["claimed_m"] == 1.0 and found["recordings"] == 3


def test_a_row_for_each_assumption():
    recording, _ = samples(np.random.default_rng(13))
    table = locate_table(recording, [0.04, 0.79], recording="a", samples=120)
    assert table.groupby(["method", "assumed"]).size().to_dict() == {
        ("bcd", "0.79"): 21, ("map", "0.04"): 21, ("map", "0.79"): 21, ("map", "residual"): 21,
    }  # fmt: skip
    assert list(table.columns[:3]) == ["recording", "samples", "method"]


def excess(table):
    """Rms of the measured residuals over the simulated ones, by quantity."""
    sizes = table.groupby(["quantity", "source"]).rms.mean().unstack()
    return (sizes["measured"] / sizes["simulated"]).to_dict()


def test_residuals_are_alike_where_the_model_holds_and_not_where_it_does_not():
    recording = twisting(np.random.default_rng(14), seconds=12.0)
    moving = recording.select(select_dynamic(recording).usable)
    table = compare(moving, np.random.default_rng(15))
    assert all(abs(value - 1) < 0.06 for value in excess(table).values())
    scaled = moving.angular_rate * (1 + 0.01 * np.arange(-4, 4)[:, None])
    table = compare(replace(moving, angular_rate=scaled), np.random.default_rng(16))
    assert excess(table)["angular_rate"] > 10


@pytest.fixture
def files(tmp_path):
    """Two short recordings of one board on disk."""
    paths = []
    for seed in (17, 18):
        path = tmp_path / f"{seed}.nc"
        write_recording(twisting(np.random.default_rng(seed), seconds=10.0), path)
        paths.append(str(path))
    return paths


def test_select_on_the_command_line(files, tmp_path, capsys):
    out = str(tmp_path / "subset.nc")
    assert main(["select", files[0], "--samples", "60", "--out", out]) == 0
    assert "60 written" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["select", "{0}", "--samples", "100000"], "informative samples"),
        (["first-order", "{0}"], "expected still poses"),
        (["first-order", "{0}", "--gravity", "-9"], "expected a positive number"),
        (["select", "nothing.nc"], "expected a file to read"),
    ],
)
def test_bad_input_is_one_line_and_status_2(files, tmp_path, capsys, arguments, words):
    out = tmp_path / "out.nc"
    assert main([a.format(*files) for a in arguments] + ["--out", str(out)]) == 2
    error = capsys.readouterr().err
    assert words in error and error.count("\n") == 1 and not out.exists()


def test_few_gyroscopes_fall_back_on_the_declared_noise():
    recording, truth = samples(np.random.default_rng(19))
    few = replace(
        recording, angular_rate=recording.angular_rate[:, :2], gyroscope_labels=("1", "2")
    )
    with pytest.raises(InputError, match="at least 4"):
        sample_covariance(few.angular_rate)
    z = (locate(few, 0.3).mean - truth["position"].to_numpy())[1:] / locate(few, 0.3).sd
    assert np.abs(z).max() < 4.5
