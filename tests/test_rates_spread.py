"""p(omega | y_g) from the spread of the gyroscopes, where some are at their rail."""

from dataclasses import replace

import numpy as np
import pytest

import imuarray
from imuarray.errors import InputError
from tests.test_bound import model

PAPERS = {"model": "papers", "rates": "spread", "motion_prior": "flat"}


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
    found = imuarray.sample(recording, method="pmmh", steps=20, say=said.append, **PAPERS)
    assert any(f"left out {lost.sum()} of {lost.size}" in line for line in said)
    assert np.all(np.isfinite(found["posterior"]["position"]))


def test_without_any_other_sample_it_is_said():
    with pytest.raises(InputError, match="off their rail, found none"):
        imuarray.sample(railed(0.01), steps=20, **PAPERS)


def test_the_proper_motion_prior_is_refused():
    with pytest.raises(InputError, match="expected --motion-prior flat with it"):
        imuarray.sample(railed(15.0), "papers", rates="spread")
