"""The engine's least squares against a dense one, its noise, its robustness, joint recordings."""

from dataclasses import replace
from types import SimpleNamespace

import jax
import numpy as np
import pytest
from scipy.stats import kstest

import imuarray
from imuarray.engine.dataset import engine_dataset
from imuarray.engine.estimate import (
    Recorded,
    _linearised,
    _solvable,
    estimate,
    jackknifed,
    means,
    paced,
    steady,
    to_come,
)
from imuarray.engine.estimate import tested as at_more
from imuarray.engine.forward import _of_one_truth, select_forward
from imuarray.engine.linearise import linearise, reading, relinearised
from imuarray.engine.normal import uncorrelated
from imuarray.engine.parameters import POSITION, columns_of, stepped
from imuarray.engine.readings import arrange, most_informative, resolution
from imuarray.engine.robust import Linearised
from imuarray.engine.settings import SETTINGS
from imuarray.engine.start import _slope_prior, gain_error, start, turned
from imuarray.engine.widths import (
    _with_maps,
    hausman,
    residual_map_mask,
    spread_of,
    widened,
    widths,
)
from imuarray.errors import IdentifiabilityError, InputError
from imuarray.geometry import Array, sub_array
from imuarray.model.effects import Prediction
from imuarray.motion.state import Motion

EFFECTS = ("gyroscope_bias", "accelerometer_scale")
TWISTING = {"angular_rate": 15.0, "sampling_rate": 100.0}


def simulated(duration=3.0, seed=1, effects=(), **more):
    array = sub_array(imuarray.mimu4444(), 4)
    return imuarray.simulate(
        array, duration=duration, seed=seed, effects=effects, **TWISTING, **more
    )


def errors(found, truth):
    return (found.positions - truth["position"].to_numpy())[1:]


def position_sds(found):
    place = found.places[0][np.argwhere(found.active)[:, 1] < 3]
    return np.sqrt(np.diag(widths(found)[0]))[place].reshape(-1, 3)


def fitted(recording, effects=(), **options):
    readings = arrange(recording, sparse=True)
    columns = columns_of(readings.array, effects, readings.position_prior_sd)
    active = columns.mask([POSITION, *effects])
    return estimate([Recorded.of(readings, columns)], columns, active, **options)


def test_normal_equations_are_the_dense_ones():
    """Motion eliminated sample by sample = the Schur complement of all unknowns' information."""
    recording, _ = simulated(0.12, effects=EFFECTS)
    readings = replace(arrange(recording, sparse=True), gapless=False)
    columns = columns_of(readings.array, EFFECTS, readings.position_prior_sd)
    active = columns.mask([POSITION, *EFFECTS])
    state = Recorded.of(readings, columns).state
    linear, residuals = Linearised.of(readings, columns, state, active, improved=3)
    blocks, motion = linear.equations(active)
    again = Linearised.of(readings, columns, linear.state, active, held=False)[0]
    for one, other in zip(blocks, again.equations(active)[0], strict=True):
        np.testing.assert_allclose(one[0], other[0], rtol=1e-9, atol=1e-9 * np.abs(one[0]).max())
    model, pairs = columns.model, np.argwhere(active)
    base = columns.flat(state)

    def residual(unknowns):
        moved, p = unknowns[: motion.size].reshape(motion.shape), unknowns[-len(pairs) :]
        whole = jax.numpy.array(base).at[pairs[:, 0], pairs[:, 1]].set(p)
        values = [whole[:, columns.of(name)].ravel() for name in EFFECTS]
        values = {name: value for name, value in zip(EFFECTS, values, strict=True)}
        flat = jax.numpy.concatenate([values[item.id] for item in model.chain])

        def one(x):
            at = Motion(x[:3], x[3:6], x[6:9], jax.numpy.zeros(3), jax.numpy.zeros(3))
            both = model.predict(at, whole[:, :3], flat)
            return jax.numpy.concatenate([both.specific_force, both.angular_rate], axis=1)

        return (readings.weights * (readings.values - jax.vmap(one)(moved))).ravel()

    at = np.concatenate([motion.ravel(), base[active]])
    jacobian, left = np.asarray(jax.jacfwd(residual)(at)), np.asarray(residual(at))
    cut = motion.size
    inner, cross, outer = (
        jacobian[:, :cut].T @ jacobian[:, :cut], jacobian[:, :cut].T @ jacobian[:, cut:],
        jacobian[:, cut:].T @ jacobian[:, cut:],
    )  # fmt: skip
    schur = outer - cross.T @ np.linalg.solve(inner, cross)
    slope = -jacobian.T @ left
    slope = slope[cut:] - cross.T @ np.linalg.solve(inner, slope[:cut])
    scale = np.sqrt(np.diag(outer))
    information, score = sum(b[0] for b in blocks), sum(b[1] for b in blocks)
    close = {"rtol": 0, "atol": 1e-9}
    np.testing.assert_allclose(
        information / np.outer(scale, scale), schur / np.outer(scale, scale), **close
    )
    np.testing.assert_allclose(score / scale, slope / scale, rtol=0, atol=1e-6)
    assert residuals.freedom.sum() == pytest.approx(readings.keep.sum() - cut)


