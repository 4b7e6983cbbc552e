"""A board from some recordings, and what it says of another one."""

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from scipy.stats import multivariate_t

from imuarray.analysis.beside import with_board
from imuarray.diagnosis.fit import at, log_scores
from imuarray.engine.course import block_scores
from imuarray.engine.dataset import engine_dataset
from imuarray.engine.heldout import log_densities
from imuarray.engine.linearise import linearise
from imuarray_papers.figures import style
from imuarray_papers.figures.board import table_experiment, table_left_out
from imuarray_papers.measured.left_out import located, predicted
from tests.engine.test_engine import fitted, simulated


def densities(plain, freedoms):
    (one,) = plain.recorded
    seen = linearise(one.readings, plain.columns, one.state, [])
    left = seen.residual, seen.misfit, seen.log_volume
    return log_densities(one.readings, one.state, *left, np.full(2, freedoms))


@pytest.fixture(scope="module")
def plain():
    return fitted(simulated(2.0)[0], noise="normal")


def test_scores_of_normal_noise_are_those_of_the_diagnosis(plain):
    (one,) = plain.recorded
    made = at(one.readings, plain.columns, plain.active, one.state, False)
    expected, found = log_scores(made), block_scores(plain)
    np.testing.assert_array_equal(found.samples, expected.samples)
    np.testing.assert_allclose(found.nats, expected.nats, atol=0.02)
    np.testing.assert_allclose(densities(plain, 1e7), densities(plain, np.inf), atol=1e-2)


def test_the_density_is_students(plain):
    """Of two freedoms at one residual: the difference is that of scipy's t."""
    (one,) = plain.recorded
    left = linearise(one.readings, plain.columns, one.state, []).residual[0]
    scores = [densities(plain, nu)[0] for nu in (3.0, 8.0)]
    by_scipy = [
        sum(multivariate_t(np.zeros(3), np.eye(3), nu).logpdf(r) for r in left.reshape(-1, 3))
        for nu in (3.0, 8.0)
    ]
    assert scores[1] - scores[0] == pytest.approx(by_scipy[1] - by_scipy[0], abs=1e-9)


def test_a_board_predicts_another_recording():
    """Its scales are known, the offset is the recording's: a fit of all has little to add."""
    effects = "gyroscope_scale", "accelerometer_bias"
    whole, parts = simulated(4.0, effects=effects[:1])[0], []
    for part, offset in ((slice(0, 200), 0.3), (slice(200, 400), -0.2)):
        one = whole.select(np.arange(400)[part])
        shifted = one.specific_force + offset * np.eye(4)[2][:, None] * np.eye(3)[0]
        parts.append(replace(one, specific_force=shifted))
    calibration = engine_dataset(parts[:1], fitted(parts[0], effects))
    readings, own = with_board(parts[1], calibration)
    np.testing.assert_array_equal(own.positions, calibration["position"])
    (state,), columns = (one.state for one in own.recorded), own.columns
    kept, known = (
        columns.model.split(values)["gyroscope_scale"]
        for values in (state.parameters, calibration["effect_parameter"].to_numpy())
    )
    np.testing.assert_array_equal(kept, known)
    bias = columns.flat(state)[2, columns.of("accelerometer_bias")[0]]
    alone = fitted(parts[1], effects).recorded[0].state
    assert bias == pytest.approx(columns.flat(alone)[2, 6], abs=5e-3) and bias < -0.05
    table = predicted(parts[1], calibration)
    by = table.set_index("model")
    assert by.over_inflated.board > 5 and abs(by.over_board.own) < 0.3
    assert (by.samples == len(readings.time)).all() and by.converged.all()
    rows, words = table_left_out([table], ["one"], "board")
    assert rows.board[0] == by.over_inflated.board and words == {"group": "board"}
    assert {column.name for column in style.columns("left_out")} == set(rows)


def test_positions_from_few_samples_are_those_of_a_fit_with_the_sensors_held():
    """Of all samples the same as `estimate` gives; of fewer, wider, and wider yet where the sensors
    are uncertain."""
    whole = simulated(4.0, effects=("gyroscope_scale",))[0]
    fit = fitted(whole, ("gyroscope_scale",))
    calibration = engine_dataset([whole], fit)
    found = located(whole, calibration, [20, 400])
    off = found.position.sel(samples=400) - calibration.position
    sd = np.sqrt(np.diagonal(calibration.position_covariance.to_numpy().reshape(12, 12)))[3:]
    assert np.max(np.abs(off.to_numpy().ravel()[3:]) / sd) < 0.05
    claimed = np.sqrt(np.diagonal(found.position_covariance.to_numpy().reshape(2, 12, 12), 0, 1, 2))
    # the fit's are a jackknife's where that is wider
    np.testing.assert_allclose(claimed[1, 3:], sd, rtol=0.1)
    assert (claimed[0, 3:] > claimed[1, 3:]).all()
    sure = calibration.assign(whole_covariance=0 * calibration.whole_covariance)
    certain = located(whole, sure, [400])
    narrow = np.sqrt(np.diag(certain.position_covariance.to_numpy().reshape(12, 12)))[3:]
    assert (narrow < sd).all()
    papers = pd.DataFrame({"samples": [20], "assumed": ["0.8"], "claimed_m": [1.0]})
    moved = found.assign(position=found.position + 1e-6)
    table, _ = table_experiment([found, moved], ["a", "b"], papers, "board")
    assert table.model.tolist() == ["papers', σa 0.8 m/s²", "sensors", "sensors"]
    np.testing.assert_allclose(table.spread_m[1:], 1e-6 / np.sqrt(2))
