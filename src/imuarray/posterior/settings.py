"""Every number of the samplers that no equation gives: value, unit, origin."""

from dataclasses import dataclass


@dataclass(frozen=True)
class Settings:
    """Numbers of the samplers, set by judgement; `SETTINGS` are those in use."""

    # `diagnostics`
    burn_in_noise: float = 0.1  # of an effective sample size, from one burn-in to another
    rhat: float = 1.01  # largest R-hat that a sampler aims at
    effective: int = 1000  # smallest effective size
    # `generic`
    laplace_steps: int = 3  # of Gauss-Newton
    chunk: int = 1000  # samples whose densities are in memory at a time, with their derivatives
    # `independent`
    chains: int = 4
    batch: int = 400  # proposals of a chain at a time
    batches: int = 10  # of them at most
    block: int = 50  # densities that one call evaluates
    pilot: int = 200  # draws that look for the centre
    rounds: int = 5  # of looking
    observed: float = 4.0  # standard errors by which it is off, at which it is moved
    unreliable: float = 0.7  # of Pareto's k: above, the normal says nothing of the tails
    # `marginal`
    node_error: float = 1e-4  # nats in total from one count to the next: then the former is taken
    newton: int = 6  # steps to the mode at most, from where it is at the reference positions
    near: float = 1e-4  # sds: a step as short is the last, the next would be its square


SETTINGS = Settings()