def test_another_state_is_seen_by_the_derivatives_of_one_near_by():
    """Where they are the same, as `linearise` sees it; where not, the residual less that motion."""
    recording, _ = simulated(2.0)
    readings = arrange(recording, sparse=True)
    columns = columns_of(readings.array, ("gyroscope_scale",), readings.position_prior_sd)
    state = Recorded.of(readings, columns).state
    seen = linearise(readings, columns, state)
    for field, again in zip(seen, relinearised(readings, columns, state, seen), strict=True):
        np.testing.assert_allclose(again, field, rtol=1e-9, atol=1e-9)
    rate, scale = state.motion[0, :3], np.full(4, 1e-3)
    moved = state._replace(parameters=np.repeat(scale, 3))
    again = relinearised(readings, columns, moved, seen)
    change = np.zeros((4, 6))
    change[:, 3:] = -1e-3 * rate / readings.sd[:, 1:]
    basis = seen.basis[0]
    expected = seen.residual[0].ravel() + change.ravel() - basis @ (basis.T @ change.ravel())
    np.testing.assert_allclose(again.residual[0].ravel(), expected, rtol=1e-9, atol=1e-9)


def test_positions_sds_and_noise_are_right():
    """Noise twice and half the declared one: found, and the sds follow."""
    z, noise = [], []
    for seed in range(4):
        recording, truth = simulated(2.0, seed, accelerometer_noise=0.08, gyroscope_noise=2e-3)
        declared = replace(recording, accelerometer_noise_sd=0.04, gyroscope_noise_sd=4e-3)
        found = fitted(declared)
        assert found.converged and found.freedoms.min() >= 10
        z.append(errors(found, truth) / position_sds(found))
        noise.append(found.noise_sd())
    assert 0.6 < np.sqrt(np.mean(np.square(z))) < 1.4
    np.testing.assert_allclose(np.mean(noise, axis=0), [[0.08, 2e-3]] * 4, rtol=0.06)


def with_turning(found):
    """The estimate again, the rate's slope as prior of the angular acceleration."""
    begun = [replace(one, state=turned(one.readings, one.state, True)) for one in found.recorded]
    return estimate(begun, found.columns, found.active, noise="normal")


