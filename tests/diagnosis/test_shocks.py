"""Shocks are told from a single IMU's outliers and from slow misfit."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from imuarray.diagnosis.procedure import unshaken
from imuarray.diagnosis.settings import SETTINGS
from imuarray.diagnosis.shocks import SHOCK, _several, find_shocks, misfits, with_neighbours
from imuarray.diagnosis.state import Search
from imuarray.engine.parameters import columns_of
from imuarray.engine.readings import arrange
from imuarray_papers.blind.cases import Case, make

ALL = tuple(range(8))


@cache
def searched(effect="", imus=ALL, size=None):
    case = Case(f"shocks-{effect}", ((effect, imus),) if effect else (), size, duration=3.0,
                kind="one" if effect else "clean")  # fmt: skip
    recording, truth = make(case, 3)
    readings = arrange(recording)
    columns = columns_of(readings.array, (), readings.position_prior_sd)
    return Search(readings, columns, (), lambda text: None).fitted(), truth


def fitted(*case):
    search, truth = searched(*case)
    return search.fit, truth


def test_misfit_is_that_of_the_motion_fitted_without_an_imu():
    made, _ = fitted()
    basis, found = made.basis[7], misfits(made)
    original = made.residual[7].ravel() + basis @ np.random.default_rng(1).standard_normal(
        basis.shape[1]
    )
    best = []
    for imu in ALL:
        rest = np.arange(48) // 6 != imu
        left = np.linalg.lstsq(basis[rest], original[rest], rcond=None)
        best.append(float(left[1][0]))
    size = np.sum(made.residual[7] ** 2) / found.whole[7]
    assert found.least[7] * size == pytest.approx(min(best), rel=1e-5)
    assert found.worst[7] == np.argmin(best)


def test_shocks_are_found_where_they_are():
    made, truth = fitted("shock")
    named, shaken = find_shocks(made, SETTINGS.limit(SHOCK))
    assert named.effect == SHOCK and named.imus == ALL
    begin = np.array(truth["effects"][0]["parameters"]["begin"]["value"])
    time = made.readings.time[shaken]
    since = (time[:, None] - begin)[np.arange(len(time)), np.searchsorted(begin, time) - 1]
    assert np.all((since > -0.01) & (since < 0.2))
    assert named.parameters["share"][0] == shaken.mean() and named.gain > 0
    assert all(any(a <= t <= b for a, b in named.also["stretches_s"]) for t in time)


def test_what_rings_beside_a_shock_is_left_out_with_it():
    search, _ = searched("shock")
    (named,), used = unshaken(search, ())
    _, shaken = find_shocks(search.fit, SETTINGS.limit(SHOCK))
    near = np.abs(np.arange(len(shaken))[:, None] - np.flatnonzero(shaken)).min(axis=1) <= 2
    assert named.effect == SHOCK and not used[near].any() and used[~near].mean() > 0.9
    none = np.zeros(6, bool)
    none[2] = True
    beside = with_neighbours(none, np.array([0, 0, 0, 1, 1, 1]), 2)
    assert beside.tolist() == [True, True, True, False, False, False]
    assert with_neighbours(none, np.zeros(6), 0).tolist() == none.tolist()


@pytest.mark.parametrize(
    ("effect", "imus", "size"),
    [
        ("", ALL, None),
        ("heavy_tails", (2,), None),
        ("heavy_tails", ALL, None),
        ("gyroscope_scale", ALL, 300.0),
    ],
)
def test_nothing_else_is_a_shock(effect, imus, size):
    made, _ = fitted(effect, imus, size)
    named, shaken = find_shocks(made, SETTINGS.limit(SHOCK))
    assert named is None and not shaken.any()


def test_imus_that_are_off_by_themselves_are_several_by_chance():
    """As many as are seen; where hardly a sample is calm nothing tells how many that is."""
    rng, size = np.random.default_rng(5), np.arange(20000.0)
    share = 0.1 * size / size.max() + 0.7 * (size >= 18000)
    off = rng.random((len(size), 8)) < share[:, None]
    several, alone, worst = off.sum(axis=1) > 1, off.sum(axis=1) == 1, np.argmax(off, axis=1)
    seen, chance = _several(several, alone, worst, size)
    assert seen == several[:18000].sum() and abs(seen - chance) < 4 * np.sqrt(seen)


def test_the_only_gyroscope_cannot_be_left_out():
    """Without its IMU nothing is left over: each sample would be a shock."""
    recording, _ = make(Case("shocks-one", duration=3.0), 3)
    few = replace(
        recording, specific_force=recording.specific_force[:, :4],
        angular_rate=recording.angular_rate[:, :1],
        accelerometer_position=recording.accelerometer_position[:4],
        accelerometer_labels=recording.accelerometer_labels[:4],
        gyroscope_labels=recording.gyroscope_labels[:1],
    )  # fmt: skip
    readings = arrange(few)
    columns = columns_of(readings.array, (), readings.position_prior_sd)
    search = Search(readings, columns, (), lambda text: None).fitted()
    assert find_shocks(search.fit, SETTINGS.limit(SHOCK))[0] is None
