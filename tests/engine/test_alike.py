"""Parameters that chips of one kind have nearly in common, in the chips' own axes."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from imuarray.diagnosis.fit import at
from imuarray.engine.alike import with_likely_spread
from imuarray.engine.parameters import POSITION, columns_of
from imuarray.engine.readings import arrange
from imuarray.engine.start import start, with_derivatives
from imuarray.geometry import Array
from imuarray.model import EFFECTS, ArrayModel
from imuarray.motion.state import Motion
from imuarray_papers.measured.causes import STEPS, repeated
from tests.engine.test_engine import simulated

POSITIONS = np.array([[0.0, 0, 0], [0.02, 0, 0], [0, 0.02, 0], [0.02, 0.02, -0.002]])
TURNED = np.array([[0.0, -1, 0], [-1, 0, 0], [0, 0, -1]])


def board(axes=None):
    return Array(POSITIONS, tuple("1234"), 4, axes=axes)


def columns_with_all(array):
    columns = columns_of(array, ("size_effect",), 1e-3)
    return columns, columns.owner & (np.array(columns.names) != POSITION)


def test_a_turned_chip_reads_what_it_reads_in_its_own_axes():
    rng = np.random.default_rng(1)
    turns = Rotation.random(4, random_state=2).as_matrix()
    arms = 1e-3 * rng.standard_normal((4, 3, 3))
    rate, turn, force = rng.standard_normal((3, 3)) * [[20], [900], [9]]
    model = ArrayModel.isotropic(board(turns), 0.01, 0.01, ("size_effect",))
    found = model.predict(
        Motion(rate, turn, force, np.zeros(3), np.zeros(3)), POSITIONS, arms.ravel()
    ).specific_force
    for k, own in enumerate(turns):
        # seen from the chip: the motion and the place in its axes, each axis at its own arm
        w, a, s, r = (own.T @ v for v in (rate, turn, force, POSITIONS[k]))
        read = [
            (s + np.cross(w, np.cross(w, r + arm)) + np.cross(a, r + arm))[axis]
            for axis, arm in enumerate(arms[k])
        ]
        np.testing.assert_allclose(found[k], own @ read, rtol=1e-12, atol=1e-12)


def test_the_prior_is_of_what_is_shared_and_of_what_is_own():
    columns, active = columns_with_all(board())
    precision = columns.prior_precision(active)
    pinned = np.zeros_like(precision)
    sds = columns.prior_sd[np.nonzero(active)[1]]
    for _, mask in columns.gauges(active):
        along = mask[active] / np.abs(mask[active]).sum() / (1e-3 * sds[mask[active] != 0].mean())
        pinned += np.outer(along, along)
    column = np.nonzero(active)[1]
    expected = np.diag(sds**2) + 5e-4**2 * (column[:, None] == column)
    np.testing.assert_allclose(np.linalg.inv(precision - pinned), expected, atol=1e-15)


@pytest.mark.parametrize("turned", [False, True])
def test_arms_common_along_the_arrays_axes_are_the_gauge(turned):
    array = board(np.array([np.eye(3), TURNED, np.eye(3), TURNED]) if turned else None)
    columns, active = columns_with_all(array)
    arms = np.random.default_rng(1).standard_normal((3, 3))  # of the array's axes
    own = np.array(
        [[t.T @ arms[np.argmax(np.abs(t[:, i]))] for i in range(3)] for t in array.turns]
    )
    values = own.reshape(4, 9)
    weights = [mask[:, columns.of("size_effect")] for _, mask in columns.gauges(active)]
    common = [np.sum(values * w) / np.abs(w).sum() for w in weights[:9]]
    np.testing.assert_allclose(common, arms.ravel(), atol=1e-12)
    # what a chip's arms have in common is a gauge only where all are mounted alike
    alike = np.tile(arms.ravel(), (4, 1))
    pinned = [np.sum(alike * w) / np.abs(w).sum() for w in weights[:9]]
    assert (np.linalg.norm(pinned) < np.linalg.norm(arms) - 0.1) == turned


def test_the_differences_size_is_found():
    rng = np.random.default_rng(3)
    array = Array(rng.standard_normal((16, 3)), tuple("abcdefghijklmnop"), 16)
    columns, active = columns_with_all(array)
    own = 2e-5 * rng.standard_normal((16, 3, 3))
    own -= own.mean(axis=1, keepdims=True)  # a triad's mean place is its position
    own -= own.mean(axis=0)
    values = own.ravel()
    place, told = np.arange(len(values)), np.eye(len(values)) / 2e-6**2
    for _ in range(30):
        whole = told + columns.prior_precision(active)
        columns = with_likely_spread(
            columns, active, np.linalg.solve(whole, told @ values), whole, place
        )
    assert columns.prior_sd[columns.of("size_effect")[0]] == pytest.approx(2e-5, rel=0.15)


def test_the_common_part_of_drifts_is_no_larger_than_their_differences_say():
    """The motion takes up what all gyroscopes have in common: data alone say nothing of it."""
    rng = np.random.default_rng(5)
    columns = columns_of(board(), ("bias_drift",), 1e-3)
    kind = np.array([place[0] for place in columns.places])
    active = columns.owner & (np.array(columns.names) == "bias_drift") & (kind == 1)
    drift = 1e-4 * rng.standard_normal(active.sum())
    differing = np.eye(4) - 0.25
    told = np.kron(differing, np.eye(12)) / 1e-5**2
    place = np.arange(len(drift))
    for _ in range(30):
        whole = told + columns.prior_precision(active)
        found = np.linalg.solve(whole, told @ drift)
        columns = with_likely_spread(columns, active, found, whole, place)
    own = columns.of("bias_drift")
    assert columns.prior_sd[own[kind[own] == 1]] == pytest.approx(1e-4, rel=0.3)
    # tests go by what such sensors have, whatever these are found to have
    assert np.all(columns.usual_sd[own[kind[own] == 1]] == 0.005)
    # those of the other kind were not looked at
    assert np.all(columns.prior_sd[own[kind[own] == 0]] == 0.1)
    # a model that is far off: no larger than such sensors can have
    for _ in range(30):
        whole = told + columns.prior_precision(active)
        columns = with_likely_spread(columns, active, 1e5 * drift, whole, place)
    assert columns.prior_sd[own[kind[own] == 1]] == pytest.approx(30 * 0.005)


def test_repeatability_is_that_of_pairs():
    import pandas as pd

    rng, tables = np.random.default_rng(4), {}
    truth = rng.standard_normal(6) * 0.02
    for number in range(8):
        found = truth * (1 + 1e-3 * rng.standard_normal()) + 1e-6 * rng.standard_normal(6)
        parts = [
            pd.DataFrame({
                "step": step, "accelerometer": np.repeat(["2", "3"], 3), "axis": list("xyz") * 2,
                "mean_m": found,
                "sd_m": 1e-6, "residual_ratio": 2.0, "smooth_ratio": 1.0,
                "nats": 1.0, "nats_error": 0.1, "converged": True, "common_scale_sd": 5e-4,
            })
            for step in STEPS
        ]  # fmt: skip
        tables[f"exp_{number}"] = pd.concat(parts)
    found = repeated(tables).iloc[0]
    assert found.common_size_m == pytest.approx(1e-3 * np.sqrt(np.mean(truth**2)), rel=2e-3)
    assert found.size_sd == pytest.approx(1e-3, rel=0.5)
    # brought to one size, a direction less is left
    assert found.same_size_rms_m == pytest.approx(np.sqrt(2 * 5 / 6) * 1e-6, rel=0.3)
    assert found.rms_m > 5 * found.same_size_rms_m and found.covered < 0.5


@pytest.fixture(scope="module")
def readings():
    return arrange(simulated()[0])


# the mean filter of the accelerometers is the gyroscopes', by convention: `gyroscope_filter`
@pytest.mark.parametrize(
    "name", [n for n, one in EFFECTS.items() if one.gauge and n != "accelerometer_filter"]
)
def test_no_reading_shows_a_gauge(readings, name):
    """Motion and positions take it up whole; as large values without its pattern show."""
    columns = columns_of(readings.array, (name,), readings.position_prior_sd)
    state = with_derivatives(readings, start(readings, columns), True)
    active = columns.mask([POSITION, name])
    inner, _ = at(readings, columns, active, state).normal(active)
    place = np.isin(np.nonzero(active)[1], columns.of(POSITION))
    cross = inner[np.ix_(place, ~place)]
    left = inner[np.ix_(~place, ~place)]
    left = left - cross.T @ np.linalg.solve(inner[np.ix_(place, place)], cross)
    signs = np.random.default_rng(1)
    for _, mask in columns.gauges(active):
        along = mask[active][~place]
        other = along * signs.standard_normal(along.size)
        assert abs(along @ left @ along) < 1e-10 * (other @ left @ other)
