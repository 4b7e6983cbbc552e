"""Rough motion under a known board: in which turn of its clock a reading is."""

from dataclasses import replace

import numpy as np

import imuarray
from imuarray.engine.derivatives import no_derivatives
from imuarray.engine.linearise import RoughPrior, State, predicted
from imuarray.engine.parameters import columns_of
from imuarray.engine.readings import measured
from imuarray.engine.rough_fusion import Rough
from imuarray.geometry import sub_array
from imuarray.model import ArrayModel


def test_a_reading_of_the_other_turn_is_told_from_its_neighbours():
    """One that was read before the jump though its clock says after; far from it nothing is asked.

    Its prediction moves by a period's angular acceleration.
    """
    array, count = sub_array(imuarray.mimu4444(), 4), 3
    papers = ArrayModel.isotropic(array, 0.04, 0.004)
    columns = columns_of(array, ("sensor_clock",), 1e-3)
    clock = np.tile([1e-3, 0.5, 0.0, 0.0, 0.0], (4, 1))
    clock[:, 2] = 0.05, 0.5, 0.95, 0.4  # phases at time 0: turns just begun, in it, nearly over
    motion = np.zeros((count, 24))
    motion[:, :6] = 10.0, -5.0, 3.0, 500.0, -300.0, 200.0
    motion[:, 15:18] = 1.0
    nothing = no_derivatives(count, 4)
    prior = RoughPrior(np.zeros((count, 15)), np.ones((count, 15)), np.ones((count, 3)))
    state = State(motion, array.relative, clock.ravel(), nothing, prior)
    rates = np.zeros((count, 4, 3))
    readings = measured(papers, rates, rates, None, np.arange(count) * 1e-3)
    true = np.zeros((count, 4))
    true[1, 0], true[2, 2] = 1.0, -1.0
    values = predicted(replace(readings, clock_deviation=true), columns.model, state)
    readings = replace(readings, values=values, clock_deviation=np.zeros((count, 4)))
    rough = Rough(readings, columns, state, np.full(2, np.inf), None, 0.0, np.zeros(count, bool))
    other, doubt, change = rough.turns()
    np.testing.assert_array_equal(doubt > 0.5, true != 0)
    np.testing.assert_array_equal(other.clock_deviation[true != 0], true[true != 0])
    assert doubt[:, [1, 3]].max() == 0.0 and not change[:, [1, 3]].any()
    np.testing.assert_allclose(np.abs(change[1, 0, 3:]), [0.501, 0.299, 0.201], rtol=1e-9)
