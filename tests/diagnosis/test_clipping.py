"""A rail that clips a single reading; one reading that nothing explains."""

from dataclasses import replace

import numpy as np
import pytest

from imuarray.diagnosis.final_checks import Peak, clipped, together
from imuarray.diagnosis.procedure import run_procedure
from imuarray.diagnosis.reading_effects import Finding
from imuarray_papers.blind.cases import Case, make

LIMIT = -7.5


def peak(imu, kind=0, inward=0.0, others=4.0, apart=0.0, ties=1):
    return Peak(imu, kind, np.arange(9).reshape(3, 3) < ties, 30.0, inward, others, apart)


def quiet(rng):
    """Both kinds of eight IMUs, as noise alone makes them."""
    return [peak(k, kind, *rng.standard_normal(1), 4.0, *rng.standard_normal(1))
            for kind in (0, 1) for k in range(8)]  # fmt: skip


def test_one_that_falls_short_far_more_than_any_other_reading():
    found = quiet(np.random.default_rng(1))
    found[3] = peak(3, 0, 9.0, 4.0, 9.0)
    hit, log_p = clipped(found, LIMIT)
    assert [p.imu for p in hit] == [3] and log_p < -30


def test_two_at_one_value_need_not_stand_out_as_far():
    found = quiet(np.random.default_rng(1))
    for ties, hits in (1, []), (2, [3]):
        found[3] = peak(3, 0, 5.0, 4.0, 5.0, ties)
        assert [p.imu for p in clipped(found, LIMIT)[0]] == hits


@pytest.mark.parametrize(
    "one", [peak(3, 0, 9.0, 8.0, 1.0), peak(3, 0, -9.0, 4.0, -9.0), peak(3, 0, 3.5, 2.0, 3.5)],
    ids=["others are as far off", "longer than it should be", "not far enough"],
)  # fmt: skip
def test_none(one):
    found = quiet(np.random.default_rng(1))
    found[3] = one
    assert clipped(found, LIMIT) == ([], 0.0)


def test_all_of_a_kind_together():
    found = [peak(k, 0, 3.0, 4.0, 3.0) for k in range(8)] + [peak(k, 1) for k in range(8)]
    hit, log_p = clipped(found, LIMIT)
    assert {(p.imu, p.kind) for p in hit} == {(k, 0) for k in range(8)}
    assert log_p < -30


def test_false_alarms_in_noise():
    """2000 boards: the expected number is 2000 exp(-7.5) times three tests, 3; 10 is rare."""
    rng = np.random.default_rng(2)
    assert sum(bool(clipped(quiet(rng), LIMIT)[0]) for _ in range(2000)) <= 10


def test_findings_of_both_kinds_are_one_cause():
    old = Finding("saturation", (1, 4), -20.0, {}, says="piles")
    new = Finding("saturation", (2,), -30.0, {}, says="alone")
    other = Finding("stale_samples", (0,), -40.0, {}, says="repeats")
    merged = together([old, other], new)
    assert merged == [old._replace(imus=(1, 2, 4), log_p=-30.0), other]


@pytest.fixture(scope="module")
def recording():
    return make(Case("lone", duration=8.0), 3)[0]


@pytest.mark.slow
def test_a_clipped_reading_is_named(recording):
    rate = recording.angular_rate.copy()
    size = np.abs(rate[:, 2])
    place = np.unravel_index(np.argmax(size), size.shape)
    rate[place[0], 2, place[1]] *= 1 - 12 * recording.gyroscope_noise_sd / size[place]
    changed = replace(recording, angular_rate=rate)
    found = run_procedure(changed)
    assert [(c.effect, c.imus) for c in found.reading_faults] == [("saturation", (2,))]
    assert not found.unexplained and not found.search.causes
    struck = run_procedure(changed, without=("saturation", "heavy_tails"))
    assert struck.unexplained and not struck.reading_faults


@pytest.mark.slow
def test_a_reading_far_off_anywhere_else_is_not_passed_over(recording):
    rate = recording.angular_rate.copy()
    rate[400, 5, 1] += 12 * recording.gyroscope_noise_sd
    found = run_procedure(replace(recording, angular_rate=rate))
    assert found.unexplained or [c.effect for c in found.in_noise] == ["heavy_tails"]
    assert not found.reading_faults