@pytest.mark.parametrize("kinds", [(1, 0), (0, 1), (1, 1)])
@pytest.mark.parametrize("again", [lambda found: found, with_turning])
def test_what_a_correction_left_widens_by_as_much_as_it_moves(kinds, again):
    """Maps of which one direction is uncertain, against readings that are changed along it."""
    recording, _ = simulated(2.0, bandwidth=2.0)
    recording = replace(recording, angular_rate_saturated=recording.saturated_gyroscopes())
    bare, rng = again(fitted(recording, noise="normal")), np.random.default_rng(2)
    changes = 2e-4 * rng.standard_normal((4, 3, 3)), np.tile(1e-3 * np.eye(3), (4, 1, 1))
    changes = np.array(kinds)[:, None, None, None] * np.array(changes)
    moved = {
        name: getattr(recording, name) + np.einsum("kij,tkj->tki", change, getattr(recording, name))
        for name, change in zip(("specific_force", "angular_rate"), changes, strict=True)
    }
    other = again(fitted(replace(recording, **moved), noise="normal"))
    size = np.abs(other.positions - bare.positions)[1:].ravel()
    # so small that the readings say nothing of it
    spread = 0.05**2 * np.outer(changes, changes)
    left, known = (
        widened(again(fitted(replace(recording, map_covariance=part * spread), noise="normal")))
        for part in (1.0, 1e-6)
    )
    added = np.sqrt(widths(left)[1] ** 2 - widths(known)[1] ** 2)
    assert size.max() > 5e-6
    np.testing.assert_allclose(added, 0.05 * size, atol=0.15 * 0.05 * size.max())


def jointly(*recordings):
    readings = [arrange(one, sparse=True) for one in recordings]
    columns = columns_of(readings[0].array, (), readings[0].position_prior_sd)
    begun = [Recorded.of(one, columns) for one in readings]
    return estimate(begun, columns, columns.mask([POSITION]), noise="normal")


def test_recordings_that_one_calibration_corrected_err_alike():
    """As much as one of them does; those of two calibrations in part cancel."""
    recording, _ = simulated(2.0, bandwidth=2.0)
    sd = 2e-5
    left = arrange(replace(recording, map_covariance=sd**2 * np.eye(72)), sparse=True).left
    one, again, other = (
        left._replace(removed=step * sd * np.ones(72), maps=(1 + step) * left.maps)
        for step in (0.0, 0.01, 0.2)
    )

    def added(*lefts):
        bare = jointly(*[recording] * len(lefts))
        recorded = tuple(
            replace(each, readings=replace(each.readings, left=own))
            for each, own in zip(bare.recorded, lefts, strict=True)
        )
        return widths(widened(replace(bare, recorded=recorded)))[1] ** 2 - widths(bare)[1] ** 2

    alone = added(one)
    for share, lefts in ((1.0, (one, again)), (0.55, (one, other))):
        np.testing.assert_allclose(added(*lefts), share * alone, rtol=0.05, err_msg=str(share))


def test_maps_that_are_off_are_no_scatter_between_blocks():
    recording, _ = simulated(4.0, bandwidth=2.0)
    rng, sd = np.random.default_rng(4), 5e-3
    change = sd * rng.standard_normal((4, 3, 3))
    moved = recording.specific_force + np.einsum("kij,tkj->tki", change, recording.specific_force)
    spread = np.diag(np.repeat([sd**2, 1e-14], 36))
    found = widened(jointly(replace(recording, specific_force=moved, map_covariance=spread)))
    _, formal, jackknife = widths(found)
    assert np.median(jackknife / formal) < 1.3


