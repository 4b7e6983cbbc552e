"""Leave one recording out: the board that the others show, and what it says of the one left out."""

from collections.abc import Sequence
from dataclasses import replace

import pandas as pd
import xarray as xr

from imuarray.analysis.calibration_dataset import engine_dataset
from imuarray.analysis.known import used, with_board
from imuarray.engine.densities import block_scores
from imuarray.engine.estimate import Recorded, estimate
from imuarray.engine.heldout import gain
from imuarray.engine.known_board import board_of
from imuarray.engine.ladder import mask_of
from imuarray.engine.parameters import POSITION, columns_of
from imuarray.engine.widths import settled
from imuarray.firstorder.correct import FirstOrder, calibrate_first_order, correct
from imuarray.model.effects import EFFECTS
from imuarray.recording import Recording


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
