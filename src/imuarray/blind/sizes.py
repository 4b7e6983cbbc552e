"""How large an effect is, in sigma: what a test that knows it could see of it at best."""

import numpy as np

from imuarray.blind.change import Change, noiseless_readings
from imuarray.blind.inject import EFFECTS
from imuarray.blind.projection import below_rails, smallest_residual
from imuarray.blind.scene import Scene

TOLERANCE = 0.01  # of a size that was asked for


def size_of(scene: Scene, changes: Change | list[Change], steps: int = 1) -> float:
    """Size in sigma of one effect, or of several together.

    Effects on the noise count root 2 KL from the true law of the noise to the Gaussian white one
    that is the base model's (`noise_divergence`); they add to the mean's in squares.
    """
    changes = [changes] if isinstance(changes, Change) else list(changes)
    moving = [change for change in changes if not is_of_noise(change)]
    perturbed = noiseless_readings(scene, moving)
    squared = smallest_residual(scene, scene.ideal(), perturbed, steps) ** 2 if moving else 0.0
    samples = int(below_rails(scene, perturbed).sum())
    for change in changes:
        if is_of_noise(change):
            squared += 2 * noise_divergence(scene, change, samples)
    return float(np.sqrt(squared))


def is_of_noise(change: Change) -> bool:
    """Whether the effect changes the law of the noise and not the mean."""
    return change.divergence is not None


def noise_divergence(scene: Scene, change: Change, samples: int) -> float:
    """KL divergence in nats of an effect on the noise (its own), in so many samples.

    Times the share of readings that the motion leaves over.
    """
    readings = 6 * scene.accelerometers
    return float(change.divergence(samples) * (readings - 9) / readings)


def draw_seeded(scene, effect: str, sensors, rng_seed: int, size: float) -> Change:
    """The effect at one amplitude; a seed stands for the directions and patterns drawn."""
    return EFFECTS[effect].draw(scene, np.random.default_rng(rng_seed), sensors, size)


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
        return size_of(scene, draw_seeded(scene, effect, sensors, rng_seed, amplitude))

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
