"""Sizes of effects in sigma: the most that a test which knows them could see.

That is what of a change in the readings no motion and no positions can absorb.
"""

from functools import lru_cache

import numpy as np

from imuarray_papers.blind.change import Change, noiseless_readings
from imuarray_papers.blind.inject import EFFECTS
from imuarray_papers.blind.scene import Pair, Scene, States, force_at

TOLERANCE = 0.01  # of a size that was asked for


def skew(vectors: np.ndarray) -> np.ndarray:
    """[v]x of vectors (..., 3), so that [v]x a = v x a; (..., 3, 3)."""
    return np.cross(np.eye(3), vectors[..., None, :])  # row i: e_i x v


class Projection:
    """The linearised array at given motion and positions, motion and positions projected out.

    Readings are whitened by the declared noise. Unknown are w, w', s of each sample (9) and the
    positions of all triads but the first (3 (A - 1)); there are no priors.
    """

    def __init__(self, states: States, positions: np.ndarray, noise: tuple[float, float]):
        """``states`` (T, 1, 3), ``positions`` (A, 3) m, ``noise`` in m/s^2 and rad/s."""
        rate, acceleration = states.rate[:, 0], states.acceleration[:, 0]
        self.force_sd, self.rate_sd = noise
        self.count = len(positions)
        spin = skew(rate)
        # du/dr, the same for every triad: (T, 3, 3)
        self.tensor = (spin @ spin + skew(acceleration)) / self.force_sd
        self.motion = self._motion_columns(rate, spin, positions)
        self.information = np.swapaxes(self.motion, 1, 2) @ self.motion
        # gyroscopes see w alone, all alike
        self.information[:, :3, :3] += self.count / self.rate_sd**2 * np.eye(3)
        self.positions = self._position_information()

    def _motion_columns(self, rate, spin, positions) -> np.ndarray:
        """Whitened du/d(w, w', s), (T, 3 A, 9)."""
        samples, count = len(rate), self.count
        columns = np.empty((samples, count, 3, 9))
        arms = skew(positions)
        # d(w x (w x r)) = dw x (w x r) + w x (dw x r)
        inner = skew(np.cross(rate[:, None], positions))
        columns[..., :3] = -inner - spin[:, None] @ arms
        columns[..., 3:6] = -arms
        columns[..., 6:] = np.eye(3)
        return columns.reshape(samples, 3 * count, 9) / self.force_sd

    def _position_information(self) -> np.ndarray:
        """Information on the positions with the motion projected out, square of 3 (A - 1)."""
        samples, others = len(self.tensor), self.count - 1
        rows = self.motion.reshape(samples, self.count, 3, 9)[:, 1:]
        mixed = np.einsum("tkim,tij->tmkj", rows, self.tensor).reshape(samples, 9, 3 * others)
        root = np.linalg.inv(np.linalg.cholesky(self.information))
        lost = (root @ mixed).reshape(9 * samples, 3 * others)
        own = np.einsum("tij,tik->jk", self.tensor, self.tensor)
        return np.kron(np.eye(others), own) - lost.T @ lost

    def fit(self, change: Pair) -> tuple[Pair, np.ndarray, np.ndarray]:
        """Absorb a whitened change; what remains, motion (T, 9) and positions (A, 3) m.

        ``change`` is (T, A, 3) and (T, G, 3) in noise sds; what remains has the same shapes.
        """
        remaining, _ = self._without_motion(change)
        slope = np.einsum("tij,tki->kj", self.tensor, remaining.force[:, 1:]).ravel()
        moved = np.zeros((self.count, 3))
        moved[1:] = np.linalg.lstsq(self.positions, slope, rcond=1e-14)[0].reshape(-1, 3)
        seen = np.einsum("tij,kj->tki", self.tensor, moved)
        remaining, motion = self._without_motion(Pair(change.force - seen, change.rate))
        return remaining, motion, moved

    def _without_motion(self, change: Pair) -> tuple[Pair, np.ndarray]:
        """Project the motion of each sample out; what remains, and the motion (T, 9)."""
        samples = len(change.force)
        force = change.force.reshape(samples, -1, 1)
        score = (np.swapaxes(self.motion, 1, 2) @ force)[..., 0]
        score[:, :3] += change.rate.sum(axis=1) / self.rate_sd
        motion = np.linalg.solve(self.information, score[..., None])
        remaining = (force - self.motion @ motion).reshape(change.force.shape)
        motion = motion[..., 0]
        return Pair(remaining, change.rate - motion[:, None, :3] / self.rate_sd), motion


@lru_cache(maxsize=2)
def _at_truth(scene: Scene, kept: bytes) -> Projection:
    """The projection at the scene's truth; one amplitude after another asks for the same."""
    keep = np.frombuffer(kept, bool)
    states = States(*(x[keep] for x in scene.nominal))
    return Projection(states, scene.positions, scene.noise)


def below_rails(scene: Scene, readings: Pair) -> np.ndarray:
    """Samples without any reading at a declared rail, (T,) bool."""
    good = np.ones(len(scene.time), bool)
    for values, limit in zip(readings, scene.limits, strict=True):
        good &= (np.abs(values) < limit).all(axis=(1, 2))
    return good


