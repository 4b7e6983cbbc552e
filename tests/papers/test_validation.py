"""Are the uncertainties right? `snakemake validate`, small, and proof that it can fail."""

from dataclasses import replace
from functools import partial

import numpy as np
import pandas as pd
import pytest

import imuarray
from imuarray.analysis.model import silent
from imuarray.analysis.sensors import fitted
from imuarray.geometry import positions_of, sub_array
from imuarray_papers.config import read_config
from imuarray_papers.estimation.newton import fisher_scoring
from imuarray_papers.figures import uncertainty
from imuarray_papers.figures.uncertainty import coverage
from imuarray_papers.studies import sbc, truths
from imuarray_papers.studies.sbc import METHODS
from imuarray_papers.studies.truths import setting_from
from tests.papers.test_pipeline import ROOT

pytestmark = pytest.mark.slow


def setting(name="paper", samples=5, triads=4):
    config = read_config(ROOT / "config.yaml")
    config["validation"]["settings"][name]["triads"] = triads
    return setting_from(config, name, samples)


@pytest.mark.parametrize("method", METHODS)
def test_pit_values_of_the_truth_are_uniform(method):
    """20 truths, 9 coordinates: p below 1e-3 in one of a thousand runs of a right sampler."""
    values = sbc.pit_values(setting(), range(20), methods=[method])
    assert len(values) == 20 * 11
    row = coverage(values).iloc[0]
    assert row.p > 1e-3
    scores = row[["shift_z", "width_z", "size_z", "misfit_z"]].dropna().astype(float)
    assert len(scores) == (3 if method == "ML" else 4) and np.all(np.abs(scores) < 4)
    for share in (50, 90, 95):
        assert abs(row[f"covered_{share}"] - share / 100) < 4.5 * max(row[f"se_{share}"], 0.01)


@pytest.mark.parametrize("factor", [0.6, 1.6])
def test_widths_that_are_wrong_are_seen(monkeypatch, factor):
    """Were the accelerometers' noise so many times what is assumed."""
    measure = truths.measure

    def measured(model, *arguments):
        noise = type(model.noise)(factor**2 * model.noise.accelerometer, model.noise.gyroscope)
        return measure(type(model)(model.array, noise), *arguments)

    monkeypatch.setattr(truths, "measure", measured)
    values = sbc.pit_values(setting(), range(30), methods=["NUTS"])
    assert np.sign(np.log(factor)) * coverage(values).width_z[0] > 3


def test_the_command_as_it_is_needs_neither_the_noise_nor_the_motions_size():
    """Three truths; six, told a quarter of the noise, have intervals that are too narrow."""
    values = sbc.pit_values_by_default(setting("default"), range(3), imuarray.sample)
    assert len(values) == 3 * 10
    row = coverage(values).iloc[0]
    assert row.p > 1e-3 and row.none == row.slow == 0
    assert np.all(np.abs(row[["shift_z", "width_z", "size_z"]].astype(float)) < 4)
    told = partial(imuarray.sample, model="papers", accelerometer_noise=0.01)
    narrow = sbc.pit_values_by_default(setting("default"), range(6), told)
    assert coverage(narrow).width_z[0] > 3


def test_pit_values_are_uniform_where_data_tell_little():
    """The hard setting: posteriors a third to two thirds as wide as the prior."""
    values = sbc.pit_values(setting("hard"), range(8), methods=["NUTS"])
    row = coverage(values).iloc[0]
    assert row.p > 1e-3
    scores = row[["shift_z", "width_z", "size_z", "misfit_z"]].astype(float)
    assert np.all(np.abs(scores) < 4)


def test_samplers_agree_truth_by_truth_where_data_determine_little():
    """Of numbers 69 and 138 the mass is 4 sds off the mode, which the walk takes long to reach."""
    numbers = [*range(4), 69, 138]
    methods = ["PmMH", "NUTS"]
    values = sbc.pit_values(setting("hard"), numbers, methods=methods)
    table = coverage(values).set_index("method")
    assert table.apart["PmMH"] < 0.15 and np.isnan(table.apart["NUTS"])
    assert table.slow["NUTS"] == 0 and table.slow["PmMH"] <= 2


def test_local_optima_are_told_by_their_residuals_and_left():
    """From the nominal positions alone some searches end there; from several starts none does."""
    chosen, lost = setting(), 0
    prior, values = chosen.prior, 3 * 4 * chosen.samples
    precision = np.diag(prior.sd**-2.0)
    for number in range(200):
        one = truths.replicate(chosen, number)
        data, nominal = one.likelihood.collapsed, positions_of(prior.mean)
        alone = fisher_scoring(data, nominal, (prior.mean, precision), covariance=False)
        sd = np.sqrt(np.diag(one.covariance))
        assert np.abs((one.mode - one.truth) / sd).max() < 6
        if np.abs((alone.positions[1:].ravel() - one.truth) / sd).max() > 6:
            lost += 1
            assert alone.cost[-1] > 20 * values
    assert 0 < lost <= 16


def test_sub_array_is_spread_over_the_board():
    array = setting(triads=32).model.array
    part = sub_array(array, 8)
    assert part.accelerometers == part.gyroscopes == 8
    assert part.labels[0] == array.labels[0] and part.labels[-1] == array.labels[-1]
    assert sub_array(array, 32) is array


def test_histogram_of_uniform_pit_values_is_flat():
    rng = np.random.default_rng(1)
    rows, columns = np.indices((400, 6))
    values = pd.DataFrame(
        {"setting": "s", "method": "x", "samples": 5, "replicate": rows.ravel(),
         "quantity": columns.ravel(), "pit": rng.random(2400)}
    )  # fmt: skip
    table = uncertainty.histogram(values)
    assert len(table) == uncertainty.BINS
    assert table.density.mean() == pytest.approx(1.0)
    assert np.abs((table.density - 1) / table.se).max() < 4.5
    settings = {"scale": {"name": "quick"}, "seed": 1}
    draw, same = uncertainty.figure_validation_ranks([values], settings)
    figure = draw(same)
    pd.testing.assert_frame_equal(same, table)
    [panel] = [axes for axes in figure.axes if axes.get_visible()]
    assert panel.get_title() == "s, T = 5\nx, n = 400"


def test_few_readings_that_lie_far_apart_are_not_taken_for_coarse_ones():
    """Fifty rates of 1000 deg/s lie 4 deg/s apart at least: the noise came out 20 times too large,
    and the posterior of gyroscopes' scales took NUTS a minute."""
    made = setting("extended", 50, 6)
    recording = sbc.drawn(made, 2)[1]
    found = fitted([recording], "sensors", made.model.effects, silent)[0]
    sd = np.sqrt(made.model.noise.gyroscope[0, 0])
    np.testing.assert_allclose(found.noise_sd()[:, 1], sd, rtol=0.3)


def test_readings_in_steps_are_noise_of_a_step_at_least():
    made = setting("extended", 50, 6)
    recording = sbc.drawn(made, 2)[1]
    recording = replace(recording, angular_rate=np.round(recording.angular_rate / 0.5) * 0.5)
    found = fitted([recording], "sensors", made.model.effects, silent)[0]
    assert (found.noise_sd()[:, 1] >= 0.99 * 0.5 / np.sqrt(12)).all()
