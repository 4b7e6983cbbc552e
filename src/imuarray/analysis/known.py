"""A recording beside a calibration of its board, whichever recordings that is from."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pandas as pd
import xarray as xr

from imuarray.analysis.calibration_dataset import engine_dataset, places_among, positions_dataset
from imuarray.analysis.model import model_of
from imuarray.engine.clocks import CLOCK, refined, shown_clocks, timed, with_clocks
from imuarray.engine.course import block_scores
from imuarray.engine.estimate import Estimate, Recorded, estimate, stepped
from imuarray.engine.fit import flat_parameters, prior_means
from imuarray.engine.heldout import gain
from imuarray.engine.ladder import DELAYS, RUNGS, Climbed, mask_of
from imuarray.engine.linearise import State
from imuarray.engine.parameters import POSITION, Columns, columns_of
from imuarray.engine.readings import Readings, arrange, determined, measured, most_informative
from imuarray.engine.robust import normal_pass
from imuarray.engine.rough_fusion import Rough, roughly
from imuarray.engine.settings import SETTINGS
from imuarray.engine.widths import settled
from imuarray.firstorder.correct import FirstOrder, calibrate_first_order, correct
from imuarray.model.effects import EFFECTS
from imuarray.recording import Recording

STEPS = 20  # of Gauss-Newton, at most
SETTLED = 1e-3  # of a position's sd


def board_of(readings: Sequence[Readings]) -> Estimate:
    """All rungs of the sensor model but the IMUs' delays, from recordings of rough motion."""
    columns = columns_of(
        readings[0].array, [effect for ids in RUNGS.values() for effect in ids],
        readings[0].position_prior_sd,
    )  # fmt: skip
    begun = [Recorded.of(one, columns) for one in readings]
    found = estimate(begun, columns, mask_of(columns, [POSITION]), steps=SETTINGS.rung_steps)
    now, _ = Climbed(found, tuple(one.readings.keep for one in begun), {}).clocked()
    return now.with_kept([n for n in RUNGS if n not in (*now.kept, DELAYS)]).fitted().found


def with_own(readings: Readings, effects, positions, values: dict) -> Estimate:
    """The parameters of a recording's own beside those of its board, which stay.

    ``effects``: of the board's model; ``positions`` (A, 3) m; ``values`` {effect: parameters}, of
    which those of a recording's own are not looked at. Clocks are looked for where they are among
    the effects.
    """
    own = [name for name in effects if EFFECTS[name].own]
    timing = ["sensor_delay"] * (CLOCK in own and "sensor_delay" not in effects)
    columns = columns_of(readings.array, [*effects, *timing], readings.position_prior_sd)
    kept = {name: value for name, value in values.items() if name not in own}
    state = State(np.empty((0, 9)), positions, columns.model.join(kept), ())
    one = Recorded.of(readings, columns, state)
    free = mask_of(columns, [name for name in own if name != CLOCK])
    if CLOCK not in own:
        return estimate([one], columns, free)
    one = estimate([one], columns, free, steps=SETTINGS.rung_steps).recorded[0]
    clocks, keep = shown_clocks(one, columns), readings.keep
    imus = sorted(clocks)
    one = with_clocks(one, columns, clocks)
    one = timed(refined(one, keep, columns, imus), keep, columns, imus)
    return _finished(one, columns, tuple(effects), [name for name in own if name != CLOCK], imus)


def _finished(one: Recorded, columns: Columns, effects, own, imus) -> Estimate:
    """All ``own`` effects and the clocks of some IMUs, no more than ``effects`` in the model."""
    found = columns.model.split(one.state.parameters)
    columns = columns_of(one.readings.array, effects, one.readings.position_prior_sd)
    values = columns.model.join({name: found[name] for name in effects})
    mask = mask_of(columns, [CLOCK])
    mask[np.setdiff1d(np.arange(len(mask)), imus)] = False
    one = replace(one, state=one.state._replace(parameters=values))
    return estimate([one], columns, mask_of(columns, own) | mask)


def used(recording: Recording) -> Readings:
    """The moving samples that a board is estimated from."""
    readings = arrange(recording, sparse=True)
    return most_informative(readings.select(determined(readings, 1)), lambda text: None)


