"""Every number that a diagnosis rests on and that no equation gives: value, unit, origin."""

from __future__ import annotations

from dataclasses import dataclass

from imuarray.model.effects import known_effect


@dataclass(frozen=True)
class Settings:
    """Numbers of a diagnosis; `SETTINGS` are those in use."""

    # Critical values, from simulating the whole procedure on clean recordings
    # (benchmarks/thresholds.py): all tests together give under 5 % of false alarms.
    effect: float = -7.5  # log p of an effect's best test, its IMUs and forms allowed for
    check: float = -7.5  # log p of a check of what is left
    share: float = 0.002  # of the base model's excess that a cause must explain
    explained: float = 0.99  # share of the excess from which failing checks are within tolerance
    rival: float = 3.0  # log p by which another effect may be worse and be listed beside a cause
    alike: float = 0.64  # share of an adopted effect's signal from which another is of its class

    def limit(self, effect: str) -> float:
        """Critical log p of an effect: its own, where its test has another tail."""
        own = known_effect(effect).critical
        return self.effect if own is None else own


SETTINGS = Settings()
