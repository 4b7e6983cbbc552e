"""The extended model that a diagnosis came to, for the other commands."""

import json
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import numpy as np

from imuarray.diagnosis.procedure import prepared
from imuarray.diagnosis.settings import SETTINGS
from imuarray.engine.clocks import CLOCK, timed
from imuarray.engine.estimate import Estimate, Recorded, estimate
from imuarray.engine.fit import flat_parameters, from_flat, in_use
from imuarray.engine.linearise import State
from imuarray.engine.parameters import POSITION, Columns, columns_of
from imuarray.engine.readings import Readings, most_informative
from imuarray.engine.start import start
from imuarray.engine.widths import corrected, settled
from imuarray.errors import LARGEST, SMALLEST, InputError
from imuarray.model import EFFECTS, ArrayModel
from imuarray.model.array_model import EffectPrior, parameter_ids
from imuarray.model.effects import DATA_EFFECTS, KINDS
from imuarray.model.noise import Noise
from imuarray.recording import Recording


class Extension(NamedTuple):
    """Effects with their parameters, and the noise sds, of a diagnosis.

    ``values``: {effect: {parameter's name: (value, sd or None)}}; sds by label, m/s^2 and rad/s;
    ``before``: effects that are mended in the readings, not in the model; ``positions`` and their
    ``positions_sd`` (A, 3) m, relative to the first accelerometer.
    """

    effects: tuple[str, ...]
    values: dict[str, dict[str, tuple[float, float | None]]]
    accelerometer_sd: dict[str, float]
    gyroscope_sd: dict[str, float]
    before: tuple[str, ...]
    clock: tuple[float, float]  # where the diagnosed recording's time begins (s), and its span (s)
    positions: np.ndarray
    positions_sd: np.ndarray


def read_extension(path: Path) -> Extension:
    """From `diagnosis.json`; InputError says what is missing."""
    try:
        document = json.loads(Path(path).read_text(encoding="utf-8"), parse_constant=_no_number)
        causes, noise = document["causes"], document["noise_sd"]
        named = [c["effect"] for c in causes]
        effects = tuple(name for name in named if name in EFFECTS)
        values = {
            c["effect"]: {n: _value(p) for n, p in c["parameters"].items()}
            for c in causes if c["effect"] in EFFECTS
        }  # fmt: skip
        sds = [{label: _sized(item["sd"]) for label, item in noise[kind].items()} for kind in KINDS]
        before = tuple(
            name for name in named if name in DATA_EFFECTS and DATA_EFFECTS[name].kind == "readings"
        )
        section = document["extended"]
        places = [_places(section[f"positions_{name}"]) for name in ("m", "sd_m")]
        if places[0].shape != places[1].shape or np.any(places[1] < 0):
            raise ValueError("no sd, of 0 or more, for each position")
        times = _sized(document["clock"]["origin_s"], -LARGEST), _sized(document["clock"]["span_s"])
    except UnicodeDecodeError as error:
        raise InputError(f"{path}: expected a diagnosis.json, found no text") from error
    except _WRONG as error:
        what = f"no {error}" if isinstance(error, KeyError) else str(error)[:80]
        raise InputError(f"{path}: expected a diagnosis.json, found {what}") from error
    for name in named:
        if name not in EFFECTS and name not in DATA_EFFECTS:
            raise InputError(
                f"{path}: expected causes that this installation knows, found {name}; is the"
                " module that defines it imported?"
            )
    return Extension(effects, values, *sds, before, times, *places)


# what a JSON of another shape makes the reading raise
_WRONG = (
    ValueError, LookupError, TypeError, AttributeError, ArithmeticError, RecursionError,
)  # fmt: skip


def _no_number(text: str):
    raise ValueError(f"{text}, which is no number")


def _sized(value, least: float = SMALLEST) -> float:
    """A number from ``least`` to `LARGEST`, or ValueError."""
    if isinstance(value, str | bool) or not least <= float(value) <= LARGEST:
        raise ValueError(f"{value!r} for a number from {least:g} to {LARGEST:g}")
    return float(value)


def _value(parameter: dict) -> tuple[float, float | None]:
    """A parameter's value and sd; None for one that is fixed."""
    sd = parameter["sd"]
    return _sized(parameter["value"], -LARGEST), None if sd is None else _sized(sd, 0.0)


