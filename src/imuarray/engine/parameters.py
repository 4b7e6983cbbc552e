"""Columns of an IMU's derivative block: which parameter is which, where it lives, its prior.

Every parameter of the model, positions included, belongs to one IMU, and concerns its readings
alone. So the derivative of a sample by all parameters is a block per IMU, (N, 6, m).

Directions that no recording determines, because the model's own freedom takes them up, are pinned:
a common scale of all gyroscopes is a dilation of the array, for instance. Left to their priors such
directions wander as soon as anything else is misfitted; pinned they stay where the effect has no
common part, and the reported sds say what the priors leave open.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Self

import numpy as np

from imuarray.engine.settings import SETTINGS
from imuarray.geometry import Array
from imuarray.model import EFFECTS, ArrayModel
from imuarray.model.effects import Effect
from imuarray.model.noise import Noise
from imuarray.recording import Recording, array_of

POSITION = "position"


@dataclass(frozen=True)
class Columns:
    """The m columns of an IMU's block: ``names`` (m,) the effect of each, ``places`` (m,) where.

    ``owner`` (N, m) says which IMUs have the parameter. ``prior_sd`` (m,) of each IMU's own,
    ``common_sd`` (m,) of what they all share.
    """

    model: ArrayModel
    names: tuple[str, ...]
    places: tuple[tuple[int, ...], ...]
    owner: np.ndarray
    prior_sd: np.ndarray
    common_sd: np.ndarray

    def of(self, effect: str) -> np.ndarray:
        """The columns of an effect (or of the positions)."""
        return np.flatnonzero([name == effect for name in self.names])

    def mask(self, effects, imus=None) -> np.ndarray:
        """(N, m) bool of the parameters of some effects, or the positions; of all IMUs or some."""
        own = np.isin(self.names, list(effects)) & self.owner
        return own if imus is None else own & np.isin(np.arange(len(own)), list(imus))[:, None]

    @property
    def usual_sd(self) -> np.ndarray:
        """`prior_sd` (m,) before any size was estimated."""
        return columns_of(self.model.array, self.model.effects, self.prior_sd[0]).prior_sd

    @property
    def size(self) -> int:
        """m."""
        return len(self.names)

    def flat(self, state) -> np.ndarray:
        """Positions and effect parameters by IMU and column, (N, m); zero where there is none."""
        count = self.owner.shape[0]
        out = np.zeros((count, self.size))
        out[: len(state.positions), self.of(POSITION)] = state.positions
        values = self.model.split(state.parameters)
        for name, value in values.items():
            rows = np.asarray(value).reshape(len(value), -1)
            out[: len(rows), self.of(name)] = rows
        return out

    def unflat(self, state, whole):
        """The inverse of `flat`: a state with the parameters ``whole`` (N, m)."""
        model = self.model
        shapes = {e.id: s for e, s in zip(model.chain, model.shapes, strict=True)}
        values = {n: whole[: s[0], self.of(n)].reshape(s) for n, s in shapes.items()}
        positions = whole[: len(state.positions), self.of(POSITION)]
        return state._replace(positions=positions, parameters=self.model.join(values))

    def prior_means(self) -> np.ndarray:
        """(N, m): nominal positions, no effect."""
        out = np.zeros(self.owner.shape)
        nominal = self.model.array.relative
        out[: len(nominal), self.of(POSITION)] = nominal
        return out

    def in_use(self, active, state, also=()) -> tuple[Self, np.ndarray]:
        """Columns of the effects that are active or not zero, or in ``also``; (m,) bool, which."""
        used = (active | (self.flat(state) != 0)).any(axis=0)
        names = {name for name, one in zip(self.names, used, strict=True) if one} | {*also}
        kept = np.isin(self.names, [POSITION, *names])
        effects = [name for name in self.model.effects if name in names]
        few = columns_of(self.model.array, effects, self.prior_sd[0])
        return replace(few, prior_sd=self.prior_sd[kept]), kept

    def movable(self, active, states) -> np.ndarray:
        """The active parameters (N, m) less those held where gyroscopes' turning is free."""
        if not any(state.gyroscopes_free for state in states):
            return active
        found = active.copy()
        for item in self.model.chain:
            found[:, self.of(item.id)[list(item.held_rough)]] = False
        return found

    def prior_precision(self, active, resized: bool = True) -> np.ndarray:
        """(n, n) precision of the active parameters (N, m): their priors, and the pinned gauges.

        ``resized``: whether those that the array's size takes up are pinned, too.
        """
        sds = np.broadcast_to(self.prior_sd, active.shape)[active]
        precision = np.diag(1.0 / sds**2)
        column, common = np.nonzero(active)[1], self.common_sd[np.nonzero(active)[1]]
        alike = (column[:, None] == column) & (common > 0)
        for mine in np.unique(alike[common > 0], axis=0):
            # own variance of each, and a common one: Sherman and Morrison
            own, shared = sds[mine][0] ** 2, common[mine][0] ** 2
            precision[np.ix_(mine, mine)] -= shared / own / (own + mine.sum() * shared)
        for effect, mask in self.gauges(active):
            if effect.resizes and not resized:
                continue
            along = mask[active].astype(float)
            along /= np.abs(along).sum() * SETTINGS.stiff * sds[along != 0].mean()
            precision += np.outer(along, along)
        return precision

    def gauges(self, active) -> list[tuple[Effect, np.ndarray]]:
        """Effects, and (N, m) weights of parameters whose mean is a gauge, where all are active."""
        found, model = [], self.model
        for item, shape in zip(model.chain, model.shapes, strict=True):
            for own in item.gauge(shape, model.array.turns) if item.gauge else ():
                mask = np.zeros(active.shape, np.asarray(own).dtype)
                mask[: shape[0], self.of(item.id)] = np.reshape(own, (shape[0], -1))
                found.append((item, mask * self.owner))
        return [(item, mask) for item, mask in found if mask.any() and active[mask != 0].all()]