def test_one_step_beside_the_maps_is_the_whole_problem():
    """Positions and all maps, as far off as first order leaves them, fitted until nothing moves."""
    recording, _ = simulated(4.0, bandwidth=2.0)
    rng, sd = np.random.default_rng(4), np.repeat([1e-4, 3e-4], 36)
    accelerometers, gyroscopes = (sd * rng.standard_normal(72)).reshape(2, 4, 3, 3)
    moved = replace(
        recording, map_covariance=np.diag(sd**2),
        angular_rate_saturated=recording.saturated_gyroscopes(),
        specific_force=recording.specific_force
        + np.einsum("kij,tkj->tki", accelerometers, recording.specific_force),
        angular_rate=recording.angular_rate
        + np.einsum("kij,tkj->tki", gyroscopes, recording.angular_rate),
    )  # fmt: skip
    found = jointly(moved)
    left, now = [found.recorded[0].readings.left], _with_maps(found)
    maps = residual_map_mask(left, now.columns, now.active)
    active, given = now.active | maps, now.active[now.active | maps]
    prior, values = np.zeros((len(given), len(given))), np.zeros(len(given))
    prior[np.ix_(given, given)] = found.precision
    prior[np.ix_(~given, ~given)] = np.linalg.inv(spread_of(left[0], now.columns, maps))
    off = found.recorded, found.columns, found.active, found.places
    values[given] = found.values - means(*off)
    for _ in range(12):
        linear, _ = _linearised(now.recorded, now.columns, active, 1)
        now = replace(now, recorded=_solvable(now.recorded, linear, active)[0])
        blocks = at_more(now, active, [np.arange(len(given))]).blocks
        slope = sum(score for _, score in blocks) - prior @ values
        step = np.linalg.solve(sum(inner for inner, _ in blocks) + prior, slope)
        state = stepped(now.recorded[0].state, now.columns, active, step)
        now, values = replace(now, recorded=(replace(now.recorded[0], state=state),)), values + step
    first, whole = ((one.positions - found.positions)[1:] for one in (widened(found), now))
    sds = position_sds(widened(found))
    assert np.abs(step).max() < 1e-9 and np.abs(whole / sds).max() > 0.5
    assert np.abs((first - whole) / sds).max() < 0.1


def test_the_rates_change_says_more_than_the_accelerometers_of_turning():
    """Slower twisting, as the window of a derivative has to be short beside it."""
    ratios, z = [], []
    for seed in (1, 2):
        recording, truth = simulated(2.0, seed, bandwidth=2.0)
        alone = fitted(recording)
        (one,) = alone.recorded
        begun = replace(one, state=turned(one.readings, one.state))
        both = estimate([begun], alone.columns, alone.active)
        ratios.append(np.mean(position_sds(both) / position_sds(alone)))
        z.append(errors(both, truth) / position_sds(both))
    assert max(ratios) < 0.95 and 0.5 < np.sqrt(np.mean(np.square(z))) < 1.6


def test_two_imus_take_the_angular_acceleration_from_the_gyroscopes():
    """What the accelerometers leave open about the line between them; one of them is late."""
    array = Array(np.array([[0, 0, 0], [0.1, 0, 0]]), ("1", "2"), 2)
    how = {"angular_rate": 8.0, "bandwidth": 2.0, "effects": ("sensor_delay",)}
    recording, truth = imuarray.simulate(array, 4.0, 200.0, **how)
    found = imuarray.calibrate(recording)
    late = np.diff(truth["effect_parameter"]) - np.diff(found["effect_parameter"])
    assert found.attrs["effects"] == "sensor_delay" and np.abs(late) < 5e-6 < np.abs(
        np.diff(truth["effect_parameter"])
    )
    sds = np.sqrt(np.einsum("kaka->ka", found["position_covariance"].to_numpy()))[1]
    error = (found["position"].to_numpy() - truth["position"].to_numpy())[1]
    assert np.abs(error / sds).max() < 3 and sds.max() < 1e-4
    with pytest.raises(InputError, match="follow each other, of two IMUs, found too few"):
        imuarray.calibrate(recording.select(slice(None, None, 40)))
    with pytest.raises(InputError, match="follow each other, of two IMUs, found too few"):
        imuarray.apply(found, recording.select(slice(None, None, 40)))
    motion = imuarray.apply(found, recording)
    name = "angular_acceleration"
    # at the mean of the IMUs' instants
    expected = truth[name] + truth["effect_parameter"].mean() * truth["angular_jerk"]
    off = (motion[name] - expected) / motion[f"{name}_sd"]
    np.testing.assert_allclose(np.sqrt((off**2).mean("time")), 1.0, atol=0.25)
    (cause,) = imuarray.diagnose(recording, replicates=9).document["causes"]
    assert cause["effect"] == "sensor_delay"
    for step in (imuarray.sample, imuarray.select):
        with pytest.raises(IdentifiabilityError, match="at least 3 accelerometer triads, found 2"):
            step(recording)


