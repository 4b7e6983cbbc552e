"""The blind study: recordings go to a diagnosis that learns nothing else of their cases; grades.

An effect is *found* if its id is named or in ``indistinguishable_from`` of a named one: the answer
is then the class. A *wrong name* is a named effect that is not in the truth and whose class holds
no effect of the truth. Whether the right sensors are named counts apart.
"""

import json
import time
import traceback
from collections.abc import Callable, Sequence
from itertools import permutations

import numpy as np

from imuarray_papers.blind.cases import Case, make

# What grading reads of `diagnosis.json`; the figures' discrepancies would be most of the file.
KEPT = ("extended", "causes", "unexplained")
QUANTILE = 1.96  # of the normal law, for 95 % intervals


def batch_of(cases: Sequence[Case], batch: int, batches: int) -> list[Case]:
    """Cases of one job out of ``batches``; dealt in turn, so that all last about as long."""
    if not 0 <= batch < batches:
        raise ValueError(f"batch: expected 0 to {batches - 1}, found {batch}")
    return list(cases[batch::batches])


def diagnosed(case: Case, seed: int, diagnose: Callable) -> dict:
    """A case's truth and its diagnosis, made without the truth.

    Parameters
    ----------
    case, seed : as for `make`
    diagnose : callable (recording, seed, without) -> object with attribute ``document``

    Returns
    -------
    dict
        ``case`` (id), ``truth`` (see `make`), ``diagnosis`` (the entries `KEPT`; None after a
        crash, as which counts that one is missing or not plain JSON), ``error`` (text of a crash,
        or None); ``seconds`` of wall time and ``cpu_seconds`` of all threads that it took.
    """
    recording, truth = make(case, seed)
    answer, error = None, None
    start, cpu_start = time.perf_counter(), time.process_time()
    try:
        document = diagnose(recording, seed=seed, without=case.struck).document
        kept = {name: document[name] for name in KEPT}
        answer = json.loads(json.dumps(kept, allow_nan=False))
    except Exception as crash:  # whatever it is, it is a result of the study
        error = f"{type(crash).__name__}: {crash}"
        traceback.print_exc()
    return {
        "case": case.id,
        "truth": truth,
        "diagnosis": answer,
        "error": error,
        "seconds": time.perf_counter() - start,
        "cpu_seconds": time.process_time() - cpu_start,
    }


def classes(causes: list[dict]) -> dict[str, set[str]]:
    """By named effect, the effects that the name stands for: itself and what it might be too."""
    found: dict[str, set[str]] = {}
    for cause in causes:
        found.setdefault(cause["effect"], {cause["effect"]}).update(cause["indistinguishable_from"])
    return found


def sensors_of(sensors, imus: int) -> frozenset[str]:
    """Sensors to be compared: all of them are "all", however they are listed."""
    found = frozenset(map(str, sensors))
    return frozenset({"all"}) if "all" in found or len(found) == imus else found


def right_set(wanted: list[str], named: dict[str, set[str]]) -> bool:
    """True where each effect of the truth has a cause of its own and none is left over."""
    if len(wanted) != len(named):
        return False
    return any(
        all(effect in named[name] for effect, name in zip(wanted, order, strict=True))
        for order in permutations(named)
    )


def grade(entry: dict) -> dict:
    """The graded row of a case; ``entry`` as `diagnosed` returns it.

    Returns
    -------
    dict
        ``case``, ``kind``, ``imus``, ``sampling_rate`` (Hz), ``duration`` (s), ``rails``,
        ``sigma`` and ``sigma_exact`` (of all effects); ``truth``: for each effect sensors, sizes,
        and ``found`` (by class), ``named`` (itself), ``sensors_right``; ``causes``: the named ones
        with sensors and class; ``wrong_names``, ``right_set``, ``confident``, ``unexplained``;
        ``extended``: the `accuracy` of its model; ``seconds``, ``cpu_seconds``; ``crash``,
        ``error``. After a crash the diagnosis has said nothing.
    """
    truth, answer = entry["truth"], entry["diagnosis"]
    case, lost = truth["case"], answer is None
    causes = [] if lost else answer["causes"]
    unexplained = None if lost else bool(answer["unexplained"])
    wanted, named = [effect["effect"] for effect in truth["effects"]], classes(causes)
    # Without reserve: for gauges a class is reserve enough; for what the catalogue does not hold
    # only ``unexplained`` is.
    firm = [c for c in causes if case["kind"] != "gauge" or not c["indistinguishable_from"]]
    keys = ("effect", "sensors", "indistinguishable_from")
    row = {name: case[name] for name in ("kind", "imus", "sampling_rate", "duration", "rails")}
    row |= {name: truth[name] for name in ("sigma", "sigma_exact")}
    row |= {name: entry[name] for name in ("case", "seconds", "cpu_seconds", "error")}
    return row | {
        "truth": [_effect_in_row(effect, causes, case["imus"]) for effect in truth["effects"]],
        "causes": [{key: cause[key] for key in keys} for cause in causes],
        "wrong_names": [name for name, known in named.items() if not known & set(wanted)],
        "right_set": not lost and right_set(wanted, named),
        "confident": bool(firm) and not unexplained,
        "unexplained": unexplained,
        "crash": lost,
        "extended": None if lost else accuracy(answer["extended"], truth["positions_m"]),
    }  # fmt: skip


def _effect_in_row(effect: dict, causes: list[dict], imus: int) -> dict:
    """An effect of the truth: what it is; and found, named itself, on the right sensors or not."""
    row = {name: effect[name] for name in ("effect", "sensors", "sigma", "sigma_exact")}
    name = effect["effect"]
    of_it = [c for c in causes if name in (c["effect"], *c["indistinguishable_from"])]
    itself = [c for c in of_it if c["effect"] == name]
    # named twice, it is on all the sensors named
    named = sensors_of({s for cause in itself or of_it for s in cause["sensors"]}, imus)
    right = bool(of_it) and named == sensors_of(effect["sensors"], imus)
    return row | {"found": bool(of_it), "named": bool(itself), "sensors_right": right}


def accuracy(model: dict, positions) -> dict:
    """Positions against the true ones (A, 3) m, relative to the first triad.

    ``position_rmse_m`` over the 3 (A - 1) ``coordinates``, and how many of their 95 % intervals
    have ``covered`` the truth; an sd that is missing covers nothing.
    """
    found, sd = (np.asarray(model[key], float) for key in ("positions_m", "positions_sd_m"))
    truth = np.asarray(positions, float)
    if found.shape != truth.shape or sd.shape != truth.shape:
        raise ValueError(
            f"positions: expected shape {truth.shape}, found {found.shape} and {sd.shape}"
        )
    error = (found - found[0] - truth + truth[0])[1:]
    return {
        "position_rmse_m": float(np.sqrt(np.mean(error**2))),
        "covered": int(np.sum(np.abs(error) <= QUANTILE * sd[1:])),
        "coordinates": error.size,
    }