def columns_of(array: Array, effects, position_sd: float) -> Columns:
    """The columns for an array and a set of effects."""
    noise = Noise(np.eye(3 * array.accelerometers), np.eye(3 * array.gyroscopes))  # not looked at
    model = ArrayModel(array, noise, tuple(effects))
    count = max(array.accelerometers, array.gyroscopes)
    names, places, owner, sds = [POSITION] * 3, [(i,) for i in range(3)], [], [position_sd] * 3
    common = [0.0] * 3
    owner += [(np.arange(count) < array.accelerometers) & (np.arange(count) > 0)] * 3
    for item, shape in zip(model.chain, model.shapes, strict=True):
        spread, shared = (np.broadcast_to(sd, shape)[0] for sd in (item.prior_sd, item.common_sd))
        for place in np.ndindex(*shape[1:]):
            names.append(item.id)
            places.append(place)
            free = not (place and place[-1] in item.held)
            owner.append((np.arange(count) < shape[0]) & free)
            sds.append(float(spread[place]))
            common.append(float(shared[place]))
    return Columns(
        model, tuple(names), tuple(places), np.array(owner).T, np.array(sds), np.array(common)
    )


def catalogue_effects(without=(), smooth: bool = False) -> tuple[str, ...]:
    """The mean effects of a diagnosis, in the catalogue's order: those that any motion may tell.

    And those that ``smooth`` motion tells, but for filters that no delay stands for: it is most.
    """
    return tuple(
        name for name, one in EFFECTS.items()
        if name not in without and (not one.smooth or (smooth and (one.beside or not one.sampling)))
    )  # fmt: skip


def model_of(recording: Recording, effects: Sequence[str] = ()) -> ArrayModel:
    """The measurement model a recording declares: its geometry and noise."""
    return ArrayModel.isotropic(
        array_of(recording), recording.accelerometer_noise_sd, recording.gyroscope_noise_sd, effects
    )


def stepped(state, columns: Columns, active, step):
    """The state after a step (n,) of the ``active`` parameters (N, m) bool."""
    whole = columns.flat(state)
    whole[active] += step
    return columns.unflat(state, whole)
