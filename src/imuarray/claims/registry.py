"""The list of claims (`register.yaml`) and the functions that judge them."""

from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import NamedTuple

import pandas as pd
import yaml

from imuarray.claims.numbers import show

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


def claim(id: str, **given):
    """Make the decorated ``test(results, **given) -> Outcome`` judge a claim of the register.

    Raises ValueError for a claim that is judged already, KeyError for one not in the register.
    """

    def register(test):
        if id in CLAIMS:
            raise ValueError(f"claim {id} is there already")
        if id not in REGISTER:
            raise KeyError(id)
        CLAIMS[id] = partial(test, **given)
        return test

    return register


def judged(value: str | float, error: str | float, stands: bool, remark: str = "") -> Outcome:
    """The outcome of a claim that can be tested; numbers get three digits, errors two."""
    value = value if isinstance(value, str) else show(value)
    error = error if isinstance(error, str) else show(error, 2)
    return Outcome(value, error, HOLDS if stands else FAILS, remark)


def untested(reason: str, value: str = "", error: str = "") -> Outcome:
    """The outcome of a claim that needs what is not here."""
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
