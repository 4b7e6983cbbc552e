"""Positions of a board and parameters of its sensors by the sensor model, or by chosen effects."""

import json
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import xarray as xr

from imuarray.analysis import methods
from imuarray.analysis.known import again, used
from imuarray.analysis.model import Say, silent
from imuarray.engine.dataset import engine_dataset, with_readings
from imuarray.engine.estimate import Estimate
from imuarray.engine.forward import EffectGroup, groups_of, select_forward, with_effects
from imuarray.errors import InputError, one_line
from imuarray.firstorder.rails import less_leak_by_others
from imuarray.provenance import digest, stamp
from imuarray.recording import Recording, load_dataset
from imuarray.recording.channels import require_apart, require_live


def fitted(
    recordings: Sequence[Recording], model: str, effects: Sequence[str], say: Say
) -> tuple[Estimate, list[EffectGroup]]:
    """(estimate, groups tried) under a calibration's model, ``effects``, or the sensor model.

    InputError where no model of the kind is near the readings.
    """
    if methods.is_file(model):
        with _near_the_model():
            try:
                return again(recordings[0], load_dataset(Path(model)), say), []
            except InputError as error:
                raise InputError(f"--model {model}: {error}") from None
    readings = [used(one, say) for one in recordings]
    if not effects:
        return _selected(readings, True, say)
    with _near_the_model():
        return with_effects(readings, effects), []


@contextmanager
def _near_the_model() -> Iterator[None]:
    """A search that diverges is bad input, in one line."""
    try:
        yield
    except np.linalg.LinAlgError as error:
        raise InputError(
            "recording: expected readings near those of the model, found a search that diverges"
            f" ({one_line(error)}); are they corrected (imuarray first-order), and units, axes and"
            " times as declared?"
        ) from error


def fitted_beyond(
    recording: Recording, model: str, effects: Sequence[str], say: Say
) -> Estimate | None:
    """`fitted` of one recording, None where no more than positions and motion are in the model."""
    if methods.is_file(model) or effects:
        return fitted([recording], model, effects, say)[0]
    readings = [used(recording, say)]
    if not groups_of(readings):
        return None
    found, groups = _selected(readings, False, say)
    return found if any(group.kept for group in groups) else None


def _selected(readings, bare: bool, say: Say) -> tuple[Estimate, list[EffectGroup]]:
    """`select_forward`, each group's verdict told."""
    with _near_the_model():
        found, groups = select_forward(readings, bare=bare)
    for group in groups:
        verdict = "kept" if group.kept else "left out"
        say(f"{group.name}: {verdict}, {group.gain:.3g} ({group.error:.2g}) nats on held-out time")
    return found, groups


def calibrate_sensors(
    recordings: Sequence[Recording], model: str = "sensors", effects: Sequence[str] = (),
    say: Say = silent,
) -> xr.Dataset:  # fmt: skip
    """`imuarray.calibrate` by the sensor model, ``effects``, or the path of a calibration."""
    for one in recordings:
        require_live(one)
    require_apart(recordings)
    whole = [less_leak_by_others(one) for one in recordings]
    found, groups = fitted(whole, model, effects, say)
    dataset = engine_dataset(whole, found)
    dataset.attrs["parts"] = json.dumps([group._asdict() for group in groups])
    return finished(dataset, recordings, model)


def finished(dataset: xr.Dataset, recordings, model: str) -> xr.Dataset:
    """With what the recordings say of themselves, and the origin."""
    if not all(np.isfinite(dataset[f"position{name}"]).all() for name in ("", "_covariance")):
        raise InputError("recording: expected one that determines the positions, found no solution")
    dataset = with_readings(dataset, recordings)
    data = [part for one in recordings for part in (one.specific_force, one.angular_rate)]
    dataset.attrs |= {"model": model, **stamp({"recording": digest(*data)}, 0)}
    return dataset
