"""Injected effects must be found: recordings of the independent injector."""

import json
from dataclasses import replace
from functools import cache
from types import SimpleNamespace
from unittest.mock import patch

import numpy as np
import pytest
from scipy.linalg import block_diag

from imuarray.analysis.calibration import calibrate
from imuarray.cli import main
from imuarray.diagnosis import procedure
from imuarray.diagnosis import state as elimination
from imuarray.diagnosis.document import diagnose
from imuarray.diagnosis.final_checks import beside_left
from imuarray.diagnosis.fit import log_scores
from imuarray.diagnosis.noise_effects import verdict
from imuarray.diagnosis.procedure import run_procedure
from imuarray.diagnosis.reading_effects import find_reading_faults
from imuarray.diagnosis.residual_checks import all_checks, dependence, left_by_motion
from imuarray.diagnosis.scans import Courses, maybe_grown
from imuarray.diagnosis.scores import Candidate, Score
from imuarray.diagnosis.settings import SETTINGS
from imuarray.diagnosis.state import Cause, Search, eliminate, need
from imuarray.engine.heldout import gain
from imuarray.engine.parameters import catalogue_effects, columns_of
from imuarray.engine.readings import ResidualMaps, arrange
from imuarray.model import EFFECTS
from imuarray.model.effects import KINDS, effect, known_effect
from imuarray.recording import load_dataset, read_recording, write_recording
from imuarray.streams import stream
from imuarray.tails import log_chi_square
from imuarray_papers.blind.cases import Case, make
from imuarray_papers.blind.measured import hide
from tests.engine.test_filters import filtered

pytestmark = pytest.mark.slow

SEED = 41
DURATION = 5.0  # s
REPLICATES = 9


def injected(*effects, kind="one", realistic=False, **setting):
    """A case of effects (id, IMUs), its total size drawn between 14 and 30 sigma."""
    label = "test-" + "-".join(name for name, _ in effects)
    # whatever the other tests draw
    size = None if realistic else float(stream(SEED, label, kind).uniform(14, 30))
    return Case(label, effects, size, kind=kind, **{"duration": DURATION} | setting)


@cache
def found_in(case, seed=SEED):
    """(diagnosis.json as a dict, the truth), the diagnosis made without looking at the truth."""
    recording, truth = make(case, seed)
    return diagnose(recording, seed, tuple(truth["struck"]), replicates=REPLICATES).document, truth


def named(document):
    return {cause["effect"] for cause in document["causes"]}


ALL = tuple(range(8))
ONE = [
    injected(("gyroscope_scale", (2,))),
    injected(("gyroscope_g_sensitivity", (5,))),
    injected(("accelerometer_bias", (4,))),
    injected(("accelerometer_nonlinearity", ALL)),
    injected(("size_effect", ALL)),
    injected(("bias_drift", (6,))),
    injected(("position_shift", (3,))),
    injected(("warm_up", ALL), realistic=True),
    injected(("gyroscope_noise", (1,))),
    injected(("coloured_noise", (7,))),
    injected(("sensor_clock", (2,)), realistic=True),
    injected(("heavy_tails", (0,)), realistic=True),
    injected(("shock", ALL), realistic=True, duration=4.0),
    injected(("stale_samples", (3,)), realistic=True),
    injected(("axis_swap", (5,)), realistic=True),
    injected(("gyroscope_misalignment", (2,)), rails=True),
]


@pytest.mark.parametrize("case", ONE, ids=lambda case: case.effects[0][0])
def test_one_effect_is_named_with_its_sensors(case):
    document, truth = found_in(case)
    name, imus = case.effects[0]
    assert named(document) == {name}
    assert not document["unexplained"], document["remaining"]
    labels = [str(k + 1) for k in imus]
    assert document["causes"][0]["sensors"] == (["all"] if len(imus) == 8 else labels)
    assert document["causes"][0]["heldout_gain_nats"] > 0
    gain = document["gain"]["heldout_log_score_nats_per_sample"]
    # outliers are in no model's score: what the tails gain on them stands with the cause alone
    assert abs(gain) < 0.1 if name in ("heavy_tails", "shock") else gain > 0
    assert truth["effects"][0]["effect"] == name


