"""A board without a drawing: positions begin from the motion."""

from dataclasses import replace

import numpy as np
import pytest

import imuarray
from imuarray.analysis.logs import Opened, _placed
from imuarray.errors import InputError
from tests.cases import model


def test_positions_that_nobody_drew_begin_from_the_motion():
    """Scales 1 % off and an offset of each triad are a map and a constant."""
    given = {"seed": 4, "angular_rate": 10.0, "position_error": 1e-6}
    recording, _ = imuarray.simulate(model().array, 5.0, 200.0, **given)
    rng = np.random.default_rng(1)
    scales = 1 + 0.01 * rng.standard_normal(recording.specific_force.shape[1:])
    force = scales * recording.specific_force + rng.standard_normal(scales.shape)
    bare = np.full_like(recording.accelerometer_position, np.nan)
    bare = replace(recording, specific_force=force, accelerometer_position=bare)
    found, [line] = _placed(Opened(bare, []))
    off = found.relative_positions() - recording.relative_positions()
    assert np.abs(off).max() < 2 * found.position_prior_sd < 0.01
    assert "no positions given" in line and _placed(Opened(recording, [])).lines == []
    slow = replace(bare, specific_force=np.tile(force[:1], (len(force), 1, 1)))
    with pytest.raises(InputError, match="expected those of a drawing, or motion"):
        _placed(Opened(slow, []))
    rails = replace(bare, gyroscope_range=1e-6)
    with pytest.raises(InputError, match="expected readings off their rails.*none of 1000"):
        _placed(Opened(rails, []))
