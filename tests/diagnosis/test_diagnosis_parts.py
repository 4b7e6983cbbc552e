"""The parts of a diagnosis, each against a slow and obvious oracle."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.optimize import least_squares
from scipy.signal import savgol_coeffs
from scipy.sparse import lil_matrix
from scipy.stats import chi2, norm, poisson

import imuarray
from imuarray.diagnosis import noise as noises
from imuarray.diagnosis import noise_effects as variance
from imuarray.diagnosis.adoption import narrowest
from imuarray.diagnosis.fit import fit, log_scores, search_optimum
from imuarray.diagnosis.replicates import discrepancies, replicator
from imuarray.diagnosis.scores import (
    Candidate,
    Score,
    candidates,
    information_at,
    score_all,
)
from imuarray.diagnosis.settings import SETTINGS as CRITICAL
from imuarray.diagnosis.special import sawtooth_scan, wider
from imuarray.diagnosis.state import Cause, Search, heldout_gain
from imuarray.engine.clocks import sawtooth
from imuarray.engine.derivatives import polynomial_taps
from imuarray.engine.heldout import blocks_of
from imuarray.engine.linearise import linearise
from imuarray.engine.normal import normal, summed_normal
from imuarray.engine.parameters import catalogue_effects, columns_of
from imuarray.engine.readings import arrange, part_of
from imuarray.engine.settings import SETTINGS
from imuarray.engine.start import start, with_derivatives
from imuarray.errors import InputError
from imuarray.geometry import sub_array
from imuarray.linear import scaled_solve
from imuarray.tails import QUARTILE, log_chi_square, log_normal, log_poisson
from imuarray_papers.blind.cases import Case, make

SHORT = 4.0  # s


def started(case, seed=1):
    """A search with the papers' model fitted, on a case's recording."""
    recording, truth = make(case, seed)
    readings = arrange(recording)
    effects = catalogue_effects()
    columns = columns_of(readings.array, effects, readings.position_prior_sd)
    search = Search(readings, columns, effects, lambda text: None)
    return search.fitted(), truth


@pytest.fixture(scope="module")
def clean():
    return started(Case("criticism-clean", duration=SHORT))[0]


@pytest.fixture(scope="module")
def scaled():
    """Gyroscope 3 scaled, 12 sigma."""
    case = Case("criticism", (("gyroscope_scale", (2,)),), 12.0, kind="one", duration=SHORT)
    return started(case)[0]


def test_derivatives_are_those_of_finite_differences(clean):
    """Prediction by motion, positions and every effect, at values that are not zero."""
    columns, readings = clean.columns, clean.readings
    rng, state = np.random.default_rng(5), clean.fit.state
    whole = columns.flat(state)
    whole += 0.1 * rng.standard_normal(whole.shape) * columns.prior_sd * columns.owner
    whole[0, :3] = 0.0
    state = columns.unflat(state, whole)

    def residual(state, wanted=(0,)):
        # the motion's share would hide it: readings less prediction, whitened
        observed = linearise(readings, columns, state, wanted)
        left = observed.residual.reshape(len(observed.residual), -1)
        return left + np.einsum("tri,ti->tr", observed.basis, observed.absorbed), observed

    here, observed = residual(state, None)
    imu = 3
    for column in range(columns.size):
        if not columns.owner[imu, column]:
            continue
        step = 1e-5 * columns.prior_sd[column]
        moved = []
        for sign in (1, -1):
            other = whole.copy()
            other[imu, column] += sign * step
            moved.append(residual(columns.unflat(state, other))[0])
        slope = -(moved[0] - moved[1]).reshape(len(here), -1, 6)[:, imu] / (2 * step)
        wanted = observed.whitened[:, imu, :, column]
        scale = np.abs(wanted).max() + 1e-12
        assert np.abs(slope - wanted).max() < 2e-5 * scale, (columns.names[column], column)


def test_fit_equals_least_squares_over_everything_at_once():
    """Motion and positions of 40 samples, priors included, by scipy."""
    recording, _ = make(Case("criticism-small", duration=SHORT), 2)
    readings = arrange(recording)
    readings = part_of(readings, 200)
    columns = columns_of(readings.array, (), readings.position_prior_sd)
    active = columns.owner.copy()
    first = start(readings, columns)
    made = fit(readings, columns, active, first, smooth=False)
    samples = len(readings.time)
    nominal = readings.array.relative[1:]

    def cost(flat):
        motion, places = flat[: 9 * samples].reshape(samples, 9), flat[9 * samples :]
        positions = np.vstack([np.zeros(3), places.reshape(-1, 3)])
        w, a, s = motion[:, None, :3], motion[:, None, 3:6], motion[:, None, 6:]
        force = np.cross(w, np.cross(w, positions)) + np.cross(a, positions) + s
        both = np.concatenate([force, np.broadcast_to(w, force.shape)], axis=2)
        prior = (places - nominal.ravel()) / readings.position_prior_sd
        return np.concatenate([(readings.weights * (readings.values - both)).ravel(), prior])

    # near the optimum: the oracle has 9 T + 21 unknowns and no structure
    begin = np.concatenate([made.state.motion.ravel(), made.state.positions[1:].ravel()])
    begin[9 * samples :] += 1e-5
    pattern = jacobian_pattern(samples, len(nominal) + 1)
    found = least_squares(
        cost, begin, jac_sparsity=pattern, x_scale="jac", xtol=1e-13, ftol=1e-13, max_nfev=40
    )
    places = found.x[9 * samples :].reshape(-1, 3)
    sds = np.sqrt(np.diag(np.linalg.inv(information_of(made))))
    away = (made.state.positions[1:] - places).ravel() / sds
    assert np.abs(away).max() < 0.05
    offset = (made.state.positions[1:] - nominal) / readings.position_prior_sd
    assert made.misfit + np.sum(offset**2) == pytest.approx(2 * found.cost, rel=1e-5)


def jacobian_pattern(samples, count):
    rows = 6 * count
    pattern = lil_matrix((samples * rows + 3 * (count - 1), 9 * samples + 3 * (count - 1)))
    for t in range(samples):
        pattern[t * rows : (t + 1) * rows, 9 * t : 9 * t + 9] = 1
        pattern[t * rows : (t + 1) * rows, 9 * samples :] = 1
    pattern[samples * rows :, 9 * samples :] = 1
    return pattern


def information_of(made):
    given = information_at(made)
    places = given.places(made.active)
    return given.information[np.ix_(places, places)] + made.precision


def test_a_score_is_what_a_refit_gains(scaled):
    """Chi-square from one fit of the papers' model against the drop in misfit of a refit."""
    tried = candidates(scaled.columns, scaled.readings.exists, scaled.effects)
    scores = {
        (s.candidate.effect, s.candidate.imus): s
        for s in score_all(scaled.given, scaled.fit, tried)
    }
    for effect, imu in (("gyroscope_scale", 2), ("accelerometer_bias", 4), ("gyroscope_delay", 6)):
        score = scores[effect, (imu,)]
        active = scaled.active | score.candidate.mask(scaled.columns)
        made = fit(scaled.readings, scaled.columns, active, scaled.fit.state, scaled.smooth)
        gained = objective(scaled.fit) - objective(made)
        assert score.statistic == pytest.approx(gained, rel=0.05, abs=0.3), effect
    assert scores["gyroscope_scale", (2,)].statistic > 100