@pytest.mark.parametrize(("corners", "imus"), [([98, 40, 98, 98], (1,)), ([20] * 4, (0, 1, 2, 3))])
def test_low_passes_of_gyroscopes_are_a_lag_and_what_they_do_more(corners, imus):
    found = run_procedure(filtered(corners, [98] * 4)[0])
    named = {cause.effect: cause.imus for cause in found.search.causes}
    assert named["gyroscope_delay"] == named["gyroscope_filter"] == imus
    assert named.keys() <= {"gyroscope_delay", "gyroscope_filter", "accelerometer_band"}
    assert not found.unexplained


@pytest.mark.parametrize("case", ONE[:3], ids=lambda case: case.effects[0][0])
def test_parameters_are_within_the_widths_they_claim(case):
    document, truth = found_in(case)
    value = np.array(truth["effects"][0]["parameters"][parameter_of(truth)]["value"]).ravel()
    items = list(document["causes"][0]["parameters"].values())
    z = [(item["value"] - v) / item["sd"] for item, v in zip(items, value, strict=True)]
    assert np.max(np.abs(z)) < 4.5


def parameter_of(truth):
    """The first parameter whose size is that of the effect's."""
    names = truth["effects"][0]["parameters"]
    return max(names, key=lambda name: np.size(names[name]["value"]))


@pytest.mark.parametrize("name", ["gyroscope_curve", "accelerometer_rate_square"])
def test_what_only_smooth_motion_tells_is_named(name):
    """0.3 % more at 1000 deg/s, as the rate's size; 0.3 m/s^2 along z at 1000 deg/s."""
    recording, _ = make(Case("test-smooth", duration=DURATION), SEED)
    force, rate = recording.specific_force.copy(), recording.angular_rate.copy()
    speed = np.linalg.norm(np.median(rate, axis=1), axis=1)
    if name == "gyroscope_curve":
        rate[:, 3] *= 1 + 0.003 * np.abs(rate[:, 3]) / np.radians(1000)
    else:
        force[:, 3, 2] += 0.3 * (speed / np.radians(1000)) ** 2
    changed = replace(recording, specific_force=force, angular_rate=rate)
    document = diagnose(changed, SEED, replicates=REPLICATES).document
    assert named(document) == {name} and document["causes"][0]["sensors"] == ["4"]


@pytest.mark.parametrize("seed", [1, 2])
def test_a_clean_recording_has_no_cause(seed):
    document, _ = found_in(Case("test-clean", duration=DURATION, rails=seed == 2), seed)
    assert document["causes"] == []
    assert not document["unexplained"]
    assert document["gain"]["heldout_log_score_nats_per_sample"] == pytest.approx(0, abs=0.05)


def test_what_would_have_been_named_is():
    """Power is 80 % by `detectable`: a quarter of the size is missed, four times it is found."""
    recording, _ = make(Case("test-clean", duration=DURATION), 1)
    known = {
        "causes": [],
        "detectable": found_in(Case("test-clean", duration=DURATION), 1)[0]["detectable"],
    }
    for times in (0.25, 4.0):
        for name in ("accelerometer_bias", "gyroscope_misalignment"):
            changed, truth = hide(recording, known, SEED, times, (name,))
            causes = run_procedure(changed).search.causes
            imu = int(truth["effects"][0]["sensors"][0]) - 1
            right = [(cause.effect, cause.imus) for cause in causes] == [(name, (imu,))]
            assert right if times > 1 else not causes


def test_readings_that_cannot_be_put_right_have_sizes_too(monkeypatch):
    """Nothing is adopted then, and the page shows how small an effect would have shown."""
    whole = procedure.prepared
    monkeypatch.setattr(procedure, "prepared", lambda *given: (*whole(*given)[:3], False))
    recording, _ = make(Case("test-clean", duration=2.0), SEED)
    found = run_procedure(recording)
    assert found.unexplained and not found.search.causes and found.search.detectable


def test_another_form_of_a_cause_is_not_what_was_there():
    """Both kinds of one IMU drift: the second form is no other IMU's."""
    recording, _ = make(Case("test-drift", duration=DURATION), SEED)
    past = np.linspace(0, 1, len(recording.time))[:, None] * [1.0, -1.0, 0.5]
    force, rate = recording.specific_force.copy(), recording.angular_rate.copy()
    force[:, 2] += 0.3 * past
    rate[:, 2] += 0.02 * past
    drifting = replace(recording, specific_force=force, angular_rate=rate)
    [cause] = run_procedure(drifting).search.causes
    assert (cause.effect, cause.imus) == ("bias_drift", (2,))
    assert {form.split()[0] for form in cause.variants} == {"accelerometer", "gyroscope"}