def test_readings_far_out_lose_their_say():
    recording, truth = simulated(3.0)
    rng = np.random.default_rng(5)
    force = recording.specific_force.copy()
    hit = rng.random(force.shape[:2]) < 0.04
    force[hit] += 40 * recording.accelerometer_noise_sd * rng.standard_normal((hit.sum(), 3))
    struck = replace(recording, specific_force=force)
    clean, robust, plain = fitted(recording), fitted(struck), fitted(struck, noise="normal")
    size = [np.sqrt(np.mean(errors(f, truth) ** 2)) for f in (clean, robust, plain)]
    assert size[1] < 2.5 * size[0] < size[2]
    assert robust.freedoms[0] < 5 and robust.freedoms[1] >= 20
    # gone on from, it stays: its weights are known, and nothing is begun anew
    again = estimate(robust.recorded, robust.columns, robust.active)
    assert again.steps[0] < 0.1 and len(again.steps) < len(robust.steps)
    np.testing.assert_allclose(again.values, robust.values, atol=0.1 * position_sds(robust).min())


def test_sensors_that_agree_to_the_last_digit_have_the_noise_of_that_digit():
    recording, truth = simulated(3.0)
    step, middle = 0.05, np.median(recording.angular_rate, axis=1, keepdims=True)
    alike = np.broadcast_to(np.round(middle / step) * step, recording.angular_rate.shape)
    found = fitted(replace(recording, angular_rate=alike.copy()))
    np.testing.assert_allclose(found.noise_sd()[:, 1], step / np.sqrt(12), rtol=0.2)
    assert np.abs(errors(found, truth) / position_sds(found)).max() < 4


@pytest.mark.parametrize("decimals", [4, 8])
def test_the_step_of_a_sensor_is_seen_behind_the_rounding_of_its_log(decimals):
    rng, step = np.random.default_rng(3), 16 * 9.80665 / 2**15
    values = 0.5 * rng.standard_normal((3000, 1, 6))
    coarse = np.round(step * np.round(values / step), decimals)
    assert resolution(coarse) == pytest.approx(step, rel=0.03)
    assert not resolution(values).any() and not resolution(values[:50]).any()


def test_steps_that_shrink_alike_are_gone_at_once():
    """The sum of a geometric series; one where they go back, turn or shrink more and more."""
    way, other = np.array([2.0, -1.0, 0.5]), np.array([1.0, 2.0, 0.0])
    for share, whole in ((0.8, 1 / (1 - 0.8)), (0.6, 1 / (1 - 0.6)), (0.99, 8.0), (-0.7, 1.0)):
        assert to_come([way, share * way, share**2 * way]) == pytest.approx(whole)
    assert to_come([way, 0.8 * way]) == to_come([way, 0.8 * way, 0.5 * way]) == 1.0
    assert to_come([way, 0.8 * way, 0.6 * way + 0.2 * other]) == 1.0
    assert to_come(np.zeros((3, 2))) == 1.0


def test_half_steps_lead_into_a_valley_that_full_ones_cross():
    """A search whose full steps are 2.5 times too long, and so lead farther and farther away."""
    place, length, steps = 1.0, 1.0, []
    for _ in range(20):
        steps.append(np.array([-2.5 * place]))
        length = paced(length, steps)
        place += length * steps[-1][0]
    assert abs(place) < 1e-3
    assert paced(0.4, [np.ones(2), np.ones(2)]) == pytest.approx(0.6)
    assert paced(1.0, [np.ones(2)]) == 1.0


def test_a_search_ends_near_its_optimum(monkeypatch):
    """Heavy tails, and scales that nobody models: where it would end at last is near in its sds."""
    recording, _ = simulated(6.0, seed=4, effects=("accelerometer_scale",))
    off = np.random.default_rng(3).standard_t(2, recording.specific_force.shape)
    noise = arrange(recording).declared[:4, :1]
    made = replace(recording, specific_force=recording.specific_force + noise * off)
    found = widened(fitted(made))
    assert found.converged and len(found.steps) < 30
    slow = replace(SETTINGS, settled=1e-4, same_noise=1e-6)
    monkeypatch.setattr(imuarray.engine.estimate, "SETTINGS", slow)
    far = fitted(made, steps=200)
    assert far.converged and len(far.steps) > len(found.steps)
    left = (found.positions - far.positions)[1:] / position_sds(found)
    assert np.abs(left).max() < 0.1