def objective(made):
    """Misfit and priors."""
    values = made.columns.flat(made.state)
    nominal = np.zeros_like(values)
    nominal[: len(made.state.positions), :3] = made.readings.array.relative
    away = ((values - nominal) / made.columns.prior_sd)[made.active]
    return made.misfit + np.sum(away**2)


def test_scores_of_a_clean_recording_are_chi_square(clean):
    tried = candidates(clean.columns, clean.readings.exists, clean.effects)
    scores = score_all(clean.given, clean.fit, [c for c in tried if not c.whole])
    p = np.array([chi2.sf(s.statistic, s.freedom) for s in scores])
    assert len(p) > 80
    assert 0.3 < p.mean() < 0.7
    assert min(s.log_p for s in scores) > CRITICAL.effect


def test_log_tail_goes_on_where_the_tail_underflows():
    for freedom in (1, 3, 24):
        x = chi2.isf(1e-200, freedom)
        assert log_chi_square(x, freedom) == pytest.approx(np.log(1e-200), rel=1e-6)
        near, far = (log_chi_square(x + freedom, freedom) for x in (1290.0, 1310.0))
        assert near - far == pytest.approx(10.0, rel=0.05)


@pytest.mark.parametrize("order", [1, 2, 3])
@pytest.mark.parametrize("place", [0, 3, 8])
def test_taps_are_those_of_scipy_signal(order, place):
    for degree in (4, 6):
        expected = savgol_coeffs(9, degree, deriv=order, pos=place, use="dot")
        np.testing.assert_allclose(polynomial_taps(9, place, order, degree), expected, atol=1e-11)