def test_gyroscopes_offsets_that_walk_drift_by_what_they_walk():
    """No polynomial is a random walk; that is the same cause, and leaves nothing unexplained."""
    recording, _ = make(Case("test-walk", duration=DURATION), SEED)
    steps = np.random.default_rng(SEED).standard_normal(recording.angular_rate.shape)
    walk = 4e-4 * np.sqrt(1 / len(steps)) * np.cumsum(steps, axis=0)
    found = run_procedure(replace(recording, angular_rate=recording.angular_rate + walk))
    assert [cause.effect for cause in found.search.causes] == ["bias_drift"]
    assert not found.unexplained and not found.in_noise
    search = found.search
    own = search.columns.flat(search.fit.state)[:, search.columns.of("bias_drift")]
    own = own.reshape(8, 2, 3, 4)[:, 1]
    drift = np.polynomial.legendre.legval(np.linspace(-1, 1, len(walk)), own.transpose(2, 0, 1))
    apart = walk - walk.mean(axis=1, keepdims=True)
    left = apart - np.moveaxis(drift - drift.mean(axis=0), -1, 0)
    assert np.std(left) < 0.5 * np.std(apart)
    assert np.std(drift.mean(axis=0)) < np.std(walk.mean(axis=1)) + np.std(apart)


def test_what_first_order_says_it_left_is_no_fault_of_the_model():
    recording, _ = make(Case("test-maps", duration=DURATION), SEED)
    off = 1e-3 * np.random.default_rng(SEED).standard_normal((8, 3, 3))
    rate = np.einsum("kij,tkj->tki", np.eye(3) + off, recording.angular_rate)
    readings = arrange(replace(recording, angular_rate=rate))
    columns = columns_of(readings.array, catalogue_effects(), readings.position_prior_sd)
    search = Search(readings, columns, (), str).fitted()
    left = ResidualMaps(np.diag(np.repeat([0.0, 1e-6], 72)), np.zeros((8, 6, 4, 4)))
    corrected = replace(readings, left=left)
    least = [
        min(c.log_p for c in all_checks(*beside_left(found), found.noise) if "residual" in c.name)
        for found in (search, replace(search, readings=corrected))
    ]
    assert least[0] < -20 and least[1] > SETTINGS.check


def test_what_first_order_left_is_no_cause():
    """Where it says how uncertain it is; where it does not, maps that are off are one."""
    recording, _ = make(Case("test-maps", duration=DURATION), SEED)
    off = 2e-4 * np.random.default_rng(SEED).standard_normal((8, 3, 3))
    rate = np.einsum("kij,tkj->tki", np.eye(3) + off, recording.angular_rate)
    read = replace(recording, angular_rate=rate)
    left = np.diag(np.repeat([0.0, 4e-8], 72))
    assert run_procedure(read).search.causes
    found = run_procedure(replace(read, map_covariance=left))
    assert not found.search.causes and not found.in_noise and not found.unexplained


def test_a_map_of_one_gyroscope_is_a_cause_beside_an_error_that_all_share():
    """What first order left is large, but all sensors': put back to zero, one has its share of it.

    The test of the adopted cause is that of its score before.
    """
    recording, _ = make(Case("test-maps", duration=DURATION), SEED)
    rng, ones = np.random.default_rng(SEED), np.ones((8, 8))
    maps = np.eye(3) + 3e-3 * rng.standard_normal((3, 3)) + 1e-4 * rng.standard_normal((8, 3, 3))
    maps[2] += 1.5e-3 * (np.ones((3, 3)) - np.eye(3))
    rate = np.einsum("kij,tkj->tki", maps, recording.angular_rate)
    left = block_diag(np.zeros((72, 72)), np.kron(9e-6 * ones + 1e-8 * np.eye(8), np.eye(9)))
    found = run_procedure(replace(recording, angular_rate=rate, map_covariance=left)).search
    [cause] = found.causes
    assert (cause.effect, cause.imus) == ("gyroscope_misalignment", (2,))
    statistic, freedom = need(found, cause.effect)
    assert freedom == 6
    assert log_chi_square(statistic, freedom) == pytest.approx(cause.log_p, rel=0.2)


