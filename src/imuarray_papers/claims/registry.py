"""The list of claims (`register.yaml`), the functions that judge them, and all of it as a page."""

from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import NamedTuple

import pandas as pd
import yaml

from imuarray_papers.claims.numbers import show

HOLDS, FAILS, UNTESTED = "holds", "does not hold", "cannot be tested here"
CLOCK = "seconds: timing.csv beside this scale's claims in results/"
VERDICTS = (HOLDS, FAILS, UNTESTED)
REGISTER = yaml.safe_load(Path(__file__).with_name("register.yaml").read_text(encoding="utf-8"))


class Outcome(NamedTuple):
    """Our value, its Monte Carlo error, the verdict and what else is worth saying."""

    value: str
    error: str
    verdict: str
    remark: str = ""


CLAIMS: dict[str, Callable] = {}  # by id, the function of the results that judges it


def claim(id: str, *sources: str, **given):
    """Make the decorated function, which returns an `Outcome`, judge a claim of the register.

    It is called with the results, or with what `Results.source` reads of its ``sources``, and with
    ``given``. Raises ValueError for a claim that is judged already, KeyError for one not in the
    register.
    """

    def register(test):
        if id in CLAIMS:
            raise ValueError(f"claim {id} is there already")
        if id not in REGISTER:
            raise KeyError(id)
        CLAIMS[id] = partial(_judged, id, test, sources, given)
        return test

    return register


class Missing(Exception):
    """Raised, with the claim's outcome, where a claim needs results that are not here."""


def _judged(id, test, sources, given, results) -> Outcome:
    try:
        outcome = test(*(map(results.source, sources) if sources else [results]), **given)
    except Missing as missing:
        outcome = missing.args[0]
    return outcome._replace(remark=outcome.remark or REGISTER[id].get("remark", ""))


def verdict(value: str | float, error: str | float, stands: bool, remark: str = "") -> Outcome:
    """The outcome of a claim that can be tested; numbers get three digits, errors two."""
    value = value if isinstance(value, str) else show(value)
    error = error if isinstance(error, str) else show(error, 2)
    return Outcome(value, error, HOLDS if stands else FAILS, remark)


def untested(reason: str = "", value: str = "", error: str = "") -> Outcome:
    """The outcome of a claim that needs what is not here; the ``reason`` is a remark, too."""
    return Outcome(value, error, UNTESTED, reason)


def evaluate(results) -> pd.DataFrame:
    """One row for each claim, in the order of the ids."""
    rows = []
    for id, test in sorted(CLAIMS.items()):
        item, outcome = REGISTER[id], test(results)
        rows.append({
            "id": id, "paper": id.split("-")[0], "section": item["section"],
            "claim": item["text"], "paper_value": item["paper_value"],
            "our_value": outcome.value, "our_error": outcome.error,
            "criterion": item["criterion"], "verdict": outcome.verdict,
            "remark": outcome.remark, "rests_on": "clock" if item.get("clock") else "seed",
        })  # fmt: skip
    return pd.DataFrame(rows)


TITLES = {
    "2017": "On-the-fly geometric calibration of inertial sensor arrays (2017)",
    "2021": "Quantifying the uncertainty of the relative geometry in inertial sensor arrays (2021)",
}
COLUMNS = {
    "id": "Id", "section": "Section", "claim": "Claim", "paper_value": "Paper",
    "our_value": "Ours", "our_error": "Monte Carlo error", "criterion": "Stands if",
    "verdict": "Verdict", "remark": "Remark",
}  # fmt: skip


def _rows(frame: pd.DataFrame, header) -> list[str]:
    lines = ["| " + " | ".join(header) + " |", "|" + " --- |" * len(header)]
    cells = frame.map(lambda value: " ".join(str(value).split()).replace("|", "\\|"))
    return lines + ["| " + " | ".join(row) + " |" for row in cells.to_numpy()]


def markdown(table: pd.DataFrame, settings: dict) -> str:
    """A table for each paper with the counts, the scale and the seed above them."""
    scale, seed = settings["scale"]["name"], settings["seed"]
    clock = ", ".join(table.id[table.rests_on == "clock"])
    lines = [
        "# The papers' claims", "",
        f"Scale `{scale}`, seed {seed}. Every verdict is computed from the result files of this"
        " scale; errors are Monte Carlo standard errors. The tables and the plotted values of the"
        " papers are not in their text, so only what the text says is compared.",
        f"Ratios of clock times, with room for any machine: {clock}.", "",
    ]  # fmt: skip
    counts = pd.crosstab(table.paper, table.verdict).reindex(columns=VERDICTS, fill_value=0)
    lines += _rows(counts.reset_index(), ["Paper", *VERDICTS])
    for paper, title in TITLES.items():
        lines += ["", f"## {title}", ""]
        lines += _rows(table.loc[table.paper == paper, list(COLUMNS)], COLUMNS.values())
    return "\n".join(lines) + "\n"