def test_recordings_of_a_board_are_fitted_jointly():
    """Positions are the board's, biases each recording's own."""
    recordings = []
    for offset in (0.3, -0.2):
        recording, truth = simulated(2.0, 1)
        shifted = recording.specific_force + offset * np.eye(4)[2][:, None] * np.eye(3)[0]
        recordings.append(replace(recording, specific_force=shifted))
    effects = ("accelerometer_bias",)
    alone = [fitted(one, effects) for one in recordings]
    readings = [arrange(one, sparse=True) for one in recordings]
    columns = columns_of(readings[0].array, effects, readings[0].position_prior_sd)
    active = columns.mask([POSITION, *effects])
    both = estimate([Recorded.of(one, columns) for one in readings], columns, active)
    assert len(both.values) == len(alone[0].values) + 4 * 3
    for one, other in zip(both.recorded, alone, strict=True):
        bias = [columns.flat(r.state)[2, 3] for r in (one, other.recorded[0])]
        assert abs(bias[0]) > 0.05 and bias[0] == pytest.approx(bias[1], abs=2e-3)
    np.testing.assert_array_equal(*(one.state.positions for one in both.recorded))
    file = engine_dataset(recordings, both)
    assert file["position"].attrs["scope"] == "board" and set(file["scope"].values) == {"recording"}
    np.testing.assert_array_equal(file["own"], file["parameter"])
    x = file["own_parameter"].isel(own=6)  # of the third triad
    np.testing.assert_allclose(x, [columns.flat(r.state)[2, 3] for r in both.recorded])
    ratio = file["own_sd"] / engine_dataset(recordings[:1], alone[0])["effect_sd"].to_numpy()
    np.testing.assert_allclose(ratio.median("own"), 1.0, atol=0.1)
    # the same readings twice say twice as much
    assert np.mean(position_sds(both) / position_sds(alone[0])) == pytest.approx(
        np.sqrt(0.5), abs=0.12
    )


def test_a_clock_that_is_not_known_makes_the_size_twice_as_uncertain():
    recording, _ = simulated(2.0)
    found = [fitted(replace(recording, clock_sd=sd)) for sd in (np.nan, 1e-2)]
    more = position_sds(found[1]) ** 2 - position_sds(found[0]) ** 2
    expected = (2e-2 * found[0].positions[1:]) ** 2
    np.testing.assert_allclose(more, expected, rtol=0.2, atol=1e-3 * expected.max())


def test_a_prior_that_the_accelerometers_contradict_is_not_taken():
    """Stamps 0.2 % off: the rates' change is as wrong, and the residual hardly shows it."""
    recording, _ = simulated(6.0)
    for scale, alike in ((1.0, True), (1.002, False)):
        found = fitted(replace(recording, time=scale * recording.time))
        begun = [
            replace(one, state=turned(one.readings, one.state, follows=True))
            for one in found.recorded
        ]
        better = estimate(begun, found.columns, found.active)
        assert better.residual_ratio() < 1.02 * found.residual_ratio()
        assert _of_one_truth(found, better) is alike


def test_the_ladder_keeps_what_gains():
    recording, truth = simulated(3.0, effects=("gyroscope_delay",))
    found, groups = select_forward([arrange(recording, sparse=True)])
    # simulated to first order in the lag: what the fit has beyond looks like delays of IMUs
    kept = {group.name for group in groups if group.kept} - {"delay of each IMU"}
    assert kept == {"lag of the gyroscopes"}
    assert np.sqrt(np.mean((errors(found, truth) / position_sds(found)) ** 2)) < 2
    few = imuarray.select(simulated(3.0)[0], 60)
    found, groups = select_forward([arrange(few, sparse=True)])
    assert not any(group.kept for group in groups)
    # samples without neighbours say nothing of delays
    assert "delay of each IMU" not in {group.name for group in groups}


