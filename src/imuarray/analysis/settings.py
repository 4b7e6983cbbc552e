"""Every number of the analyses that no equation gives: value, unit, origin."""

from dataclasses import dataclass


@dataclass(frozen=True)
class Settings:
    """Numbers of one recording's analyses, set by judgement; `SETTINGS` are those in use."""

    # `board`
    fewest: int = 3  # samples
    # `density`
    node_gap: float = 0.05  # nats in total, alike at all positions; finer nodes cost 27 times
    wide: float = 3.0  # prior sd of the log of a noise's and of the motion's sd: a factor of 20
    held: float = 1e-3  # of its prior's sd: the sd of a parameter that the estimate does not free
    # `logs`
    gravity_within: float = 0.1  # of 1 (g) or of 1000 (mg), by which most readings' size is told
    sure: float = 0.8  # of the rates' roughness is left at even instants; slow motion shows none
    rare: float = 0.05  # of the rows: more are no garbage
    spike: float = 60.0  # times what a triad usually departs from its neighbours, or its noise
    only: float = 3.0  # times as far as the next triad, where one alone reads garbage
    burst: tuple[int, int] = (4, 40)  # readings of one, with a neighbour at each end
    fast: float = 0.999  # quantile of the rates that is to be within their range
    near: int = 21  # readings of one log beside which garbage stands out
    spike_near: float = 12.0  # times what these depart from their neighbours
    burst_near: int = 12  # readings of one log; longer bursts may be knocks
    large: float = 0.5  # of the largest reading, from which an abrupt end is a rail and no rest
    slope_window: int = 7  # samples of the polynomial that gives the rates' derivative
    slope_order: int = 3  # its degree
    rough_fast: float = 0.5  # of the rates' rms: slower samples say little of positions
    rough_sd: float = 0.05  # of the board's size, left by gyroscopes and axes as bought
    rough_sure: float = 0.1  # of the board's size, beyond which the motion says too little
    # `noise`
    few: int = 50  # samples, up to which several searches for the mode are made
    starts: int = 8  # of them
    rounds: int = 6  # of fit and noise by turns
    enough: float = 0.02  # change of all sds that ends them
    freedom: float = 200.0  # degrees for a triad's own noise, 5 % of its sd; else one for all
    apart: tuple[int, ...] = (4, 3)  # accelerometers, gyroscopes: of fewer the noise is one
    # `sampling`
    starts_apart: float = 2.0  # posterior sds by which the starts differ
    few_effective: int = 400  # effective draws, for quantiles and R-hat (Vehtari and others, 2021)


SETTINGS = Settings()
