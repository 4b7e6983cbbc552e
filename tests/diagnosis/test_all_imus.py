"""What all IMUs have a little of: seen together, and not as one's; and the other way round."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from imuarray.diagnosis import noise as noises
from imuarray.diagnosis import noise_effects
from imuarray.diagnosis.reading_effects import find_rails, find_repeats
from imuarray.diagnosis.scans import maybe_warming, scan_shifts, scan_warming
from imuarray.diagnosis.settings import SETTINGS
from imuarray.diagnosis.state import Cause, Search, prune
from imuarray.engine.heldout import gains_of, summed
from imuarray.engine.parameters import catalogue_effects, columns_of
from imuarray.engine.readings import ResidualMaps, arrange
from imuarray_papers.blind.cases import Case, make

EVERY, LIMIT = tuple(range(8)), -7.5


def searched(effect="", imus=EVERY, sigma=None, duration=6.0):
    """(a search with the papers' model fitted, the truth of the case)."""
    effects = ((effect, imus),) if effect else ()
    recording, truth = make(Case(f"all-{effect}", effects, sigma, duration=duration), 4)
    readings, effects = arrange(recording), catalogue_effects()
    columns = columns_of(readings.array, effects, readings.position_prior_sd)
    return Search(readings, columns, effects, lambda text: None).fitted(), truth


@pytest.fixture(scope="module")
def clean():
    return searched()[0]


def residual_of(search, noise):
    """(the fit with what is left of a noise (T, N, 6), what is judged of it)."""
    made = replace(search.fit, residual=search.fit.less_motion(noise))
    return made, noises.estimated(made.readings, made.residual, made.basis)


def test_a_rail_that_each_gyroscope_reaches_once():
    recording, _ = make(Case("all-rail", duration=4.0), 4)
    rail = np.sort(np.abs(recording.angular_rate).max(axis=(0, 2)))[0] * (1 - 1e-3)
    rate = np.clip(recording.angular_rate, -rail, rail)
    readings = arrange(replace(recording, angular_rate=rate))
    (cause,), lost = find_rails(readings)
    assert cause.imus == EVERY
    assert cause.parameters["gyroscope_rail"][0] == pytest.approx(rail)
    assert np.array_equal(lost[..., 3:], np.isclose(np.abs(rate), rail)) and not lost[..., :3].any()
    coarse = np.round(recording.angular_rate / 0.05) * 0.05  # all gyroscopes read much the same
    assert find_rails(arrange(replace(recording, angular_rate=coarse)))[0] == []


def test_a_sample_after_a_gap_may_repeat_the_one_that_is_gone():
    recording, _ = make(Case("all-gap", duration=4.0), 4)
    rate, force = recording.angular_rate.copy(), recording.specific_force.copy()
    for at in (50, 120, 250, 300):  # the third just after the gap
        rate[at, 2], force[at, 2] = rate[at - 1, 2], force[at - 1, 2]
    readings = arrange(replace(recording, angular_rate=rate, specific_force=force))
    there = np.ones(len(readings.time), bool)
    there[240:250] = False
    (cause,), lost = find_repeats(readings.select(there))
    assert cause.imus == (2,)
    assert list(np.flatnonzero(lost[:, 2].all(axis=1))) == [50, 120, 240, 290]
    assert not lost[:, [0, 1, 3, 4, 5, 6, 7]].any()


def test_steps_that_a_correction_has_mixed_repeat_by_chance():
    """Slow coarse gyroscopes repeat all axes now and then, under a map as without; not more."""
    rng, count = np.random.default_rng(5), 8
    plain = arrange(make(Case("all-coarse", duration=8.0), 4)[0])
    values = plain.values.copy()
    slow = values[: len(values) // 4, :, 3:]
    slow[:] = 0.02 * rng.standard_normal(slow.shape)  # noise of one step
    values[..., 3:] = np.round(values[..., 3:] / 0.02) * 0.02
    inverse = np.eye(3) + 0.01 * rng.standard_normal((2 * count, 3, 3))
    mixed = values.copy()
    mixed[..., 3:] = np.einsum("kij,tkj->tki", inverse[count:], values[..., 3:])
    left = ResidualMaps(np.eye(1), np.zeros((count, 6, 4, 4)), inverse.ravel())
    again = (values[1:, :, 3:] == values[:-1, :, 3:]).all(axis=2)
    assert again.sum() > 20
    stale = mixed.copy()
    stale[400:700:20, 2, 3:] = mixed[399:699:20, 2, 3:]
    for given, imus in ((mixed, ()), (stale, (2,))):
        causes, lost = find_repeats(replace(plain, values=given, left=left))
        assert tuple(imu for cause in causes for imu in cause.imus) == imus
        assert not imus or lost[400:700:20, 2, 3].all()


def test_triads_that_move_at_one_instant():
    search, truth = searched("position_shift", sigma=8.0)
    (*single, whole) = scan_shifts(search.fit, search.given, list(EVERY))
    assert whole.candidate.whole and whole.candidate.imus == EVERY
    assert whole.log_p < min(LIMIT, *(one.log_p for one in single))
    instant = truth["effects"][0]["parameters"]["instant"]["value"]
    assert whole.values[3][3] == pytest.approx(instant, abs=2 * 6.0 / SETTINGS.cuts)


def test_a_position_shift_of_none(clean):
    found = scan_shifts(clean.fit, clean.given, list(EVERY))
    assert all(one.log_p > -4.0 for one in found)


def test_tails_of_all_accelerometers(clean):
    rng = np.random.default_rng(3)
    noise = rng.standard_normal(clean.fit.residual.shape)
    assert noise_effects.heavy_tails(*residual_of(clean, noise), LIMIT)[0] is None
    wild = rng.random(noise.shape[:2]) < 0.05
    noise[..., :3] *= np.where(wild, 1.7, 1.0)[..., None]
    named, hits, _ = noise_effects.heavy_tails(*residual_of(clean, noise), LIMIT)
    assert named.imus == EVERY and {kind for _, kind, _ in hits} == {0}


def test_a_little_colour_of_all_gyroscopes(clean):
    rng = np.random.default_rng(5)
    noise = rng.standard_normal(clean.fit.residual.shape)
    noise[1:, :, 3:] += 0.08 * noise[:-1, :, 3:]
    noise[1:, 2, 3:] += 0.06 * noise[:-1, 2, 3:]
    named = noise_effects.coloured(*residual_of(clean, noise), LIMIT, untied=True)
    assert named.imus == EVERY
    assert all("gyroscope" in name for name in named.parameters)


def ar(rng, rho, shape):
    """AR(1) noise of unit variance along the first axis."""
    out = rng.standard_normal(shape)
    for at in range(1, len(out)):
        out[at] = rho * out[at - 1] + np.sqrt(1 - rho**2) * out[at]
    return out


@pytest.mark.parametrize("rho", [0.6, 0.9, -0.6])
def test_one_accelerometers_colour_is_not_that_of_others(clean, rho):
    """Taken for half as loud as it is; the motion passes it on to the other accelerometers."""
    rng = np.random.default_rng(7)
    noise = rng.standard_normal(clean.fit.residual.shape)
    noise[:, 3, :3] = 2 * ar(rng, rho, noise[:, 3, :3].shape)
    made, judged = residual_of(clean, noise)
    found = noise_effects.colours(made, judged)
    z = (found.rho - rho * (found.triads == [3, 0]).all(axis=1)) * np.sqrt(found.pairs)
    assert np.abs(z).max() < 4.5
    assert found.power[6] == pytest.approx(4, rel=0.3)
    named = noise_effects.coloured(made, judged, LIMIT, untied=True)
    assert named.imus == (3,) and named.gain > 5 * named.gain_se


def passing(rng, sds, samples, missing=0):
    """A fit of gyroscopes alone (their motion is one rate), with noise of the sds taken for one."""
    count = len(sds)
    basis = np.zeros((samples, 6 * count, 3))
    weight = 1 / np.asarray(sds)
    for imu in range(count):
        basis[:, 6 * imu + 3 : 6 * imu + 6] = weight[imu] * np.eye(3) / np.linalg.norm(weight)
    keep = np.ones((samples, count, 6), bool)
    if missing:
        keep[::missing, 0, 3:] = False
    exists = np.tile([False, True], (count, 1))
    readings = SimpleNamespace(keep=keep, run=np.zeros(samples), exists=exists)

    def left(noise):
        flat = noise.reshape(samples, -1, 1)
        flat = flat - basis @ (np.swapaxes(basis, 1, 2) @ flat)
        return SimpleNamespace(readings=readings, basis=basis, residual=flat.reshape(noise.shape))

    return left(rng.standard_normal((samples, count, 6))), left


def test_shares_of_noise_that_the_motion_passes_on():
    """Against noise of one gyroscope after the other; the best one's goes to all others."""
    rng = np.random.default_rng(8)
    white, left = passing(rng, [1, 2, 2, 3], 4000)
    triads = np.argwhere(white.readings.exists)
    share, alike = noises.passed_on(white, triads)
    for place, (imu, _) in enumerate(triads):
        noise = np.zeros((4000, 4, 6))
        noise[:, imu, 3:] = rng.standard_normal((4000, 3))
        power = [np.mean(noise_effects.triad(left(noise), *other) ** 2) for other in triads]
        assert power == pytest.approx(share[:, place], rel=0.1)
    assert np.abs(share - share.T).max() > 0.1  # which is which matters
    ends = [noise_effects.triad(white, *pair) for pair in triads]
    products = np.array([(x[1:] * x[:-1]).sum(axis=1) for x in ends])
    assert np.corrcoef(products) == pytest.approx(alike, abs=0.06)


@pytest.mark.parametrize("sds", [(1, 1), (1, 3, 3, 3), (1, 10, 10)])
def test_white_noise_has_no_colour_however_few_show_it(sds):
    """Two gyroscopes' residuals are one and the same; of one far better than the others is none."""
    rng, far, powers = np.random.default_rng(9), 0, []
    for _ in range(40):
        white, _ = passing(rng, sds, 300, missing=13)
        judged = SimpleNamespace(slope=np.zeros((len(sds), 2)))
        found = noise_effects.colours(white, judged)
        far += found.pooled(np.ones(len(found.rho), bool)) < np.log(0.05)
        assert np.all(found.pairs <= 900) and np.all(np.isfinite(found.rho))
        powers.append(found.power)
    assert far < 8  # of two that are expected
    assert np.mean(powers, axis=0) == pytest.approx(1.0, abs=0.1)


def test_a_spectrum_without_alike_neighbours_is_no_colour(clean):
    """One triad's noise is alike two samples apart: its upper spectrum falls, neighbours differ."""
    noise = np.random.default_rng(6).standard_normal(clean.fit.residual.shape)
    noise[2:, 3, :3] -= 0.6 * noise[:-2, 3, :3]
    made, judged = residual_of(clean, noise)
    assert abs(judged.slope[3, 0]) > 7
    assert noise_effects.coloured(made, judged, LIMIT, untied=False) is None


def test_one_that_drifts_is_no_warm_up():
    search, _ = searched("bias_drift", (4,), 40.0)
    assert scan_warming(search.fit, search.given, list(EVERY)) == []
    search, _ = searched("warm_up", EVERY, 60.0)
    (found,) = scan_warming(search.fit, search.given, list(EVERY))
    assert found.candidate.imus == EVERY


def test_small_biases_of_all_may_be_a_warm_up():
    for sigma, may in (8.0, True), (60.0, False):
        search, _ = searched("gyroscope_bias", EVERY, sigma)
        cause = Cause("gyroscope_bias", EVERY, frozenset({""}), -20.0)
        assert maybe_warming(replace(search, causes=(cause,)).refit(), cause, 0.0) is may


@pytest.mark.parametrize("effect", ["sensor_delay", "gyroscope_scale", "accelerometer_scale"])
def test_all_are_not_named_for_two_of_eight(effect):
    """As the delays' mean is nobody's, every delay is far from zero while it is pinned there."""
    search, _ = searched(effect, (2, 5), 60.0)
    cause = Cause(effect, EVERY, frozenset({""}), -20.0)
    (found,) = prune(replace(search, causes=(cause,)).refit(), effect).causes
    assert found.imus == (2, 5)


def test_parameters_of_which_nothing_is_known_cost_no_gain():
    rng = np.random.default_rng(1)
    parts = []
    for _ in range(6):
        slopes = rng.standard_normal((40, 3))
        parts.append((slopes.T @ slopes, slopes.T @ (0.05 * slopes[:, 0] + rng.normal(size=40))))
    inner, score = (sum(part) for part in zip(*parts, strict=True))
    values = np.linalg.solve(inner + np.eye(3), score)
    left = [(block, slope - block @ values) for block, slope in parts]
    wanted = gains_of(left, (np.eye(3), values), values, np.array([True, True, False]))
    more = [(np.pad(block, (0, 2)), np.pad(slope, (0, 2))) for block, slope in left]
    values = np.pad(values, (0, 2))
    found = gains_of(more, (np.eye(5), values), values, np.array([True, True, False, True, True]))
    assert found == pytest.approx(wanted, rel=1e-9)


def test_a_triad_that_the_motion_follows_keeps_some_noise(clean):
    residual = clean.fit.residual.copy()
    residual[:, 0, :3] = 0.0
    judged = noises.estimated(clean.readings, residual, clean.fit.basis)
    declared = clean.readings.declared
    assert judged.sd[0, 0] == pytest.approx(SETTINGS.least_noise * declared[0, 0])
    assert np.all(np.isfinite(judged.sd[clean.readings.exists]))


@pytest.mark.parametrize(
    ("has", "freed"),
    [([3, 4], [0, 1, 2, 5, 6, 7]), ([3, 4], [3, 4]), ([3], [3]), ([], [7]), ([3], range(8))],
)
def test_the_rival_of_some_imus_keeps_no_pinned_mean(has, freed):
    """Readings show eight IMUs' differences; ``has`` three prior sds, and ``freed`` are asked for.

    The gain is that of refits on all blocks but one; without the freed ones nothing is pinned.
    """
    rng, count, blocks = np.random.default_rng(3), 8, 10
    data = 50.0 * (np.eye(count) - 1 / count)
    scores = [
        data @ np.isin(range(count), has) * 3.0 + np.sqrt(1 / 50) * data @ rng.normal(size=count)
        for _ in range(blocks)
    ]
    own, pin = np.eye(count), np.full((count, count), (1e3 / count) ** 2)
    values = np.linalg.solve(blocks * data + own + pin, sum(scores))
    parts = [(data, score - data @ values) for score in scores]
    mine = np.isin(range(count), freed)
    alone = own * ~mine * ~mine[:, None]
    found = summed(gains_of(parts, (own + pin, np.zeros(count)), values, mine, rival=alone))
    wanted = []
    for held in scores:
        trained, more = sum(scores) - held, (blocks - 1) * data
        rest, less = ~mine, np.zeros(count)
        square = np.ix_(rest, rest)
        less[rest] = np.linalg.solve((more + own)[square], trained[rest])
        both = np.linalg.solve(more + own + pin, trained), less
        nats = [held @ x - x @ data @ x / 2 for x in both]
        wanted.append(nats[0] - nats[1])
    assert found[0] == pytest.approx(sum(wanted), abs=0.05 * abs(sum(wanted)) + 1.5)
    assert (found[0] > 3 * found[1]) == (len(freed) == count)  # else the others shift alike