def test_tails_are_those_of_scipy_stats():
    z, counts = np.linspace(-3, 12, 7), np.array([0, 1, 5, 40])
    np.testing.assert_allclose(log_normal(z), norm.logsf(z), rtol=1e-12)
    np.testing.assert_allclose(log_poisson(counts, 4.2), poisson.logsf(counts - 1, 4.2), rtol=1e-12)
    assert log_chi_square(7.0, 3) == pytest.approx(chi2.logsf(7.0, 3), rel=1e-12)
    assert QUARTILE == pytest.approx(norm.ppf(0.75), rel=1e-15)


def test_heldout_scores_are_those_of_refits_without_each_block(clean):
    """Parameters trained on nine tenths of time, the last tenth's density from its own misfit."""
    made = clean.fit
    scores = log_scores(made)
    blocks = blocks_of(len(made.residual))
    for block in (0, 5):
        inside = np.zeros(len(made.residual), bool)
        inside[blocks[block]] = True
        information, score = normal(made, made.active, ~inside)
        values = made.columns.flat(made.state)[made.active]
        offset = values - nominal_of(made)[made.active]
        step = np.linalg.solve(information + made.precision, score - made.precision @ offset)
        flat = made.columns.flat(made.state)
        flat[made.active] += step
        state = made.columns.unflat(made.state, flat)
        moved = fit(clean.readings, clean.columns, np.zeros_like(made.active), state, clean.smooth)
        difference = -(moved.misfits[inside].sum() - made.misfits[inside].sum()) / 2
        own = scores.nats[block] + made.misfits[inside].sum() / 2 + constants(made, inside)
        assert own == pytest.approx(difference, abs=0.2)


def nominal_of(made):
    out = np.zeros(made.active.shape)
    out[: len(made.state.positions), :3] = made.readings.array.relative
    return out


def constants(made, inside):
    keep = made.readings.keep[inside]
    logs = np.where(keep, np.repeat(np.log(made.readings.sd), 3, axis=1), 0.0).sum()
    many = keep.sum() - 9 * inside.sum()
    return logs + made.log_volume[inside].sum() / 2 + np.log(2 * np.pi) / 2 * many


def test_noise_scales_are_unbiased_with_the_errors_they_claim(clean):
    """The residual of replicates, refitted: z of the log ratios has mean 0 and sd 1."""
    draw = replicator(clean.fit)
    rng, z = np.random.default_rng(8), []
    for _ in range(12):
        drawn = replace(clean.fit, residual=draw(rng))
        log_ratio, covariance = variance.whole_scales(drawn)
        z.append(log_ratio / np.sqrt(np.diag(covariance)))
    z = np.array(z)
    assert abs(z.mean()) < 0.3
    assert 0.8 < z.std() < 1.2