def test_noise_that_taking_maps_out_has_scaled_is_no_cause():
    recording, _ = make(Case("test-pooled", duration=DURATION), SEED)
    declared = replace(recording, gyroscope_noise_sd=0.95 * recording.gyroscope_noise_sd)
    assert [item.effect for item in run_procedure(declared).in_noise] == ["gyroscope_noise"]
    corrected = replace(declared, map_covariance=np.diag(np.repeat([0.0, 1e-10], 72)))
    assert not run_procedure(corrected).in_noise


def test_a_lone_gyroscope_is_not_judged_by_what_the_motion_leaves_of_it(recwarn):
    recording, _ = make(Case("test-lone", duration=DURATION), SEED)
    lone = replace(
        recording, angular_rate=recording.angular_rate[:, :1],
        gyroscope_labels=recording.gyroscope_labels[:1],
    )  # fmt: skip
    document = diagnose(lone, replicates=REPLICATES).document
    assert not document["causes"] and not document["unexplained"]
    assert not any(issubclass(warning.category, RuntimeWarning) for warning in recwarn)


def searched(recording):
    """A search with the papers' model fitted."""
    readings = arrange(recording)
    columns = columns_of(readings.array, catalogue_effects(), readings.position_prior_sd)
    return Search(readings, columns, (), str).fitted()


def test_two_imus_residuals_vary_together_as_the_motion_leaves_them():
    rng = stream(8, "two IMUs")
    basis = np.linalg.qr(rng.standard_normal((12, 9)) + 0.3 * rng.standard_normal((60, 12, 9)))[0]
    white = rng.standard_normal((4000, 60, 12))
    left = white - np.einsum("tri,tsi,nts->ntr", basis, basis, white, optimize=True)
    products = np.einsum("ntr,nts->nrs", left, left)
    kept = SimpleNamespace(keep=np.ones((60, 2, 6), bool))
    fit = SimpleNamespace(readings=kept, residual=left[0].reshape(60, 2, 6), basis=basis)
    covariance, variance = left_by_motion(fit)
    np.testing.assert_allclose(covariance, products.mean(axis=0), atol=0.4)
    apart = ~np.eye(12, dtype=bool)
    ratio = products.var(axis=0)[apart] / variance[apart]
    np.testing.assert_allclose(ratio, 1.0, atol=0.2)
    assert dependence(fit) > 2.0  # twelve axes, of which the motion leaves three


def test_biases_put_back_gain_along_a_course_what_they_had_to_gain():
    bare = searched(make(injected(("warm_up", ALL)), SEED)[0])
    causes = (Cause(f"{kind}_bias", ALL, frozenset({""}), -9.0) for kind in KINDS)
    fitted = replace(bare, causes=tuple(causes)).refit()
    gains = []
    for search in (bare, fitted):
        courses = Courses(search.fit, search.given, ALL, back=True)
        gains.append([courses.gain(courses.course(pace, 0.0))[0] for pace in (-4.0, 0.0, 8.0)])
    np.testing.assert_allclose(*gains, rtol=0.03)


def test_a_faint_cause_needs_more_beside_another():
    """The many places it was looked for at count, too: beside others, not alone."""
    search = searched(make(injected(("gyroscope_bias", (2,))), SEED)[0])
    statistic, freedom = 120.0, 3
    tries = np.log(2 * 24 * 8)
    found = Score(Candidate("gyroscope_bias", (2,)), statistic, freedom, -40.0)
    assert found.tries == pytest.approx(-40.0 - log_chi_square(statistic, freedom))
    alone = replace(search, causes=(Cause("gyroscope_bias", (2,), frozenset({""}), -9.0, tries),))
    alone = alone.refit()
    known = log_chi_square(*need(alone, "gyroscope_bias"))
    for limit, others, there in (
        (known + 1.0, (), True), (known + 1.0, ("shock",), False),
        (known + 1.0 + 4.0 + tries, ("shock",), True),
    ):  # fmt: skip
        with patch.object(elimination, "SETTINGS", replace(SETTINGS, effect=limit, beside=4.0)):
            assert bool(eliminate(alone, others).causes) is there


