"""Backward elimination: adopted effects tested against zero, and on held-out time."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from imuarray.diagnosis.settings import SETTINGS
from imuarray.diagnosis.state import Search
from imuarray.engine.fit import flat_parameters, from_flat
from imuarray.engine.heldout import gain_of, normal_blocks
from imuarray.engine.parameters import prior_precision
from imuarray.tails import log_chi_square


def freed_places(search: Search, effect: str, imus=None, among=None) -> np.ndarray:
    """Places of an adopted effect's free parameters, of some of its IMUs or ``among`` columns."""
    mask = search.active.copy()
    chosen = search.columns.of(effect) if among is None else among
    others = np.setdiff1d(np.arange(search.columns.size), chosen)
    mask[:, others] = False
    if imus is not None:
        mask[np.setdiff1d(np.arange(len(mask)), imus)] = False
    return search.given.places(mask)


def need(search: Search, effect: str, imus=None, among=None) -> tuple[float, int]:
    """(chi-square, degrees of freedom) of an adopted effect against zero, all else refitted."""
    freed = freed_places(search, effect, imus, among)
    active = np.setdiff1d(search.given.places(search.active), freed)
    conditional = search.given.conditional(active, freed, freed)
    return search.given.test(conditional, freed)


def heldout_gain(search: Search, effect: str, parts=None) -> tuple[float, float]:
    """Nats gained on held-out blocks of time by an adopted effect, with standard error.

    ``parts``: the blocks' equations, if they are known.
    """
    columns, mask = search.columns, search.active
    freed = np.isin(columns.names, effect) & mask
    values = flat_parameters(columns, search.fit.state)[mask]
    parts = normal_blocks(search.fit, mask) if parts is None else parts
    return gain_of(parts, prior_precision(columns, mask), values, freed[mask])


def prune(search: Search, effect: str) -> Search:
    """Of an effect adopted for many IMUs, keep those that need it, where they are the fewer."""
    imus = search.imus_with(effect)
    if len(imus) < 3:
        return search
    limit = SETTINGS.limit(effect)
    keep = tuple(k for k in imus if needed(search, effect, limit - np.log(len(imus)), [k]))
    rest = [imu for imu in imus if imu not in keep]
    if not keep or len(keep) > len(imus) / 2 or needed(search, effect, SETTINGS.others, rest):
        return search
    causes = tuple(
        replace(cause, imus=keep) if cause.effect == effect else cause for cause in search.causes
    )
    search = replace(search, causes=causes)
    state = search.started(effect)
    whole = flat_parameters(search.columns, state)
    whole[np.ix_(rest, search.columns.of(effect))] = 0.0
    return search.refit(from_flat(search.columns, state, whole))


def needed(search: Search, effect: str, limit: float, imus=None) -> bool:
    """Whether an adopted effect is significant beside all else."""
    statistic, freedom = need(search, effect, imus)
    return bool(freedom) and log_chi_square(statistic, freedom) < limit


def eliminate(search: Search, others=()) -> Search:
    """Causes that are not needed beside each other and the ``others`` go, one after the other."""
    for cause in search.causes:
        small = need(search, cause.effect)[0] < search.least
        beside = len(search.causes) + len(others) > 1
        limit = SETTINGS.limit(cause.effect, beside) - beside * cause.tries
        if small or not needed(search, cause.effect, limit):
            search.say(f"dropped {cause.effect}: not needed beside the others")
            rest = tuple(other for other in search.causes if other.effect != cause.effect)
            search = replace(search, causes=rest)
            search = search.refit(search.started())
    return search