def test_a_triads_residual_is_normal_where_few_others_are():
    """Of four IMUs; each reading by itself scaled, the squares' sum has a second moment of 17."""
    recording, _ = imuarray.simulate(sub_array(imuarray.mimu4444(), 4), 3.0)
    readings, rng = arrange(recording), np.random.default_rng(4)
    columns = columns_of(readings.array, (), readings.position_prior_sd)
    made = fit(readings, columns, columns.owner, start(readings, columns))
    fourth = []
    for _ in range(40):
        left = made.less_motion(rng.standard_normal(made.residual.shape))
        found = [variance.triad(replace(made, residual=left), imu, 0) for imu in range(4)]
        fourth.append(np.mean(np.sum(np.square(found), axis=2) ** 2))
    assert np.mean(fourth) == pytest.approx(15, abs=0.6)


def test_a_noisy_triad_is_found_and_the_others_are_not():
    case = Case("criticism-noise", (("accelerometer_noise", (5,)),), 12.0, kind="one",
                duration=SHORT)  # fmt: skip
    search, truth = started(case)
    named = variance.noise_scale(search.fit, search.noise, 0, -7.5, np.zeros(8))
    assert named.imus == (5,)
    ratio, error, _ = named.parameters["ratio_6"]
    factor = truth["effects"][0]["parameters"]["factor"]["value"][0]
    assert abs(ratio - factor) < 4 * error
    assert variance.noise_scale(search.fit, search.noise, 1, -7.5, np.zeros(8)) is None


def test_fast_part_passes_white_noise_and_stops_what_is_smooth():
    rng = np.random.default_rng(3)
    run = np.repeat([0, 1], 500)
    noise = rng.standard_normal((1000, 2))
    smooth = 50 * np.sin(2 * np.pi * 0.01 * np.arange(1000))[:, None]
    fast = noises.fast_part(noise + smooth, run)
    assert np.nanstd(fast) == pytest.approx(1.0, abs=0.06)
    # no five samples across the gap between runs
    assert np.isnan(fast[498:502]).all()
    assert np.isfinite(fast[503:997]).all()


@pytest.mark.parametrize("effect", ["size_effect", "gyroscope_scale"])
def test_the_search_ends_at_the_optimum(effect):
    """Where the model lacks the cause, too, and what is left moves the optimum with the slopes."""
    recording, _ = make(Case("c", ((effect, (2,)),), 1000.0, kind="one", duration=2.5), 2)
    readings, free = arrange(recording), ("gyroscope_scale", "accelerometer_bias")
    columns = columns_of(readings.array, free, readings.position_prior_sd)
    active, state = columns.owner, start(readings, columns)
    state, converged, _ = search_optimum(readings, columns, active, state, True, False)
    observed = linearise(readings, columns, with_derivatives(readings, state, True))
    information, score = summed_normal(observed, active)
    precision = columns.prior_precision(active)
    off = columns.flat(state)[active] - columns.prior_means()[active]
    step, sds = scaled_solve(information + precision, score - precision @ off)
    assert converged and np.max(np.abs(step) / sds) < 0.5


def test_sawtooth_finds_its_period_frequency_and_offset():
    rng, time = np.random.default_rng(6), np.arange(3000) / 125
    information = rng.gamma(2.0, 1e8, 3000)
    age = 2e-5 + 1e-3 * ((0.83 * time + 0.3) % 1 - 0.5)
    score = -information * age + np.sqrt(information) * rng.standard_normal(3000)
    gain, (period, frequency, _, offset, drift) = sawtooth(time, score, information)
    assert gain > 1000
    assert period == pytest.approx(1e-3, rel=0.05)
    assert abs(frequency) == pytest.approx(0.83, abs=0.01)
    assert offset == pytest.approx(2e-5, abs=2e-5)
    assert drift == 0.0
    null = sawtooth(time, np.sqrt(information) * rng.standard_normal(3000), information)[0]
    assert null < 45


