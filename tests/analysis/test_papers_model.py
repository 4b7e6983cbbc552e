"""`--model papers` by the engine, against the papers' own compiled search."""

import numpy as np
import pytest

import imuarray
from imuarray.engine.parameters import model_of
from imuarray.errors import IdentifiabilityError
from imuarray.geometry import sub_array
from imuarray_papers.estimation.newton import calibrate_gauss_newton


def test_it_ends_where_the_compiled_search_does():
    array = sub_array(imuarray.mimu4444(), 5)
    recording, _ = imuarray.simulate(array, 2.0, 50.0, seed=4, angular_rate=15.0)
    other = calibrate_gauss_newton(
        model_of(recording), recording.specific_force, recording.angular_rate
    )
    found, sds = imuarray.calibrate(recording, "papers"), np.sqrt(np.diag(other.covariance))
    off = (found["position"].to_numpy() - other.positions)[1:].ravel()
    assert np.abs(off / sds).max() < 1e-3
    np.testing.assert_allclose(found["position_sd_formal"].to_numpy()[1:].ravel(), sds, rtol=1e-4)
    assert found.attrs["residual_ratio"] == pytest.approx(1.0, abs=0.1)


def test_two_triads_are_refused():
    recording, _ = imuarray.simulate(sub_array(imuarray.mimu4444(), 2), 1.0, 50.0, seed=1)
    with pytest.raises(IdentifiabilityError, match="at least 3 accelerometer triads"):
        imuarray.calibrate(recording, "papers")
