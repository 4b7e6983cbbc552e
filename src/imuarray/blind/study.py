"""The blind study: recordings go to a diagnosis that learns nothing else of their cases."""

import json
import time
import traceback
from collections.abc import Callable, Sequence

from imuarray.blind.cases import Case, make

# What grading reads of `diagnosis.json`; the figures' discrepancies would be most of the file.
KEPT = ("base", "inflated", "extended", "gain", "causes", "unexplained", "remaining")


def batch_of(cases: Sequence[Case], batch: int, batches: int) -> list[Case]:
    """Cases of one job out of ``batches``; dealt in turn, so that all last about as long."""
    if not 0 <= batch < batches:
        raise ValueError(f"batch: expected 0 to {batches - 1}, found {batch}")
    return list(cases[batch::batches])


def ask(diagnose: Callable, recording, without, seed: int) -> dict:
    """The diagnosis of a recording: the entries `KEPT` of its `diagnosis.json`.

    Raises ValueError where they are not plain JSON, KeyError where one is missing.
    """
    document = diagnose(recording, seed=seed, without=without).document
    kept = {name: document[name] for name in KEPT}
    return json.loads(json.dumps(kept, allow_nan=False))


def diagnosed(case: Case, seed: int, diagnose: Callable) -> dict:
    """A case's truth and its diagnosis, made without the truth.

    Parameters
    ----------
    case, seed : as for `make`
    diagnose : callable (recording, seed, without) -> object with attribute ``document``

    Returns
    -------
    dict
        ``case`` (id), ``truth`` (see `make`), ``diagnosis`` (see `ask`; None after a crash),
        ``error`` (text of a crash, or None); ``seconds`` of wall time and ``cpu_seconds`` of all
        threads that it took.
    """
    recording, truth = make(case, seed)
    answer, error = None, None
    start, cpu_start = time.perf_counter(), time.process_time()
    try:
        answer = ask(diagnose, recording, case.struck, seed)
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
