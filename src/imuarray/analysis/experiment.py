"""Paper 2021's experiment, figure 5 and table II, on a board whose sensors are known."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import xarray as xr

from imuarray.analysis.calibration_dataset import places_among, positions_dataset
from imuarray.analysis.known import with_board
from imuarray.engine.estimate import Estimate, stepped
from imuarray.engine.fit import flat_parameters, prior_means
from imuarray.engine.ladder import mask_of
from imuarray.engine.parameters import POSITION
from imuarray.engine.passes import normal_pass
from imuarray.model.effects import EFFECTS
from imuarray.recording import Recording

STEPS = 20  # of Gauss-Newton, at most
SETTLED = 1e-3  # of a position's sd


def located(recording: Recording, calibration: xr.Dataset, samples: Sequence[int]) -> xr.Dataset:
    """Positions from ``samples`` moving samples of a recording, with the drawing as prior.

    ``recording``, ``calibration``: as `imuarray.analysis.leave_out.left_out` gives them. Sensors
    are as the calibration, of other recordings, has them, biases and clocks as the whole recording;
    samples are spread evenly. Variables of `positions_dataset` for each of ``samples``; the widths
    have the calibration's own.
    """
    readings, found = with_board(recording, calibration)
    parts = []
    for count in samples:
        used = np.zeros(len(readings.time), bool)
        used[np.linspace(0, len(used) - 1, count).round().astype(int)] = True
        one = found.recorded[0].select(used)
        positions, covariance = _positions(replace(found, recorded=(one,)), calibration)
        parts.append(positions_dataset(recording, positions, covariance))
    return xr.concat(parts, xr.DataArray(list(samples), dims="samples", name="samples"))


def _positions(found: Estimate, calibration: xr.Dataset) -> tuple[np.ndarray, np.ndarray]:
    """Most likely (A, 3) m, and the covariance of r_2 ... r_A."""
    (one,), columns = found.recorded, found.columns
    active = mask_of(columns, [POSITION])
    nominal = prior_means(one.readings, columns)[active]
    prior = np.diag(1.0 / np.broadcast_to(columns.prior_sd, active.shape)[active] ** 2)
    for _ in range(STEPS):
        seen = normal_pass(one.readings, columns, one.state, active)
        state = one.state._replace(motion=seen.motion)
        information = seen.information.sum(axis=0) + prior
        off = flat_parameters(columns, state)[active] - nominal
        step = np.linalg.solve(information, seen.score.sum(axis=0) - prior @ off)
        one = replace(one, state=stepped(state, columns, active, step))
        if np.max(np.abs(step) * np.sqrt(np.diag(information))) < SETTLED:
            break
    formal = np.linalg.inv(information)
    pull, known = _sensors(replace(found, recorded=(one,)), calibration)
    return one.state.positions, formal + formal @ pull @ known @ pull.T @ formal


def _sensors(found: Estimate, calibration: xr.Dataset) -> tuple[np.ndarray, np.ndarray]:
    """Of k parameters that are the board's: (n, k) their information with positions; (k, k) their
    covariance in the calibration."""
    (one,), columns = found.recorded, found.columns
    effects = calibration.attrs["effects"].split(",")
    shared = [name for name in effects if not EFFECTS[name].own]
    every = mask_of(columns, [POSITION, *shared])
    place, _ = places_among(replace(found, active=every, places=(np.arange(every.sum()),)), effects)
    information = normal_pass(one.readings, columns, one.state, every).information.sum(axis=0)
    position = np.isin(np.array(columns.names)[np.nonzero(every)[1]], POSITION)
    whole = calibration["whole_covariance"].to_numpy()
    own = place[~position]
    return information[np.ix_(position, ~position)], whole[np.ix_(own, own)]
