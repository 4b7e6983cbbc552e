"""Every number of the analyses that no equation gives: value, unit, origin."""

from dataclasses import dataclass


@dataclass(frozen=True)
class Settings:
    """Numbers of one recording's analyses, set by judgement; `SETTINGS` are those in use."""

    # `board`
    fewest: int = 3  # samples

    # `density`
    # nats in total, nearly the same at all positions: finer nodes would cost 27 times
    node_gap: float = 0.05
    # prior sd of the log of a noise's sd, and of the motion's: a factor of twenty
    wide: float = 3.0
    held: float = 1e-3  # of its prior's sd: the sd of a parameter that the estimate does not free
    few: int = 50  # samples, up to which several searches for the mode are made
    starts: int = 8  # of them

    # `logs`
    gravity_within: float = 0.1  # of 1 (g) or of 1000 (mg), by which most readings' size is told
    # of the rates' roughness is left at even instants; a motion too slow shows nothing
    sure: float = 0.8
    rare: float = 0.05  # of the rows: more are no garbage
    # times what a triad usually departs from its neighbours in time, or its noise
    spike: float = 60.0
    large: float = 0.5  # of the largest reading, from which an abrupt end is a rail and no rest

    # `noise`
    rounds: int = 6  # of fit and noise by turns
    enough: float = 0.02  # change of all sds that ends them
    # degrees that a triad's own noise takes, 5 % of its sd; with fewer they share one
    freedom: float = 200.0
    # accelerometers, gyroscopes: fewer cannot be told apart, either
    apart: tuple[int, ...] = (4, 3)

    # `sampling`
    starts_apart: float = 2.0  # posterior sds by which the starts differ
    # effective draws; fewer tell neither quantiles nor R-hat (Vehtari and others, 2021)
    few_effective: int = 400


SETTINGS = Settings()