def smallest_residual(scene: Scene, clean: Pair, perturbed: Pair, steps: int = 1) -> float:
    """Norm of what no motion and no positions absorb, in sigma: the size of a change of the mean.

    Without priors, over all positions but the reference's. ``clean`` is what the model predicts at
    the truth, which knows of no rails (`Scene.ideal`), ``perturbed`` what is read then, both
    without noise, (T, A, 3) m/s^2 and (T, G, 3) rad/s. Samples where ``perturbed`` is at a declared
    rail are left out, as whoever reads the recording will. A lower, undeclared rail is thus held
    against the true motion, not a clipped one.
    ``steps`` is the number of Gauss-Newton steps: 1 is linear at the truth.
    """
    keep = below_rails(scene, perturbed)
    if not keep.any():
        return 0.0
    target = Pair(*(x[keep] for x in perturbed))
    states, positions = States(*(x[keep] for x in scene.nominal)), scene.positions
    predicted = Pair(*(x[keep] for x in clean))
    best = np.inf
    for step in range(steps):
        parts = zip(target, predicted, scene.noise, strict=True)
        change = Pair(*((y - x) / sd for y, x, sd in parts))
        here = _at_truth(scene, keep.tobytes()) if not step else None
        here = here or Projection(states, positions, scene.noise)
        remaining, motion, moved = here.fit(change)
        best = min(best, float(np.sqrt(sum((x**2).sum() for x in remaining))))
        states = States(*(x + motion[:, None, 3 * i : 3 * i + 3] for i, x in enumerate(states)))
        positions = positions + moved
        predicted = Pair(
            force_at(states, positions), np.broadcast_to(states.rate, target.rate.shape)
        )
    return best


def size_of(scene: Scene, changes: Change | list[Change], steps: int = 1) -> float:
    """Size in sigma of one effect, or of several together.

    Effects on the noise count root 2 KL from the true law of the noise to the Gaussian white one
    that is the base model's (`noise_divergence`); they add to the mean's in squares.
    """
    changes = [changes] if isinstance(changes, Change) else list(changes)
    moving = [change for change in changes if change.divergence is None]
    perturbed = noiseless_readings(scene, moving)
    squared = smallest_residual(scene, scene.ideal(), perturbed, steps) ** 2 if moving else 0.0
    samples = int(below_rails(scene, perturbed).sum())
    for change in changes:
        if change.divergence is not None:
            squared += 2 * noise_divergence(scene, change, samples)
    return float(np.sqrt(squared))


def noise_divergence(scene: Scene, change: Change, samples: int) -> float:
    """KL divergence in nats of an effect on the noise (its own), in so many samples.

    Times the share of readings that the motion leaves over.
    """
    readings = 6 * scene.accelerometers
    return float(change.divergence(samples) * (readings - 9) / readings)


def scale_to(scene: Scene, effect: str, sensors, rng_seed: int, sigma: float) -> float:
    """The amplitude, in the effect's unit, at which the effect seeded by ``rng_seed`` has a size.

    Met within 1 %; where the effect's limit or its steps do not allow that (a repeated sample
    comes whole), the amplitude that comes closest. Raises ValueError for `axis_swap`, which has
    no amplitude, and for the gauges, whose size is nothing at any amplitude.
    """
    if effect == "axis_swap" or effect.startswith("gauge_"):
        raise ValueError(f"effect: expected one with an amplitude and a size, found {effect!r}")
    entry = EFFECTS[effect]

    def size(amplitude):
        rng = np.random.default_rng(rng_seed)
        return size_of(scene, entry.draw(scene, rng, sensors, amplitude))

    return _search(size, sigma, entry.low, entry.limit)


def _search(size, sigma: float, start: float, limit: float, tries: int = 40) -> float:
    """Secant in logarithms inside a bracket, halving where it leaves the bracket."""
    low, high = 0.0, limit
    amplitude, power, last = start, 1.0, None
    best = (np.inf, start)
    for _ in range(tries):
        found = size(amplitude)
        miss = np.log(max(found, 1e-300) / sigma)
        best = min(best, (abs(miss), amplitude))
        if abs(miss) < TOLERANCE or high - low < 1e-9 * amplitude or amplitude < 1e-9 * start:
            break
        if last is not None and abs(np.log(amplitude / last[0])) > 1e-12:
            slope = (miss - last[1]) / np.log(amplitude / last[0])
            # far from proportional only across a step or near a bound
            power = float(np.clip(slope, 0.3, 4.0)) if np.isfinite(slope) else 1.0
        last = (amplitude, miss)
        low, high = (amplitude, high) if miss < 0 else (low, amplitude)
        guess = amplitude * np.exp(np.clip(-miss / power, -30, 30))
        amplitude = guess if low < guess < high else _inside(low, high, amplitude)
    return float(best[1])


def _inside(low: float, high: float, amplitude: float) -> float:
    """A point between the bounds of a bracket, one of which may be 0 or infinite."""
    if not np.isfinite(high):
        return 2 * amplitude
    return float(np.sqrt(low * high)) if low > 0 else high / 8
