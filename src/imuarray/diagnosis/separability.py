"""Which effects a recording can tell apart: canonical correlations of their signals."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from imuarray.diagnosis.fit import Fit
from imuarray.diagnosis.parameters import POSITION
from imuarray.diagnosis.scores import Candidate, Information, able, mask_of, robust_inverse
from imuarray.model import EFFECTS

# Share of its own information that a combination of parameters must keep to count. What keeps less
# is a gauge of motion and positions, and no data tell what else it resembles.
VISIBLE = 1e-3


@dataclass(frozen=True)
class Separability:
    """Squared canonical correlations between effects, motion and positions projected out.

    Attributes
    ----------
    effects : n effect ids
    largest : (n, n) of the two most alike forms of two effects; 1 is an exact gauge in one form
    mean : (n, n) mean over the forms of the smaller effect; 1 where it is contained in the other
    """

    effects: tuple[str, ...]
    largest: np.ndarray
    mean: np.ndarray


def separability(given: Information, fit: Fit, adopted=()) -> Separability:
    """How alike the effects are on this recording, each on all IMUs that can have it.

    ``given`` is the `Information` at ``fit``, ``adopted`` its causes, as (effect, imus) pairs.
    Effects that only a scan sees (a clock, a step) have a direction once they are adopted, on the
    IMUs that have them; else they are left out.
    """
    place = np.zeros_like(fit.active)
    place[:, fit.columns.of(POSITION)] = True
    left = conditional(given, given.places(place & fit.columns.owner))
    imus = dict(adopted)
    bases = {}
    for effect in fit.columns.model.effects:
        if EFFECTS[effect].scanned and effect not in imus:
            continue
        whose = imus[effect] if EFFECTS[effect].scanned else range(len(fit.columns.owner))
        mask = mask_of(fit.columns, Candidate(effect, tuple(whose)))
        chosen = given.places(mask & able(fit.readings.exists, effect)[:, None])
        basis = orthonormal(left, chosen, given.scale[chosen])
        if basis.shape[1]:
            bases[effect] = chosen, basis
    squares = {(a, b): squared_correlations(left, bases[a], bases[b]) for a in bases for b in bases}
    shape = (len(bases), len(bases))
    return Separability(
        tuple(bases),
        np.array([found.max() for found in squares.values()]).reshape(shape),
        np.array([found.mean() for found in squares.values()]).reshape(shape),
    )


def conditional(given: Information, known) -> np.ndarray:
    """Information (K, K) on all parameters when those at ``known`` are refitted to any change.

    Their own prior alone holds them: no gauge is pinned, whatever the fit did.
    """
    cross = given.information[:, known]
    inner = cross[known] + np.diag(given.ridge[known])
    return given.information - cross @ robust_inverse(inner) @ cross.T


def orthonormal(information, chosen, scale) -> np.ndarray:
    """(n, d) combinations of the n chosen parameters whose signals are orthonormal.

    Combinations that the projection leaves less than `VISIBLE` of are left out.
    """
    block = information[np.ix_(chosen, chosen)] / np.outer(scale, scale)
    values, vectors = np.linalg.eigh(block)
    seen = values > VISIBLE
    return vectors[:, seen] / np.sqrt(values[seen]) / scale[:, None]


def squared_correlations(information, one, other) -> np.ndarray:
    """Squared canonical correlations of two sets, each (places, basis): of the smaller's size."""
    (rows, left), (columns, right) = one, other
    cross = left.T @ information[np.ix_(rows, columns)] @ right
    return np.clip(np.linalg.svd(cross, compute_uv=False) ** 2, 0.0, 1.0)