def test_a_long_recording_keeps_its_most_informative_stretches(monkeypatch):
    from imuarray.engine import readings as module

    monkeypatch.setattr(module, "SETTINGS", replace(module.SETTINGS, most=4 * 128, stretch=32))
    whole = arrange(simulated(3.0)[0])
    part = most_informative(whole, lambda text: None)
    assert len(part.time) == 128
    size = [np.mean(np.sum(r.values[:, 0, 3:] ** 2, axis=1) ** 2) for r in (part, whole)]
    assert size[0] > size[1]
    # stretches are several of a derivative's windows, however fast the samples
    fast = replace(whole, time=whole.time / 10)
    assert len(most_informative(fast, lambda text: None).time) > 100
    # a spin about one axis says nothing of the places along it
    spinning, about = np.arange(len(whole.time)) < 190, np.eye(3)
    rate = np.where(spinning[:, None], 30.0 * about[2], about[0])
    values = np.tile(np.hstack([np.zeros_like(rate), rate])[:, None], (1, 4, 1))
    part = most_informative(replace(whole, values=values), lambda text: None)
    assert {30.0, 1.0} == set(part.values[:, 0, 3:].max(axis=1))


def test_a_clock_that_wanders_is_read_at_other_ages():
    """As far as an offset of so many turns; what else an instant knows is not in its place."""
    columns = columns_of(sub_array(imuarray.mimu4444(), 3), ("sensor_clock",), 1e-3)
    places, x = np.eye(3), np.concatenate([np.arange(9.0), np.zeros(15)])
    flat = Prediction(np.zeros((3, 3)), np.zeros((1, 3)))
    read = []
    for offset, turns in ((0.25e-3, 0.0), (0.0, 0.25)):
        clock = np.tile([1e-3, 0.5, 0.1, offset, 0.0], 3)
        extra = np.zeros(3), np.zeros(3), flat, flat, None, np.full(3, turns)
        read.append(reading(columns.model, 3, x, places, clock, extra, 1.0, 9.0))
    np.testing.assert_allclose(*read, rtol=1e-12)
    assert np.abs(read[0][0, 3:] - x[:3]).max() > 1e-4


@pytest.mark.parametrize("known", [0.0, 300.0])
def test_a_block_that_holds_most_of_the_information_widens_no_sd(known):
    """3000 lines through blocks of 200 and nine times 4 points, the model right: E[sd^2] is the
    formal variance; leaving each block out, as a plain jackknife does, gives several times that.

    Where a slope is ``known`` beforehand, as well: what the prior says scatters, too.
    """
    rng, sizes = np.random.default_rng(5), [200, *[4] * 9]
    rows = [np.stack([np.ones(n), rng.uniform(0, 1 + 3 * (n > 4), n)], axis=1) for n in sizes]
    inner = [x.T @ x for x in rows]
    prior = np.diag([0.0, known])
    information = sum(inner) + prior
    found, plain = [], []
    for _ in range(3000):
        truth = np.array([0.0, rng.standard_normal() / known**0.5 if known else 0.0])
        scores = [x.T @ (rng.standard_normal(len(x)) + x @ truth) for x in rows]
        at = np.linalg.solve(information, sum(scores))
        left = [score - own @ at for own, score in zip(inner, scores, strict=True)]
        blocks = list(zip(inner, left, strict=True))
        found.append(jackknifed(sum(inner), prior, blocks) ** 2)
        moved = [np.linalg.solve(information - own, score) for own, score in blocks]
        plain.append(0.9 * np.sum(np.square(moved - np.mean(moved, axis=0)), axis=0))
    formal = np.diag(np.linalg.inv(information))
    np.testing.assert_allclose(np.mean(found, axis=0), formal, rtol=0.1)
    assert known or (np.mean(plain, axis=0) > 3 * formal).any()


