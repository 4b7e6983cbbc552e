"""Every number of the studies that no paper gives: value, unit, origin."""

from dataclasses import dataclass


@dataclass(frozen=True)
class Settings:
    """Numbers of the studies, set by judgement; `SETTINGS` are those in use."""

    # `bound`
    near: float = 1.01  # times the bound: as good as efficient
    bcd_limit: int = 20000  # iterations after which ML-BCD is given up
    patience: int = 400  # iterations of Gauss-Newton where noise is large
    scoring_limit: int = 10  # and Gauss-Newton is
    rank: float = 1e-10  # of the largest eigenvalue of the scaled information
    repeats: int = 20  # motions averaged over; the bound varies little between them
    # `sbc`
    draws: int = 199  # kept of each posterior, nearly independent
    apart: float = 2.0  # posterior sds by which chains start off the mode
    warmup: int = 200  # transitions of NUTS
    spacing: int = 4  # its transitions from one kept draw to the next
    pilot: int = 20000  # transitions of PmMH at a time
    pilot_effective: int = 200  # until so many are effective
    # of them, after which that is looked at
    blocks: tuple[int, ...] = (1, 2, 5, 10, 20, 50, 100, 200, 500)
    burn_in: int = 600  # draws
    first: int = 100  # transitions between them at least
    tiny: float = 1e-12
    ml_more: int = 25  # times as many truths as for samplers, as they cost so little
    rate: float = 1e9  # samples a second: instants tell the model nothing
    beyond: float = 1e6  # m/s^2, rad/s: a rail that nothing reaches
    # `truths`
    starts: int = 50  # of the search for a mode
    good: float = 2.0  # mean square of residuals that ends it
    spare: int = 2**40  # a replicate that no study counts: for pilots
    batch: int = 25  # realisations, a random stream for each batch: results hang on it


SETTINGS = Settings()
