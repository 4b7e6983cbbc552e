"""Diagnoses of one board's recordings: do positions and the causes' numbers repeat?"""

from itertools import combinations

import numpy as np
import pytest

from imuarray_papers.figures.board import (
    MODELS,
    parameters_agreement,
    positions_agreement,
    recordings_table,
)


def document(rng, scale):
    """A diagnosis of 11 triads, sds around 1 mm; seed 3 throughout."""
    sds = 1e-3 * rng.uniform(0.5, 2.0, (11, 3))
    section = {
        "positions_m": (sds * rng.standard_normal((11, 3))).tolist(),
        "positions_sd_m": sds.tolist(),
    }
    parameter = {"value": scale, "sd": 1e-4, "unit": "1"}
    cause = {"effect": "gyroscope_scale", "parameters": {"x_1": parameter, "y_1": parameter}}
    return {model: section for model in MODELS} | {"causes": [cause]}


@pytest.fixture
def documents():
    rng = np.random.default_rng(3)
    return {name: document(rng, 1e-2 * (1 + number)) for number, name in enumerate("bca")}


def test_positions_agree_as_all_pairs_do(documents):
    """Against the differences written out."""
    places, sds = (
        np.array([d["base"][key][1:] for d in documents.values()])
        for key in ("positions_m", "positions_sd_m")
    )
    pairs = list(combinations(range(3), 2))
    apart = np.array([places[i] - places[j] for i, j in pairs])
    claimed = np.array([np.hypot(sds[i], sds[j]) for i, j in pairs])
    found = positions_agreement(documents).set_index("model")
    assert list(found.index) == list(MODELS)
    row = found.loc["base"]
    assert (row.recordings, row.differences) == (3, apart.size)
    assert row.apart_rms_m == pytest.approx(np.sqrt(np.mean(apart**2)))
    assert row.apart_median_m == pytest.approx(np.median(np.abs(apart)))
    assert row.claimed_rms_m == pytest.approx(np.sqrt(np.mean(claimed**2)))
    assert row.z_rms == pytest.approx(np.sqrt(np.mean((apart / claimed) ** 2)))
    assert row.coverage_95 == np.mean(np.abs(apart) < 1.959964 * claimed)


def test_a_cause_s_numbers_repeat_by_their_spread(documents):
    row = parameters_agreement(documents).iloc[0]
    assert (row.effect, row.recordings, row.parameters) == ("gyroscope_scale", 3, 2)
    assert row["size"] == pytest.approx(0.02)
    assert row.spread == pytest.approx(0.01 * np.sqrt(2 / 3))


def test_a_row_says_what_a_recording_s_causes_leave(documents):
    for number, given in enumerate(documents.values()):
        held = {"value": 1.0, "sd": None, "unit": "1"}
        given["causes"].append({"effect": "sensor_clock", "parameters": {"phase_1": held}})
        for model, size in (("base", 1.0), ("extended", 0.1)):
            residual = {"specific_force": size, "angular_rate": size * (number + 1)}
            given[model] = given[model] | {"residual_sd": residual}
        gain = {"over_inflated_noise_nats_per_sample": 5.0 + number}
        gain["over_inflated_noise_nats_per_sample_se"] = 0.5
        given |= {"samples": 100, "gain": gain, "unexplained": number == 0}
    table = recordings_table(documents)
    assert table.recording.tolist() == list(documents)
    assert table.gain.tolist() == [5.0, 6.0, 7.0] and table.rate_after.iloc[2] == pytest.approx(0.3)
    assert set(table.causes) == {"gyroscope_scale sensor_clock"}
    assert set(table.parameters_with_sd) == {2} and table.unexplained.tolist() == [
        True,
        False,
        False,
    ]