@pytest.mark.parametrize(("course", "says"), [(0.0, False), (4.0, True)])
def test_a_bias_that_may_have_grown_from_nothing_is_said_to_be_maybe_a_drift(course, says):
    """Large and constant it cannot have."""
    recording, _ = make(Case("test-grown", duration=DURATION), SEED)
    time = (recording.time - recording.time[0]) / DURATION
    rate = recording.angular_rate.copy()
    size = 3e-3 * (1 - np.exp(-course * time)) if course else np.full(len(time), 3e-3)
    rate[:, 2] += size[:, None]
    search = searched(replace(recording, angular_rate=rate))
    cause = Cause("gyroscope_bias", (2,), frozenset({""}), -9.0)
    found = replace(search, causes=(cause,)).refit()
    assert maybe_grown(found, cause) is says


def test_the_others_of_those_far_off_are_not_at_zero_where_that_is_unlikely():
    sure, some = np.array([9.0, 0.3, 0.2, -0.4]), np.array([9.0, 2.0, -2.2, 2.1])
    assert list(verdict(sure, np.eye(4), SETTINGS.effect)[0]) == [0]
    assert list(verdict(some, np.eye(4), SETTINGS.effect)[0]) == [0, 1, 2, 3]
    assert list(verdict(some[1:], np.eye(3), SETTINGS.effect)[0]) == []


def test_a_clock_is_found_where_the_host_reads_unevenly():
    """What is a period off beside the clock's jumps passes for heavy tails, or is unexplained."""
    document, truth = found_in(injected(("sensor_clock", (2,)), realistic=True, duration=4), 44)
    assert truth["effects"][0]["parameters"]["host_latency"]["value"] > 0
    clock = next(cause for cause in document["causes"] if cause["effect"] == "sensor_clock")
    assert clock["sensors"] == ["3"]
    assert named(document) <= {"sensor_clock", "heavy_tails"} or document["unexplained"]


def test_axes_at_the_same_places_in_all_chips_are_found():
    document, truth = found_in(injected(("size_effect", ALL)), 42)
    assert truth["effects"][0]["parameters"]["alike"]["value"]
    assert named(document) == {"size_effect"} and not document["unexplained"]


def test_two_effects_at_once():
    case = injected(("gyroscope_bias", (1,)), ("accelerometer_scale", (6,)), kind="pair")
    document, _ = found_in(case)
    assert named(document) == {"gyroscope_bias", "accelerometer_scale"}
    assert not document["unexplained"]


def test_a_delay_is_named_with_what_cannot_be_distinguished_from_it():
    document, _ = found_in(injected(("sensor_delay", (4,))))
    cause = document["causes"][0]
    assert len(document["causes"]) == 1
    assert {"sensor_delay", "gyroscope_delay"} <= {
        cause["effect"],
        *cause["indistinguishable_from"],
    }


def test_a_gauge_is_no_confident_cause():
    document, _ = found_in(injected(("gauge_gyroscope_scale", ALL), kind="gauge"))
    assert document["unexplained"] or not any(
        not cause["indistinguishable_from"] for cause in document["causes"]
    )


def test_what_is_outside_the_catalogue_is_unexplained_until_it_is_added():
    """The documentation's example: one function, and the diagnosis names it."""
    case = Case("test-cubic", (("outside_cubic", ALL),), 40.0, kind="outside", duration=DURATION)
    document, _ = found_in(case)
    assert document["unexplained"] or not document["causes"]

    @effect("accelerometer_cubic", unit="s4 m-2", prior_sd=2e-6, shape=lambda a, g: (a, 3))
    def accelerometer_cubic(curvature, instant, predicted):
        """u_i + c_i u_i^3."""
        force = predicted.specific_force
        return predicted._replace(specific_force=force + curvature * force**3)

    try:
        found_in.cache_clear()
        document, _ = found_in(case)
        assert named(document) == {"accelerometer_cubic"}
        assert not document["unexplained"]
    finally:
        del EFFECTS["accelerometer_cubic"]


