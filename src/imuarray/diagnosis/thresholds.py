"""Critical values, from simulating the whole procedure on clean recordings."""

from __future__ import annotations

import json
from dataclasses import dataclass
from functools import cache
from importlib import resources


@dataclass(frozen=True)
class Thresholds:
    """When a test is believed; `thresholds.json` and its maker say where from.

    Attributes
    ----------
    effect : log p of an effect's best test (its IMUs and forms allowed for)
    special : the same for single effects whose tests have other tails
    check : log p of a check of what is left
    share : of the base model's excess that a cause must explain
    explained : share of the excess from which failing checks are forgiven
    rival : by how much (log p) another effect may be worse and still be listed beside a cause
    alike : share of an adopted effect's signal from which another one is of its class
    """

    effect: float
    special: dict
    check: float
    share: float
    explained: float
    rival: float
    alike: float

    def limit(self, effect: str) -> float:
        """Critical log p of an effect."""
        return self.special.get(effect, self.effect)


@cache
def read_thresholds() -> Thresholds:
    """The thresholds of this version."""
    text = resources.files("imuarray.diagnosis").joinpath("thresholds.json").read_text()
    known = Thresholds.__dataclass_fields__
    return Thresholds(**{k: v for k, v in json.loads(text).items() if k in known})
