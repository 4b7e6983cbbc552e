"""p(omega | y_g) from the spread of the gyroscopes, where some are at their rail."""

from dataclasses import replace

import numpy as np
import pytest

import imuarray
from imuarray.errors import InputError
from imuarray_papers.sampling import sample
from tests.cases import model


def railed(rail):
    """A recording clipped at ``rail`` rad/s."""
    recording, _ = imuarray.simulate(
        model().array, 1.0, 50.0, seed=4, angular_rate=10.0, position_error=1e-4
    )
    clipped = np.clip(recording.angular_rate, -rail, rail)
    return replace(recording, angular_rate=clipped, gyroscope_range=rail)


def test_samples_at_a_rail_are_left_out():
    """All readings of an axis at the rail have no spread at all."""
    recording, said = railed(15.0), []
    lost = recording.saturated_gyroscopes().any(axis=(1, 2))
    assert 0 < lost.sum() < lost.size
    found = sample(recording, steps=20, rates="spread", notify=said.append)
    assert any(f"left out {lost.sum()} of {lost.size}" in line for line in said)
    assert np.all(np.isfinite(found["posterior"]["position"]))


def test_without_any_other_sample_it_is_said():
    with pytest.raises(InputError, match="off their rail, found none"):
        sample(railed(0.01), steps=20, rates="spread")
