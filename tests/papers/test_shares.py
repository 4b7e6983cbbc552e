"""Work dealt to several jobs gives what one job gives."""

import numpy as np
import pandas as pd
import pytest

from imuarray_papers.config import read_config
from imuarray_papers.studies.position_error import joined, realise, study, table_of
from imuarray_papers.studies.sbc import pit_values
from imuarray_papers.studies.truths import share
from tests.cases import model
from tests.papers.test_validation import setting


@pytest.mark.parametrize("count, parts", [(10, 3), (2, 5), (0, 2), (7, 7), (26, 1)])
def test_shares_are_all_jobs_once_and_even(count, parts):
    found = [share(range(count), part, parts) for part in range(parts)]
    assert sum(found, []) == list(range(count))
    assert np.ptp([len(one) for one in found]) <= 1


@pytest.mark.parametrize("name", ["samples", "motion", "force"])
def test_position_errors(name):
    config = read_config("config.yaml")
    config["paper2017"] |= {"fig4_samples": [3, 10], "fig4_iterations": [1, 20],
                            "fig5_rates_dps": [500.0, 2000.0]}  # fmt: skip
    settings = {**config, "scale": {"realisations": 80}}
    cases, options = study(settings, name)
    whole = realise(model(), 3, cases[:2], options)
    parts = [realise(model(), 3, cases[:2], options, part=k, parts=5) for k in range(5)]
    assert any(part.status.shape[1] == 0 for part in parts)  # four batches
    for one, other in zip(whole, joined(parts), strict=True):
        np.testing.assert_array_equal(one, other)
    table = table_of(name, cases[:2], whole, options["marks"])
    assert np.all(table.realisations == 80) and np.all(table.rmse_m > 0)


@pytest.mark.slow
@pytest.mark.parametrize("method", ["ML", "NUTS"])
def test_pit_values(method):
    whole = pit_values(setting(), range(4), methods=[method])
    parts = [pit_values(setting(), share(range(4), k, 3), methods=[method]) for k in range(3)]
    joint = pd.concat(parts, ignore_index=True).sort_values(["replicate"], kind="stable")
    pd.testing.assert_frame_equal(whole, joint.reset_index(drop=True))
