"""The list of claims and how one is put on it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import pandas as pd

HOLDS, FAILS, UNTESTED = "holds", "does not hold", "cannot be tested here"
VERDICTS = (HOLDS, FAILS, UNTESTED)


class Outcome(NamedTuple):
    """Our value, its Monte Carlo error, the verdict and what else is worth saying."""

    value: str
    error: str
    verdict: str
    remark: str = ""


@dataclass(frozen=True)
class Claim:
    """One claim: what the paper says, when we let it stand, and the function that judges it.

    ``clock`` marks claims that rest on clock times, which no seed reproduces.
    """

    id: str
    section: str
    text: str
    paper_value: str
    criterion: str
    test: Callable
    clock: bool = False

    @property
    def paper(self) -> str:
        """ "2017" or "2021"."""
        return self.id.split("-")[0]


CLAIMS: dict[str, Claim] = {}


def claim(id, section, text, paper_value, criterion, clock=False):
    """Register the decorated ``test(results) -> Outcome`` as the claim ``id``."""

    def register(test):
        if id in CLAIMS:
            raise ValueError(f"claim {id} is there already")
        CLAIMS[id] = Claim(id, section, text, paper_value, criterion, test, clock)
        return test

    return register


def judge(stands: bool) -> str:
    """The verdict of a claim that can be tested."""
    return HOLDS if stands else FAILS


def untested(reason: str, value: str = "", error: str = "") -> Outcome:
    """The outcome of a claim that needs what is not here."""
    return Outcome(value, error, UNTESTED, reason)


def evaluate(results) -> pd.DataFrame:
    """One row for each claim, in the order of the ids."""
    rows = []
    for item in sorted(CLAIMS.values(), key=lambda item: item.id):
        outcome = item.test(results)
        rows.append(
            {
                "id": item.id,
                "paper": item.paper,
                "section": item.section,
                "claim": item.text,
                "paper_value": item.paper_value,
                "our_value": outcome.value,
                "our_error": outcome.error,
                "criterion": item.criterion,
                "verdict": outcome.verdict,
                "remark": outcome.remark,
                "rests_on": "clock" if item.clock else "seed",
            }  # fmt: skip
        )
    return pd.DataFrame(rows)