def with_board(recording: Recording, calibration: xr.Dataset) -> tuple[Readings, Estimate]:
    """A recording's samples, and what is its own beside a calibration's positions and effects."""
    readings, effects = used(recording), calibration.attrs["effects"].split(",")
    values = model_of(recording, effects).split(calibration["effect_parameter"].to_numpy())
    return readings, with_own(readings, effects, calibration["position"].to_numpy(), values)


def fused(recording: Recording, calibration: xr.Dataset, chosen) -> Rough:
    """The motion of the samples ``chosen`` (T,) bool, the recording's own parameters fitted anew.

    Moving samples before and after them say how rough it is.
    """
    _, own = with_board(recording, calibration)
    still = recording.stationary
    moving = chosen | (np.ones(len(chosen), bool) if still is None else ~still)
    since, part = recording.time - recording.time[0], recording.select(moving)
    papers, rails = model_of(recording), part.saturated_gyroscopes()
    readings = measured(papers, part.specific_force, part.angular_rate, rails, since[moving])
    # from the recording's start, not from its first moving sample
    readings = replace(readings, time=since[moving], span=float(since[-1]))
    lost = part.saturated_accelerometers()
    railed = np.zeros(readings.keep.shape, bool)
    railed[:, : lost.shape[1], :3] = lost
    whole = roughly(readings.without(railed), own, papers, rails)
    return whole.select(np.flatnonzero(chosen[moving])).fused()


def left_out(
    recording: Recording, others: Sequence[Recording], **options
) -> tuple[Recording, xr.Dataset]:
    """(a recording corrected by the ``others``' maps, the board's calibration from these).

    All raw; ``options`` of `calibrate_first_order`. Of the recording itself its still poses alone
    are used, for its offsets and its noise.
    """
    firsts = []
    for one in others:
        rest = [other for other in others if other is not one]
        firsts.append(calibrate_first_order(one, others=rest, **options))
    corrected = [correct(one, first) for one, first in zip(others, firsts, strict=True)]
    own = calibrate_first_order(recording, gyroscopes="offset", **options)
    calibration = engine_dataset(corrected, settled(board_of([used(one) for one in corrected])))
    return correct(recording, _of_board(own, firsts[0])), calibration


def _of_board(own: FirstOrder, other: FirstOrder) -> FirstOrder:
    """A recording's first order, its maps another's of the same board."""
    triads = replace(own.triads, matrix=other.triads.matrix)
    return replace(own, triads=triads, gyroscopes=other.gyroscopes)


def predicted(recording: Recording, calibration: xr.Dataset) -> pd.DataFrame:
    """Held-out log densities of a recording under several models, a row for each.

    ``recording``, ``calibration``: as `left_out` gives them. Models: ``inflated``, the papers' with
    its own positions and each triad's noise as large as the residual; ``heavy``, the same with
    Student's t; ``board``, the calibration with the recording's biases, clocks and motion;
    ``own``, all parameters fitted to the recording. Columns: samples; nats a sample over
    ``inflated`` and their standard error between blocks; the same over ``board``; residual_ratio.
    """
    readings, board = with_board(recording, calibration)
    effects = calibration.attrs["effects"].split(",")
    shared = [POSITION, *(name for name in effects if not EFFECTS[name].own)]
    every = board.active | mask_of(board.columns, shared)
    placed = columns_of(readings.array, (), readings.position_prior_sd)
    active, begun = mask_of(placed, [POSITION]), [Recorded.of(readings, placed)]
    fits = {
        "inflated": estimate(begun, placed, active, robust=False),
        "heavy": estimate(begun, placed, active),
        "board": board,
        "own": estimate(board.recorded, board.columns, every),
    }
    scores = {name: block_scores(one) for name, one in fits.items()}
    rows = []
    for name, one in fits.items():
        row = {"model": name, "samples": len(readings.time)}
        for base in ("inflated", "board"):
            row[f"over_{base}"], row[f"over_{base}_error"] = gain(scores[base], scores[name])
        rows.append(row | {"residual_ratio": one.residual_ratio(), "converged": one.converged})
    return pd.DataFrame(rows)


def located(recording: Recording, calibration: xr.Dataset, samples: Sequence[int]) -> xr.Dataset:
    """Positions from ``samples`` moving samples of a recording, with the drawing as prior.

    ``recording``, ``calibration``: as `imuarray.analysis.known.left_out` gives them. Sensors
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
