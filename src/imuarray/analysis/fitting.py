"""A board's recordings under any model but the papers', by the engine."""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager

import numpy as np

from imuarray.analysis.model import Say
from imuarray.engine.estimate import Estimate
from imuarray.engine.ladder import Rung, climb, rungs_of, with_effects
from imuarray.engine.readings import Readings, arrange, determined, most_informative
from imuarray.errors import InputError, one_line
from imuarray.recording import Recording


def fitted(
    recordings: Sequence[Recording], model: str, effects: Sequence[str], say: Say
) -> tuple[Estimate, list[Rung]]:
    """(estimate, the ladder's rungs) under a diagnosis.json, ``effects``, or the sensor model.

    InputError where no model of the kind is near the readings.
    """
    if model.endswith(".json"):
        from imuarray.diagnosis.extension import diagnosed_estimate

        with _near_the_model():
            return diagnosed_estimate(model, recordings[0]), []
    readings = _arranged(recordings, say)
    with _near_the_model():
        if effects:
            return with_effects(readings, effects), []
        found, rungs = climb(readings)
    _tell(rungs, say)
    return found, rungs


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
    """The same of one recording, None where no more than positions and motion are in the model."""
    if model.endswith(".json") or effects:
        return fitted([recording], model, effects, say)[0]
    readings = _arranged([recording], say)
    if not rungs_of(readings):
        return None
    with _near_the_model():
        found, rungs = climb(readings, bare=False)
    _tell(rungs, say)
    return found if any(rung.kept for rung in rungs) else None


def _arranged(recordings, say: Say) -> list[Readings]:
    arranged = [arrange(one, sparse=True) for one in recordings]
    found = [most_informative(one.select(determined(one, 1)), say) for one in arranged]
    for recording, one in zip(recordings, found, strict=True):
        if not len(one.time):
            rate = 1 / np.median(np.diff(recording.time)) if len(recording.time) > 1 else 0.0
            raise InputError(
                f"recording: expected samples that determine the motion, found none, at {rate:.4g}"
                " samples a second; is the unit of time right?"
            )
    return found


def _tell(rungs: Sequence[Rung], say: Say) -> None:
    for rung in rungs:
        verdict = "kept" if rung.kept else "left out"
        say(f"{rung.name}: {verdict}, {rung.gain:.3g} ({rung.error:.2g}) nats on held-out time")