def test_a_clock_in_coloured_noise_must_show_more():
    case = Case("c", (("coloured_noise", tuple(range(8))),), None, kind="one", duration=SHORT)
    search, _ = started(case, 3)
    given, white = search.given, replace(search.given, meat=None, correlation=None)
    rho, clock = given.correlation[0].max(), (1e-3, 1.0)
    density = (1 - rho**2) / np.abs(1 - rho * np.exp(-2j * np.pi / 125)) ** 2
    assert wider(search.fit, given, 0, clock) == pytest.approx(density, rel=1e-4) and density > 3
    assert wider(search.fit, white, 0, clock) == 1.0
    best = [
        min(found.log_p for found in sawtooth_scan(search.fit, one, range(8), ()))
        for one in (given, white)
    ]
    assert best[0] > best[1] + 50


def test_replicates_have_the_residual_s_size(clean):
    draw = replicator(clean.fit)
    rng = np.random.default_rng(4)
    drawn = np.array([draw(rng) for _ in range(8)])
    share = 1.0 - clean.fit.leverage
    assert np.mean(drawn**2) / np.mean(share) == pytest.approx(1.0, abs=0.01)
    ratio = np.mean(drawn**2, axis=(0, 1)) / np.mean(share, axis=0)
    assert np.abs(ratio - 1).max() < 0.1


def test_discrepancies_of_a_clean_recording_are_few(clean):
    found = discrepancies(clean.fit, np.random.default_rng(1), 39)
    p = np.array([item.p_value for item in found])
    assert len(p) > 14
    assert np.mean(p <= 0.05) < 0.3
    assert all(np.isfinite(item.statistic) for item in found)


def test_discrepancies_see_a_scaled_gyroscope(scaled):
    found = discrepancies(scaled.fit, np.random.default_rng(1), 39)
    assert found[0].p_value <= 0.05
    assert any("3" in sensor for sensor in found[0].sensors)


def test_part_of_a_recording_keeps_whole_stretches(clean):
    part = part_of(clean.readings, 250)
    assert SETTINGS.least_samples <= len(part.time) <= 300
    assert np.all(np.isin(part.time, clean.readings.time))
    steps = np.diff(part.time)
    assert np.all((steps < 0.0121) | (np.diff(part.run) > 0))


def test_too_few_samples_are_refused():
    recording, _ = make(Case("criticism-short", duration=1.0), 1)
    with pytest.raises(InputError, match="at least 200 moving samples"):
        arrange(recording)


@pytest.mark.parametrize(
    "alone, least, chosen",
    [(1046, 381, "single"), (1046, 100, "every"), (700, 600, "every"), (1046, None, "part")],
)
def test_all_are_not_named_for_what_one_has(alone, least, chosen):
    """Rough motion (None) leaves a rest of a test of all that is more than chance, and no cause."""
    every = Score(Candidate("bias_drift", (0, 1, 2), "gyroscope linear", True), 1240.0, 18, -532.0)
    part = Score(Candidate("gyroscope_bias", (2,)), 1100.0, 3, -520.0)
    single = Score(Candidate("bias_drift", (2,), "gyroscope linear"), float(alone), 6, -500.0)
    proposed = [every, part, single]
    search = SimpleNamespace(smooth=least is not None, least=least)
    assert narrowest(proposed, search) is {"every": every, "part": part, "single": single}[chosen]
    assert narrowest(proposed[1:], search) is part


def test_another_imu_is_judged_by_what_it_adds(scaled):
    """The gain of both is no evidence for the one beside which the other has the effect."""
    both = replace(scaled, causes=(Cause("gyroscope_scale", (2, 4), frozenset({""}), -99.0),))
    both = both.refit(both.started())
    there = [
        np.where(np.arange(len(both.active))[:, None] == k, both.active, False) for k in (2, 4)
    ]
    whole, error = heldout_gain(both, "gyroscope_scale")
    assert whole > 3 * error
    gain, error = heldout_gain(both, "gyroscope_scale", there=there[0])
    assert gain < 1.5 * error
    gain, error = heldout_gain(both, "gyroscope_scale", there=there[1])
    assert gain > 3 * error