def test_an_effect_struck_from_the_catalogue_leaves_something_unexplained():
    case = injected(("gyroscope_g_sensitivity", ALL), kind="struck")
    document, truth = found_in(case)
    assert truth["struck"] == ["gyroscope_g_sensitivity"]
    assert "gyroscope_g_sensitivity" not in named(document)
    assert document["unexplained"] or not document["causes"]


def test_a_bias_is_found_without_those_that_it_is_told_from():
    recording, _ = make(injected(("accelerometer_bias", (4,))), SEED)
    without = ("warm_up", "gyroscope_bias")
    document = diagnose(recording, SEED, without, replicates=REPLICATES).document
    assert named(document) == {"accelerometer_bias"}


@pytest.mark.parametrize(
    ("effect", "size", "sign"),
    [
        ("outside_flexible_board", 30.0, "residual against lever times force"),
        ("outside_timing_jitter", 80.0, "ages that wander"),
        ("outside_quantisation", None, "resolution"),
    ],
)
def test_what_is_outside_the_catalogue_shows_as_itself(effect, size, sign):
    """Names may be given; the check made for such things says that they are not all."""
    case = Case("test-outside", ((effect, ALL),), size, kind="outside", duration=DURATION)
    document, _ = found_in(case)
    assert document["unexplained"] and sign in document["remaining"]


@pytest.mark.parametrize(
    ("effect", "sign"),
    [
        ("sensor_clock", "ages in time"),
        ("position_shift", "residual against lever times time"),
        ("heavy_tails", "outliers' mixture"),
        ("gyroscope_bias", "change of bias_drift"),
    ],
)
def test_a_confounded_cause_is_no_answer(effect, sign):
    """The effect struck from the catalogue: whatever is named instead, `unexplained` is true."""
    document, _ = found_in(injected((effect, (2,)), kind="struck", duration=8.0))
    assert document["unexplained"] and sign in document["remaining"]


def test_most_triads_decide_which_axes_are_right():
    from imuarray.engine.readings import arrange

    recording, _ = make(Case("test-axes", (("axis_swap", (0, 1, 2)),), None, kind="one",
                             duration=DURATION), SEED)  # fmt: skip
    causes, _, mended = find_reading_faults(arrange(recording))
    assert mended and causes[0].imus == (0, 1, 2)
    recording, _ = make(Case("test-axes", (("axis_swap", ALL),), None, kind="one",
                             duration=DURATION), SEED)  # fmt: skip
    causes, _, mended = find_reading_faults(arrange(recording))
    assert causes[0].effect == "axis_swap"
    assert not mended or len(causes[0].imus) < 8


@pytest.mark.parametrize(
    "effects",
    [
        (("axis_swap", (5,)),),
        (("stale_samples", (3,)),),
        (("axis_swap", (5,)), ("stale_samples", (3,))),
    ],
    ids=lambda effects: "+".join(name for name, _ in effects),
)
def test_readings_count_once(effects):
    """Those left out beside the extended fit's score, exchanged axes in the rivals' alone."""
    case = injected(
        *effects, kind="pair" if len(effects) > 1 else "one", realistic=True, duration=4
    )
    made = diagnose(make(case, SEED)[0], SEED, replicates=2)
    parts = {item.effect: item.blocks for item in made.found.reading_faults}
    assert set(parts) == {name for name, _ in effects}
    assert all(blocks.sum() > 1e5 for blocks in parts.values())
    made_fit = made.extended.fit
    alone = log_scores(made_fit)
    expected = parts.get("stale_samples", np.zeros(len(alone.nats)))
    found = made.extended.scores.nats - alone.nats
    np.testing.assert_allclose(found, expected, rtol=1e-9, atol=1e-9)
    if "stale_samples" not in parts:
        over = made.document["gain"]["over_inflated_noise_nats_per_sample"]
        assert over == gain(made.inflated.scores, alone)[0] and 0 < over < 1e3
    elif len(parts) > 1:
        # a swap in another IMU is no part of what repeats miss
        assert expected.sum() < 0.01 * parts["axis_swap"].sum()


# -- the command -----------------------------------------------------------------------------


@pytest.fixture(scope="module")
def diagnosed(tmp_path_factory):
    """A recording with a scaled gyroscope, diagnosed by the command."""
    folder = tmp_path_factory.mktemp("diagnose")
    recording, _ = make(ONE[0], SEED)
    write_recording(recording, folder / "rec.nc")
    status = main(["diagnose", str(folder / "rec.nc"), "--out", str(folder / "out"), "--quiet"])
    assert status == 0
    return folder