def _places(rows) -> np.ndarray:
    """(A, 3) m."""
    found = np.array([[_sized(value, -LARGEST) for value in row] for row in rows])
    if found.ndim != 2 or found.shape[1] != 3:
        raise ValueError(f"positions of shape {found.shape}")
    return found


def extended_model(extension: Extension, model: ArrayModel, labels) -> ArrayModel:
    """``model`` with the extension's effects, priors, starting values and noise.

    ``labels``: of the accelerometers and of the gyroscopes. Parameters that the diagnosis fixed,
    or that belong to IMUs it found no need for, are pinned. InputError where labels differ.
    """
    named = replace(model, effects=extension.effects)
    whole = max(labels, key=len)
    start, pinned = named.join({}), np.ones(named.effect_size, bool)
    unused = {(e, n) for e, found in extension.values.items() for n in found}
    for place, (effect, name) in enumerate(parameter_ids(named, labels)):
        if name in extension.values[effect]:
            start[place], sd = extension.values[effect][name]
            pinned[place] = sd is None
            unused.discard((effect, name))
    if unused:
        raise InputError(
            f"--diagnosis: expected IMUs {', '.join(whole)} and components as in the model, found"
            f" parameters {', '.join(sorted(n for _, n in unused)[:3])}"
        )
    sd = named.effect_prior_sd
    prior = EffectPrior(
        np.where(pinned, start, 0.0), np.where(pinned, SETTINGS.pinned * sd, sd), start
    )
    declared = extension.accelerometer_sd, extension.gyroscope_sd
    sds = [_by_label(part, names) for part, names in zip(declared, labels, strict=True)]
    counts = model.array.accelerometers, model.array.gyroscopes
    noise = Noise.of(*counts, *sds)
    return replace(named, noise=noise, effect_prior=prior, clock=extension.clock)


def _by_label(sds: dict, labels) -> np.ndarray:
    missing = [label for label in labels if label not in sds]
    if missing:
        raise InputError(
            f"--diagnosis: expected the noise of IMU {missing[0]}, found {', '.join(sds)}"
        )
    return np.array([sds[label] for label in labels])


def diagnosed_estimate(path: str | Path, recording: Recording) -> Estimate:
    """The positions and parameters of a diagnosis' extended model, from its recording.

    What `diagnosis.json` itself reports, estimated again. InputError for another file, or IMUs.
    """
    extension = read_extension(Path(path))
    _, _, readings, _ = prepared(recording, sparse=True)
    origin, span = extension.clock
    since = readings.time + readings.origin - origin
    readings = replace(readings, time=since, span=span, origin=origin)
    columns = columns_of(readings.array, extension.effects, readings.position_prior_sd)
    labels = recording.accelerometer_labels, recording.gyroscope_labels
    model = extended_model(extension, columns.model, labels)
    positions = extension.positions
    if positions.shape != readings.array.positions.shape:
        raise InputError(
            f"{path}: expected positions of {readings.array.accelerometers} accelerometers, as in"
            f" the recording, found {len(positions)}"
        )
    first = start(readings, columns)
    state = first._replace(positions=positions - positions[0], parameters=model.effect_start)
    free = model.effect_prior_sd > SETTINGS.pinned * columns.model.effect_prior_sd
    active = flat_parameters(columns, state._replace(parameters=free.astype(float))) > 0
    active[:, columns.of(POSITION)] = True
    return extended_estimate(readings, columns, active & columns.owner, state)


def extended_estimate(readings: Readings, columns: Columns, active, state: State) -> Estimate:
    """The robust estimate of a diagnosis' extended model from where its search ended.

    With columns for what the model has, and for maps that first order may have left.
    """
    maps = corrected(readings.left)
    few, kept = in_use(columns, active, state, maps)
    state = from_flat(few, state, flat_parameters(columns, state)[:, kept])
    columns, active = few, active[:, kept]
    recorded = Recorded.of(most_informative(readings, lambda text: None), columns, state)
    clocked = active[:, columns.of(CLOCK)].any(axis=1) if CLOCK in columns.names else []
    imus = [int(k) for k in np.flatnonzero(clocked)]
    if imus:
        recorded = timed(recorded, recorded.readings.keep, columns, imus)
    return settled(estimate([recorded], columns, active))
