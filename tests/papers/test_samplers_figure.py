"""The figure of the samplers side by side, from its published table."""

import sys
from pathlib import Path

import pandas as pd
import pytest

ROOT = Path(__file__).parents[2]


def test_it_draws_what_the_table_has(monkeypatch):
    monkeypatch.syspath_prepend(str(ROOT / "benchmarks"))
    from samplers_figure import CONVERGED, SHORT, draw

    table = pd.read_csv(ROOT / "docs" / "images" / "samplers.csv")
    assert set(table.sampler) == set(SHORT.values())
    speed, means, sds = draw(table).axes
    shown = {
        line.get_label(): line for line in speed.lines if line.get_label() in set(table.sampler)
    }
    for name, rows in table.groupby("sampler"):
        one = rows.groupby("samples").first()
        assert shown[name].get_ydata() == pytest.approx((one.ess / one.core_seconds).to_numpy())
    hollow = sum(len(line.get_xdata()) for line in speed.lines if line not in shown.values())
    first = table.groupby(["sampler", "samples"]).first()
    assert hollow == (first.rhat > CONVERGED).sum()
    assert len(means.collections) == len(sds.collections) == len(SHORT)
    sys.modules.pop("samplers_figure")