def test_the_command_writes_a_complete_folder(diagnosed):
    document = json.loads((diagnosed / "out" / "diagnosis.json").read_text())
    assert document["recording"].endswith("rec.nc")
    for section in ("base", "extended"):
        assert {
            "heldout_log_score_per_sample",
            "residual_sd",
            "positions_m",
            "positions_sd_m",
        } <= set(document[section])
    for item in document["discrepancies"]:
        assert {"check", "statistic", "simulated", "p_value", "sensors", "says"} <= set(item)
        assert set(item["simulated"]) == {"median", "q025", "q975"}
    for cause in document["causes"]:
        assert known_effect(cause["effect"]).meaning and cause["says"].endswith(".")
        assert all({"value", "sd", "unit"} == set(p) for p in cause["parameters"].values())
    assert (diagnosed / "out" / "report.html").stat().st_size > 10_000


def test_the_extended_model_is_a_calibration(diagnosed):
    document = json.loads((diagnosed / "out" / "diagnosis.json").read_text())
    found = load_dataset(diagnosed / "out" / "cal.nc")
    wanted = document["causes"][0]["parameters"]
    mine = [str(name).endswith("_3 1") for name in found.parameter.values]
    np.testing.assert_allclose(
        found.effect_parameter.values[mine], [p["value"] for p in wanted.values()],
        atol=0.2 * found.effect_sd.values.max(),
    )  # fmt: skip
    assert not found.effect_sd.values[~np.array(mine)].any()
    section, places = document["extended"], found.position.values
    np.testing.assert_allclose(places, section["positions_m"], rtol=0, atol=1e-12)
    sds = np.sqrt(np.einsum("kaka->ka", found.position_covariance.values))
    np.testing.assert_allclose(sds, section["positions_sd_m"], rtol=0, atol=1e-12)


def test_the_model_is_estimated_again_from_the_calibration(diagnosed):
    path = diagnosed / "out" / "cal.nc"
    found, again = load_dataset(path), calibrate(read_recording(diagnosed / "rec.nc"), path)
    sds = np.sqrt(np.einsum("kaka->ka", found.position_covariance.values))[1:]
    assert np.abs((again.position - found.position).values[1:] / sds).max() < 0.05
    assert np.array_equal(again.effect_sd.values > 0, found.effect_sd.values > 0)


def test_a_noise_beside_a_calibration_is_refused(diagnosed, capsys):
    """The calibration has the noise; two of them would leave one without a word."""
    out = diagnosed / "noisy.nc"
    status = main([
        "calibrate", str(diagnosed / "rec.nc"), "--accelerometer-noise", "0.1", "--out", str(out),
        "--model", str(diagnosed / "out" / "cal.nc"),
    ])  # fmt: skip
    captured = capsys.readouterr().err
    assert status == 2 and captured.count("\n") == 1 and not out.exists()
    assert captured.startswith("imuarray: --accelerometer-noise: expected it with --model papers")


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--without", "gremlin"], "--without: expected any of"),
        (["--seed", "-1"], "expected an integer of at least 0"),
    ],
)
def test_a_wrong_option_is_one_line(diagnosed, capsys, arguments, message):
    status = main(
        ["diagnose", str(diagnosed / "rec.nc"), "--out", str(diagnosed / "no"), *arguments]
    )
    captured = capsys.readouterr().err
    assert status == 2 and message in captured and captured.count("\n") == 1
    assert not (diagnosed / "no").exists()


def test_a_file_in_the_folder_s_place_is_refused(diagnosed, capsys):
    status = main(["diagnose", str(diagnosed / "rec.nc"), "--out", str(diagnosed / "rec.nc")])
    assert status == 2 and "expected a folder, found a file" in capsys.readouterr().err


def test_a_calibration_that_is_none_is_refused(diagnosed, capsys):
    status = main([
        "calibrate", str(diagnosed / "rec.nc"),
        "--model", str(diagnosed / "rec.nc"), "--out", str(diagnosed / "never.nc"),
    ])  # fmt: skip
    assert status == 2 and "rec.nc: expected a calibration" in capsys.readouterr().err
    assert not (diagnosed / "never.nc").exists()