@pytest.mark.parametrize("lost", [[0.36, 0.48, 0.8], [0.6, 0.8, 0.0], [1.0, 0.0, 0.0]])
def test_a_triads_residual_is_as_many_normal_ones_as_the_motion_leaves(lost):
    """A triad that lies in the motion's basis but for two directions: two, of their chi-square."""
    rng, sizes = np.random.default_rng(3), [1.0, 0.4, 0.9]
    axes = np.concatenate([np.array(lost)[:, None], rng.standard_normal((3, 2))], axis=1)
    basis = np.tile(np.linalg.qr(axes)[0] * sizes, (50, 1, 1))
    inside = np.eye(3) - basis @ basis.swapaxes(1, 2)
    residual = np.einsum("tij,tj->ti", inside, rng.standard_normal((50, 3)))
    found = uncorrelated(residual, basis, np.ones((50, 3), bool))
    assert (np.isfinite(found).sum(axis=1) == 2).all()
    expected = np.einsum("ti,tij,tj->t", residual, np.linalg.pinv(inside, 1e-6), residual)
    np.testing.assert_allclose(np.nansum(found**2, axis=1), expected, rtol=1e-2)


def test_a_calm_stretch_does_not_stand_for_the_fast_ones():
    """A polynomial's gain in motion of 20 Hz, whichever stretch of equal length comes first."""
    time = np.arange(400) / 200.0
    fast = np.where(time < 1.0, 0.0, 3.0)[:, None] * np.sin(2 * np.pi * 20.0 * time)[:, None]
    slow = np.sin(2 * np.pi * time)[:, None] * [1.0, 0.5, 0.2]
    readings = SimpleNamespace(
        run=np.arange(400) // 200, keep=np.ones((400, 4, 6), bool), sd=np.full((4, 2), 1e-3)
    )
    there, not_there = (gain_error(readings, slow + part, 9, 4) for part in (fast, 0.0))
    assert abs(not_there) < 1e-3 and there < -0.05
    assert gain_error(readings, (slow + fast)[::-1], 9, 4) == pytest.approx(there, rel=0.1)


def test_a_slope_of_fast_motion_is_of_a_shorter_window():
    """At 400 Hz omega_dot of 25 Hz is known to a fifth by no longer window than half."""
    recording, _ = imuarray.simulate(
        sub_array(imuarray.mimu4444(), 4), 4.0, 400.0, seed=2, bandwidth=25.0
    )
    readings = arrange(recording)
    state = start(readings, columns_of(readings.array, (), np.inf))
    found = turned(readings, state).turning
    whole = _slope_prior(readings, state.motion[:, :3], readings.window)[1]
    assert np.median(found.sd) < 0.2 * np.std(found.mean) < np.median(whole)


def test_tails_that_come_and_go_are_held():
    """Late in a search, the largest degrees of freedom among those that recur; else the last."""
    first = [np.array([4.0, 4.0])] * SETTINGS.tails_late
    restless = [np.array([nu, 50.0]) for nu in (3.0, 20.0, 3.0, 20.0, 3.0)]
    assert list(steady(first[:5] + restless[:3])) == [3.0, 50.0]
    assert list(steady(first + restless)) == [20.0, 50.0]
    assert list(steady(first + restless[:1] * 5)) == [3.0, 50.0]
    assert list(steady([*first, *[np.array([10.0, np.inf])] * 5])) == [10.0, np.inf]


def test_estimates_of_one_truth_differ_by_chi_square():
    """200 means of three with a prior of which two agree with it, one only as far as data say."""
    rng, told = np.random.default_rng(8), np.array([4.0, 0.5, 1e-6])
    wide, far = np.diag([4.0, 1.0, 9.0]), []
    narrow = np.linalg.inv(np.linalg.inv(wide) + np.diag(told))
    for truth in rng.multivariate_normal(np.zeros(3), wide, 200):
        seen = truth + rng.standard_normal(3) / np.sqrt(told)
        far.append(hausman(narrow @ (told * seen), wide, narrow))
    assert {freedom for _, freedom in far} == {2}
    assert kstest([statistic for statistic, _ in far], "chi2", (2,)).pvalue > 1e-3
