"""A board from some recordings, and what it says of another one.

Its held-out densities, positions from few of its samples, and gyroscope readings beyond a made-up
rail, withheld and predicted from the rest.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pandas as pd
import xarray as xr

from imuarray.analysis.beside import fused, with_board
from imuarray.analysis.sensors import used
from imuarray.engine.course import block_scores
from imuarray.engine.dataset import engine_dataset, places_among, positions_dataset
from imuarray.engine.estimate import Estimate, Recorded, estimate
from imuarray.engine.forward import DELAYS, ROUGH_GROUPS, Selected
from imuarray.engine.fusion import fuse
from imuarray.engine.heldout import gain
from imuarray.engine.parameters import POSITION, columns_of, stepped
from imuarray.engine.readings import Readings
from imuarray.engine.robust import Linearised
from imuarray.engine.settings import SETTINGS
from imuarray.engine.widths import widened
from imuarray.errors import InputError
from imuarray.firstorder.correct import calibrate_first_order, calibrate_together, correct
from imuarray.model import ArrayModel
from imuarray.model.effects import EFFECTS
from imuarray.recording import Recording, array_of
from imuarray.trust import effect_names, values_of

STEPS = 20  # of Gauss-Newton, at most
SETTLED = 1e-3  # of a position's sd
BINS = (250, 350, 500, 700, 1000, 1400, 2000)  # deg/s; the first is the rail that is made up
PER_BIN = 150  # samples
ASSUMED = 0.79  # m/s^2, the accelerometers' noise in paper 2021's experiment


def left_out(
    recording: Recording, others: Sequence[Recording], **options
) -> tuple[Recording, xr.Dataset]:
    """(a recording corrected by the ``others``' maps, the board's calibration from these).

    All raw; ``options`` of `calibrate_first_order`. Of the recording itself its still poses alone
    are used, for its offsets and its noise.
    """
    firsts = calibrate_together(others, **options)
    corrected = [correct(one, first) for one, first in zip(others, firsts, strict=True)]
    own = calibrate_first_order(recording, gyroscopes="offset", **options)
    calibration = engine_dataset(corrected, widened(board_of([used(one) for one in corrected])))
    triads = replace(own.triads, matrix=firsts[0].triads.matrix)
    of_board = replace(own, triads=triads, gyroscopes=firsts[0].gyroscopes)
    return correct(recording, of_board), calibration


def board_of(readings: Sequence[Readings]) -> Estimate:
    """All groups of the sensor model but the IMUs' delays, from recordings of rough motion."""
    columns = columns_of(
        readings[0].array, [effect for ids in ROUGH_GROUPS.values() for effect in ids],
        readings[0].position_prior_sd,
    )  # fmt: skip
    begun = [Recorded.of(one, columns) for one in readings]
    found = estimate(begun, columns, columns.mask([POSITION]), steps=SETTINGS.group_steps)
    now, _ = Selected(found, tuple(one.readings.keep for one in begun), {}).clocked()
    return now.with_kept([n for n in ROUGH_GROUPS if n not in (*now.kept, DELAYS)]).fitted().found


