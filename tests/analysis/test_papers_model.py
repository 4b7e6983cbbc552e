"""`--model papers` by the engine, against the papers' own compiled search."""

from dataclasses import replace

import numpy as np
import pytest

import imuarray
from imuarray.analysis import noise
from imuarray.engine.parameters import model_of
from imuarray.errors import IdentifiabilityError, InputError
from imuarray.geometry import sub_array
from imuarray.motion.state import Motion
from imuarray.simulation.recordings import measure
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


def test_noise_is_allowed_for_the_positions():
    """Three samples of five triads: 45 + 45 readings, 27 + 12 unknowns."""
    ratios = [
        imuarray.calibrate(
            imuarray.simulate(sub_array(imuarray.mimu4444(), 5), 0.06, 50.0, seed=seed)[0], "papers"
        ).attrs["residual_ratio"]
        for seed in range(12)
    ]
    assert np.mean(np.square(ratios)) == pytest.approx(1.0, abs=0.12)


def about_one_axis(recording):
    axis = np.array([0.0, 0.6, 0.8])
    model = model_of(recording)
    turn = 8 * np.sin(3 * recording.time)[:, None] * axis
    slope = 24 * np.cos(3 * recording.time)[:, None] * axis
    motion = Motion.of(turn, slope, np.tile([0.0, 0.0, 9.8], (len(turn), 1)))
    force, rate, _ = measure(model, motion, model.array.relative, np.random.default_rng(1))
    return replace(recording, specific_force=force, angular_rate=rate)


def at_a_rail(recording):
    rate = recording.angular_rate.copy()
    rate[3, :, 1] = recording.gyroscope_range
    return replace(recording, angular_rate=rate)


@pytest.mark.parametrize("analysis", [imuarray.calibrate, imuarray.sample])
@pytest.mark.parametrize(
    ("change", "said"), [(about_one_axis, "more than one axis"), (at_a_rail, "one unsaturated")]
)
def test_what_determines_nothing_is_refused(analysis, change, said):
    recording, _ = imuarray.simulate(sub_array(imuarray.mimu4444(), 4), 1.0, 50.0, seed=1)
    if change is at_a_rail and analysis is imuarray.calibrate:
        found = analysis(change(recording), "papers")  # it leaves that sample out
        assert 0 < found.attrs["samples"] < 50
        return
    with pytest.raises(IdentifiabilityError, match=said):
        analysis(change(recording), "papers")


def test_two_triads_are_refused():
    recording, _ = imuarray.simulate(sub_array(imuarray.mimu4444(), 2), 1.0, 50.0, seed=1)
    with pytest.raises(IdentifiabilityError, match="at least 3 accelerometer triads"):
        imuarray.calibrate(recording, "papers")


def test_readings_far_from_the_model_are_bad_input(monkeypatch):
    def diverges(*_, **__):
        raise np.linalg.LinAlgError("singular")

    recording, _ = imuarray.simulate(sub_array(imuarray.mimu4444(), 4), 1.0, 50.0, seed=1)
    monkeypatch.setattr(noise, "estimate", diverges)
    with pytest.raises(InputError, match="a search that diverges"):
        imuarray.sample(recording, "papers")
