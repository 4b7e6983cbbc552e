"""Figures of estimation theory, from the studies themselves at toy size."""

import numpy as np
import pandas as pd
import pytest

from imuarray_papers.figures import uncertainty
from imuarray_papers.studies import bound
from tests.cases import model
from tests.papers.test_bound import MOTION, OPTIONS

SETTINGS = {
    "scale": {"name": "quick"}, "seed": 1, "theory": {"convergence_samples": 30},
    "paper2017": {"position_sd": OPTIONS["position_sd"]},
}  # fmt: skip


def test_efficiency():
    few = {**OPTIONS, "realisations": 10}
    tables = [
        bound.efficiency(model(), 2, [10, 30], MOTION, few),
        bound.efficiency(model(), 2, [10], MOTION, few, noise=10.0),
    ]
    draw, table = uncertainty.figure_theory_efficiency(pd.concat(tables), SETTINGS)
    top, below, louder = draw(table).axes
    assert [len(line.get_xdata()) for line in louder.lines[:1]] == [2]
    assert len(top.get_legend().get_texts()) == 4
    assert below.get_ylabel() == "error / bound"


def test_convergence_shows_other_arrays_and_leaves_out_what_tells_nothing():
    slow = (0.5, 1.0, 10.0)  # determines less than the nominal positions
    tables = [bound.convergence(model(), 3, 30, [MOTION, slow], {**OPTIONS, "limit": 300}, count=1)]
    others = bound.geometries(model())
    assert set(others) == {"3 triads", "4 triads", "all triads in one plane", "half the size"}
    other = others["4 triads"]
    tables.append(bound.convergence(other, 3, 30, [MOTION], {**OPTIONS, "limit": 300}, count=1))
    table = pd.concat(tables)
    assert list(table.array) == [model().array.name] * 2 + ["4 triads"]
    assert table.bound_m.iloc[1] > OPTIONS["position_sd"] / 3
    draw, table = uncertainty.figure_theory_convergence(table, SETTINGS)
    top, below = draw(table).axes
    drawn = [x for line in top.lines for x in line.get_xdata()]
    assert set(np.round(drawn)) == {round(np.degrees(MOTION[0]))}
    assert [text.get_text() for text in below.get_legend().get_texts()] == ["4 triads"]


def test_size():
    table = bound.against_size(model(), 4, 30, MOTION, [1.0, 2.0], count=2)
    draw, table = uncertainty.figure_theory_size(table, SETTINGS)
    top, below = draw(table).axes
    assert top.lines[0].get_ydata() == pytest.approx(1e6 * table.bound_m.to_numpy())
    assert "ppm" in below.get_ylabel()


def test_rate_is_seen_before_rounding_takes_over():
    """Steps that stall at the optimum's own rounding say nothing of the rate."""
    marks = np.arange(1, 200)
    away = 1e-3 * 0.9**marks + 2e-8
    assert bound.rate_seen(1e-6, marks, away) == pytest.approx(0.9, abs=0.01)