def predicted(recording: Recording, calibration: xr.Dataset) -> pd.DataFrame:
    """Held-out log densities of a recording under several models, a row for each.

    ``recording``, ``calibration``: as `left_out` gives them. Models: ``inflated``, the papers' with
    its own positions and each triad's noise as large as the residual; ``heavy``, the same with
    Student's t; ``board``, the calibration with the recording's biases, clocks and motion;
    ``own``, all parameters fitted to the recording. Columns: samples; nats a sample over
    ``inflated`` and their standard error between blocks; the same over ``board``; residual_ratio.
    """
    readings, board = with_board(recording, calibration)
    effects = effect_names(calibration)
    shared = [POSITION, *(name for name in effects if not EFFECTS[name].own)]
    every = board.active | board.columns.mask(shared)
    placed = columns_of(readings.array, (), readings.position_prior_sd)
    active, begun = placed.mask([POSITION]), [Recorded.of(readings, placed)]
    fits = {
        "inflated": estimate(begun, placed, active, noise="normal"),
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

    ``recording``, ``calibration``: as `left_out` gives them. Sensors
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
    active = columns.mask([POSITION])
    nominal = columns.prior_means()[active]
    prior = np.diag(1.0 / np.broadcast_to(columns.prior_sd, active.shape)[active] ** 2)
    for _ in range(STEPS):
        linear, _ = Linearised.of(one.readings, columns, one.state, active, 1)
        blocks, motion = linear.equations(active)
        state = one.state._replace(motion=motion)
        information = sum(inner for inner, _ in blocks) + prior
        off = columns.flat(state)[active] - nominal
        step = np.linalg.solve(information, sum(slope for _, slope in blocks) - prior @ off)
        one = replace(one, state=stepped(state, columns, active, step))
        if np.max(np.abs(step) * np.sqrt(np.diag(information))) < SETTLED:
            break
    formal = np.linalg.inv(information)
    pull, known = _sensors(replace(found, recorded=(one,)), calibration)
    return one.state.positions, formal + formal @ pull @ known @ pull.T @ formal


def _sensors(found: Estimate, calibration: xr.Dataset) -> tuple[np.ndarray, np.ndarray]:
    """The board's k parameters: (n, k) information with positions, (k, k) covariance."""
    (one,), columns = found.recorded, found.columns
    effects = effect_names(calibration)
    shared = [name for name in effects if not EFFECTS[name].own]
    every = columns.mask([POSITION, *shared])
    place, _ = places_among(replace(found, active=every, places=(np.arange(every.sum()),)), effects)
    linear, _ = Linearised.of(one.readings, columns, one.state, every, 1)
    information = sum(inner for inner, _ in linear.equations(every)[0])
    position = np.isin(np.array(columns.names)[np.nonzero(every)[1]], POSITION)
    whole = calibration["whole_covariance"].to_numpy()
    own = place[~position]
    return information[np.ix_(position, ~position)], whole[np.ix_(own, own)]


def past_rail(
    recording: Recording, calibration: xr.Dataset, bins=BINS, per_bin: int = PER_BIN
) -> pd.DataFrame:
    """Errors of withheld gyroscope readings, as several models predict them.

    Parameters
    ----------
    recording
        Whole and corrected; samples at a true rail are not used.
    calibration
        Of the board, from other recordings. The recording's biases, clocks, noise and motion are
        fitted without the withheld readings.
    bins
        Edges in deg/s of the withheld axis' rate; the first is the rail.

    Returns
    -------
    DataFrame
        A row per model (``clipped``; the papers' with ``nominal`` or ``calibrated`` positions and,
        ``delayed``, the gyroscopes' lead (`lead_of`); ``board``, the whole calibration) and bin of
        the withheld axis' rate: mid ``rate_dps``, ``readings`` (of all gyroscopes, which share an
        error), ``rmse_dps``, ``median_dps`` of the absolute error, ``above_100`` the share beyond
        100 deg/s, and for ``board`` what it claims: ``sd_dps`` (median), ``rms_sd_dps`` and
        ``within_95``.

    InputError where no sample is beyond the rail.
    """
    lowest = np.radians(bins[0])
    index = _choose(recording, np.radians(bins), per_bin)
    chosen = recording.select(index)
    withheld = (np.abs(chosen.angular_rate) >= lowest).any(axis=1, keepdims=True)
    withheld = np.broadcast_to(withheld, chosen.angular_rate.shape)
    hidden = _hidden(recording, index, withheld, lowest)
    clipped = hidden.select(index)
    nominal, positions = recording.relative_positions(), calibration["position"].to_numpy()
    whole = fused(hidden, calibration, np.isin(recording.time, chosen.time))
    values, sd = (part[:, : withheld.shape[1], 3:] for part in whole.predictions())
    found = {
        "clipped": clipped.angular_rate,
        "nominal": _predicted(clipped, withheld, nominal, 0.0),
        "calibrated": _predicted(clipped, withheld, positions, 0.0),
        "delayed": _predicted(clipped, withheld, positions, lead_of(calibration)),
        "board": values,
    }
    errors = {name: value - chosen.angular_rate for name, value in found.items()}
    rates = np.abs(chosen.angular_rate.mean(axis=1, keepdims=True))
    rates = np.broadcast_to(rates, withheld.shape)
    return _table(errors, {"board": sd}, withheld, np.degrees(rates), bins)


def _hidden(recording: Recording, index, withheld, rail: float) -> Recording:
    """The recording with the ``withheld`` readings (T, G, 3) of some samples at a rail.

    Of these their sides are left, and that the rate is as large as the rail.
    """
    rate, rails = recording.angular_rate.copy(), recording.saturated_gyroscopes().copy()
    rate[index] = np.where(withheld, np.copysign(rail, rate[index]), rate[index])
    rails[index] |= withheld
    return replace(recording, angular_rate=rate, angular_rate_saturated=rails)


def _predicted(clipped: Recording, withheld, positions, lead: float) -> np.ndarray:
    """Gyroscopes' readings (T, 1, 3) rad/s by the papers' model, ``lead`` s after the motion."""
    model = ArrayModel.isotropic(array_of(clipped), ASSUMED, clipped.gyroscope_noise_sd)
    motion = fuse(
        model, clipped.specific_force, clipped.angular_rate,
        (positions - positions[0])[1:].ravel(), None, withheld,
    ).estimate.motion  # fmt: skip
    return (motion.angular_rate + lead * motion.angular_acceleration)[:, None]


def lead_of(calibration: xr.Dataset) -> float:
    """By how much (s) the gyroscopes are ahead of the accelerometers, 0 where nobody found it."""
    leads = [*values_of(calibration, "gyroscope_delay ").values()]
    return float(np.mean(leads)) if leads else 0.0


def _choose(recording: Recording, edges, per_bin: int) -> np.ndarray:
    """Samples off all true rails, spread evenly over time in each bin of their fastest axis."""
    fastest = np.abs(recording.angular_rate.mean(axis=1)).max(axis=1)
    lost = recording.saturated_gyroscopes()
    off = ~lost.any(axis=(1, 2)) & ~recording.saturated_accelerometers().any(axis=(1, 2))
    chosen = []
    for low, high in zip(edges[:-1], edges[1:], strict=True):
        index = np.flatnonzero(off & (fastest >= low) & (fastest < high))
        chosen.append(index[:: max(1, len(index) // per_bin)][:per_bin])
    index = np.sort(np.concatenate(chosen))
    if not len(index):
        raise InputError(
            f"recording: expected samples beyond {np.degrees(edges[0]):g} deg/s, found none"
        )
    return index


def _table(errors, sds, withheld, rates, bins) -> pd.DataFrame:
    rows = []
    for name, error in errors.items():
        size = np.degrees(np.abs(error))
        for low, high in zip(bins[:-1], bins[1:], strict=True):
            here = withheld & (rates >= low) & (rates < high)
            if not here.any():
                continue
            row = {
                "model": name, "rate_dps": float(np.sqrt(low * high)), "readings": int(here.sum()),
                "above_100": np.mean(size[here] > 100.0),
                "rmse_dps": np.sqrt(np.mean(size[here] ** 2)), "median_dps": np.median(size[here]),
            }  # fmt: skip
            if name in sds:
                claimed = np.degrees(sds[name])
                row["sd_dps"] = np.median(claimed[here])
                row["rms_sd_dps"] = np.sqrt(np.mean(claimed[here] ** 2))
                row["within_95"] = np.mean(size[here] < 1.96 * claimed[here])
            rows.append(row)
    return pd.DataFrame(rows)
