"""Recordings of a board under the sensor model, or under that of a calibration."""

import json
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

import numpy as np
import xarray as xr

from imuarray.analysis import methods
from imuarray.analysis.model import Notify, require_motion, silent
from imuarray.engine.dataset import engine_dataset, with_readings
from imuarray.engine.estimate import Estimate, Recorded, estimate
from imuarray.engine.forward import EffectGroup, groups_of, resumed, select_forward, with_effects
from imuarray.engine.parameters import POSITION, columns_of, model_of
from imuarray.engine.readings import Readings, arrange, determined, most_informative
from imuarray.engine.start import start
from imuarray.errors import IdentifiabilityError, InputError, one_line, require
from imuarray.firstorder.rails import less_leak_by_others
from imuarray.geometry.array import require_planar_extent
from imuarray.linear import FLOOR, scaled_eigh
from imuarray.provenance import digest, stamp
from imuarray.recording import Recording, load_dataset
from imuarray.recording.channels import require_apart, require_live
from imuarray.trust import effect_names, require_fit


def calibrate_sensors(
    recordings: Sequence[Recording], model: str = "sensors", effects: Sequence[str] = (),
    notify: Notify = silent,
) -> xr.Dataset:  # fmt: skip
    """`imuarray.calibrate` by the engine: the sensor model, ``effects``, or a calibration's."""
    for one in recordings:
        require_live(one)
    require_apart(recordings)
    whole = [less_leak_by_others(one) for one in recordings]
    found, groups = fitted(whole, str(model), effects, notify)
    assert found is not None  # for it is wanted in any case
    dataset = engine_dataset(whole, found)
    dataset.attrs["parts"] = json.dumps([group._asdict() for group in groups])
    return finished(dataset, recordings, str(model))


@contextmanager
def near_the_model() -> Iterator[None]:
    """A search that diverges is bad input, in one line."""
    try:
        yield
    except np.linalg.LinAlgError as error:
        raise InputError(
            "recording: expected readings near those of the model, found a search that diverges"
            f" ({one_line(error)}); are they corrected (imuarray first-order), and units, axes and"
            " times as declared?"
        ) from error


@near_the_model()
def fitted(
    recordings: Sequence[Recording], model: str, effects: Sequence[str], notify: Notify,
    plain: bool = True,
) -> tuple[Estimate | None, list[EffectGroup]]:  # fmt: skip
    """(estimate, groups tried) under a calibration's model, ``effects``, or the sensor model.

    ``plain``: whether an estimate is wanted where no group of the sensor model gains, or can be
    tried; else it is None there. InputError where no model of the kind is near the readings.
    """
    if methods.is_file(model):
        try:
            return again(recordings[0], load_dataset(Path(model)), notify), []
        except InputError as error:
            raise InputError(f"--model {model}: {error}") from None
    if model == "papers":
        return positions_alone(used(recordings[0], None)), []
    readings = [used(one, notify) for one in recordings]
    if effects:
        return with_effects(readings, effects), []
    if not plain and not groups_of(readings):
        return None, []
    found, groups = select_forward(readings, plain=plain)
    for group in groups:
        verdict = "kept" if group.kept else "left out"
        gained = f"{group.gain:.3g} ({group.error:.2g}) nats on held-out time"
        notify(f"{group.name}: {verdict}, {gained}")
    return found if plain or any(group.kept for group in groups) else None, groups


def positions_alone(readings: Readings) -> Estimate:
    """The maximum of the papers' likelihood: positions and motion, the declared noise, no prior.

    IdentifiabilityError where triads or motion leave a direction of the positions open.
    """
    require_planar_extent(readings.array.positions, "recording")
    columns = columns_of(readings.array, (), 1e3)  # m: none, but for parts that tell nothing
    begun = Recorded(readings, start(readings, columns), smooth=False)
    require_motion(readings, begun.state)
    found = estimate([begun], columns, columns.mask([POSITION]), noise="fixed")
    if not scaled_eigh(found.information)[0][0] > FLOOR:
        raise IdentifiabilityError(
            "calibration: expected informative motion, found a direction of the positions that the"
            " data do not determine"
        )
    return found


def finished(dataset: xr.Dataset, recordings, model: str) -> xr.Dataset:
    """With what the recordings say of themselves, and the origin."""
    if not all(np.isfinite(dataset[f"position{name}"]).all() for name in ("", "_covariance")):
        raise InputError("recording: expected one that determines the positions, found no solution")
    dataset = with_readings(dataset, recordings)
    data = [part for one in recordings for part in (one.specific_force, one.angular_rate)]
    dataset.attrs |= {"model": model, **stamp({"recording": digest(*data)}, 0)}
    return dataset


def again(recording: Recording, calibration: xr.Dataset, notify: Notify = silent) -> Estimate:
    """The estimate of a recording from where a calibration has it.

    Of the effects' parameters those are free that the calibration has estimated. InputError for
    another dataset, or other IMUs.
    """
    require_fit(calibration, recording)
    for name in str(calibration.attrs.get("corrected_readings", "")).split():
        notify(f"{name}: concerns readings, not the model; they are used as they are")
    require("effect_parameter" in calibration, "", "a calibration with effects", "one without")
    effects, readings = effect_names(calibration), used(recording)
    origin, span = calibration.attrs["time_origin"], calibration.attrs["span"]
    since = readings.time + readings.origin - origin
    readings = replace(readings, time=since, span=span, origin=origin)
    columns = columns_of(readings.array, effects, readings.position_prior_sd)
    model, positions = model_of(recording, effects), calibration["position"].to_numpy()
    values, free = (
        columns.model.join(model.split(calibration[name].to_numpy()))
        for name in ("effect_parameter", "effect_sd")
    )
    state = start(readings, columns)._replace(positions=positions, parameters=values)
    active = columns.flat(state._replace(parameters=(free > 0).astype(float))) > 0
    active[:, columns.of(POSITION)] = True
    return resumed(readings, columns, active & columns.owner, state)


def used(recording: Recording, notify: Notify | None = silent) -> Readings:
    """The moving samples that a board is estimated from; InputError where there are none.

    Of a long recording the most informative ones, which ``notify`` is told; without it all.
    """
    readings = arrange(recording, sparse=True)
    found = readings.select(determined(readings, 1))
    found = found if notify is None else most_informative(found, notify)
    rate = 1 / np.median(np.diff(recording.time)) if len(recording.time) > 1 else 0.0
    none = f"none, at {rate:.4g} samples a second; is the unit of time right?"
    require(len(found.time), "recording", "samples that determine the motion", none)
    return found
