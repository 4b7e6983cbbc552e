"""`imuarray.sample` under the models that `imuarray.calibrate` has."""

from dataclasses import replace

import numpy as np
import pytest

import imuarray
from imuarray.analysis.density import posterior_beyond
from imuarray.analysis.sensors import fitted
from imuarray.engine.widths import widths
from imuarray.errors import InputError
from imuarray.geometry import sub_array


def simulated(samples, effects=()):
    array = sub_array(imuarray.mimu4444(), 4)
    recording, truth = imuarray.simulate(
        array, 20.0, 100.0, seed=3, angular_rate=15.0, effects=effects
    )
    return imuarray.select(recording, samples), truth


def test_too_few_samples_for_any_part_are_the_papers_model():
    recording, _ = simulated(5)
    chains = [
        imuarray.sample(recording, model, "nuts", steps=20) for model in ("sensors", "papers")
    ]
    one, other = (tree["posterior"]["position"].to_numpy() for tree in chains)
    np.testing.assert_array_equal(one, other)
    assert "effect_parameter" not in chains[0]["posterior"]


def test_a_clock_of_which_little_is_known_leaves_the_arrays_size_unknown():
    """Every coordinate of a draw larger by one factor, of twice the clock's relative sd."""
    recording, _ = simulated(5)
    sure, unsure = (
        imuarray.sample(replace(recording, clock_sd=sd), method="nuts", steps=60)
        for sd in (0.0, 0.02)
    )
    one, other = (tree["posterior"]["position"].to_numpy() for tree in (sure, unsure))
    factor = other / one
    np.testing.assert_allclose(factor, np.broadcast_to(factor[..., :1, :1], one.shape))
    assert np.log(factor[..., 0, 0]).std() == pytest.approx(0.04, rel=0.3)


def test_skewed_gyroscopes_are_found_and_sampled():
    """The density stands where the engine's estimate does, as wide as that says; draws follow it.

    The mode is within 4.5 sds of the truth (seed 3, nine coordinates).
    """
    recording, truth = simulated(40, ["gyroscope_misalignment"])
    said = []
    found, _ = fitted([recording], "sensors", (), said.append, plain=False)
    assert any(line.startswith("gyroscope maps: kept") for line in said)
    posterior = posterior_beyond(recording, found)
    off = posterior.mode[:9] - (truth["position"].to_numpy()[1:]).ravel()
    sd = np.sqrt(np.diag(posterior.covariance))
    assert np.abs(off / sd[:9]).max() < 4.5
    place = found.places[0][np.argwhere(found.active)[:, 1] < 3]
    formal = widths(found)[1][place]
    np.testing.assert_allclose(sd[:9], formal, rtol=0.5)
    tree = imuarray.sample(recording, method="independent", steps=60)
    moved = tree["posterior"]["position"].to_numpy().reshape(-1, 9) - posterior.mode[:9]
    assert 0.1 < np.sqrt(np.mean((moved / sd[:9]) ** 2)) < 3.0
    assert tree["posterior"]["effect_parameter"].shape[-1] == 4 * (3 + 6)
    assert np.all(tree["sample_stats"]["acceptance"] > 0.02)


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ({"accelerometer_noise": 0.1}, "expected it with --model papers only"),
        ({"model": "papers", "effects": ["size_effect"]}, "expected none with --model papers"),
        ({"model": "guess"}, "expected any of sensors, papers or a calibration"),
    ],
)
def test_what_does_not_go_together_is_refused(options, said):
    with pytest.raises(InputError, match=said):
        imuarray.sample(simulated(20)[0], **options)
