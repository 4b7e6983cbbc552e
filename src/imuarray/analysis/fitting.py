"""A board's recordings under any model but the papers', by the engine."""

from collections.abc import Sequence

from imuarray.analysis.model import Say
from imuarray.engine.estimate import Estimate
from imuarray.engine.ladder import Rung, climb, rungs_of, with_effects
from imuarray.engine.readings import Readings, arrange, determined, most_informative
from imuarray.recording import Recording


def fitted(
    recordings: Sequence[Recording], model: str, effects: Sequence[str], say: Say
) -> tuple[Estimate, list[Rung]]:
    """(estimate, the ladder's rungs) under a diagnosis.json, ``effects``, or the sensor model."""
    if model.endswith(".json"):
        from imuarray.diagnosis.extension import diagnosed_estimate

        return diagnosed_estimate(model, recordings[0]), []
    readings = _arranged(recordings, say)
    if effects:
        return with_effects(readings, effects), []
    found, rungs = climb(readings)
    _tell(rungs, say)
    return found, rungs


def fitted_beyond(
    recording: Recording, model: str, effects: Sequence[str], say: Say
) -> Estimate | None:
    """The same of one recording, None where no more than positions and motion are in the model."""
    if model.endswith(".json") or effects:
        return fitted([recording], model, effects, say)[0]
    readings = _arranged([recording], say)
    if not rungs_of(readings):
        return None
    found, rungs = climb(readings, bare=False)
    _tell(rungs, say)
    return found if any(rung.kept for rung in rungs) else None


def _arranged(recordings, say: Say) -> list[Readings]:
    arranged = [arrange(one, sparse=True) for one in recordings]
    whole = [one.select(determined(one, 1)) for one in arranged]
    return [most_informative(one, say) for one in whole]


def _tell(rungs: Sequence[Rung], say: Say) -> None:
    for rung in rungs:
        verdict = "kept" if rung.kept else "left out"
        say(f"{rung.name}: {verdict}, {rung.gain:.3g} ({rung.error:.2g}) nats on held-out time")
