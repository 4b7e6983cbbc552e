"""How large an effect is, in sigma: what a test that knows it could see of it at best."""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from imuarray.blind.change import EFFECTS, Change, noiseless_readings
from imuarray.blind.projection import below_rails, smallest_remainder
from imuarray.blind.scene import Pair, Scene

TOLERANCE = 0.01  # of a size that was asked for


def total_size(scene: Scene, clean: Pair, perturbed: Pair, steps: int = 1) -> float:
    """Size of a change of the mean: root of the least sum of squared whitened differences.

    The least over the motion of every sample (w, w', s free) and over all positions but the
    reference's, without priors, linear at the truth (``steps`` Gauss-Newton steps otherwise).
    ``clean`` (`Scene.ideal`, without rails) and ``perturbed`` are without noise, (T, A, 3) m/s^2
    and (T, G, 3) rad/s; a sample with any perturbed reading at a declared rail is left out whole.
    """
    return smallest_remainder(scene, clean, perturbed, steps)


def size_of(scene: Scene, changes: Change | list[Change], steps: int = 1) -> float:
    """Size in sigma of one effect, or of several together.

    Effects on the noise count root 2 KL from the true law of the noise to the Gaussian white one
    that is the base model's (`noise_divergence`); they add to the mean's in squares.
    """
    changes = [changes] if isinstance(changes, Change) else list(changes)
    moving = [change for change in changes if not is_of_noise(change)]
    perturbed = noiseless_readings(scene, moving)
    squared = total_size(scene, scene.ideal(), perturbed, steps) ** 2 if moving else 0.0
    samples = int(below_rails(scene, perturbed).sum())
    for change in changes:
        if is_of_noise(change):
            squared += 2 * noise_divergence(scene, change, samples)
    return float(np.sqrt(squared))


def is_of_noise(change: Change) -> bool:
    """Whether the effect changes the law of the noise and not the mean."""
    return any(part is not None for part in (*change.gain, *change.correlation))


def noise_divergence(scene: Scene, change: Change, samples: int) -> float:
    """KL divergence in nats, times the share of readings that the motion leaves over.

    A louder triad is held against the declared level; heavy tails and noise that grows with |w|
    against the Gaussian of the same variance (the level is another effect's); coloured noise
    against white.
    """
    count = len(change.sensors)
    kinds = sum(part is not None for part in (*change.gain, *change.correlation))
    if change.effect == "heavy_tails":
        each = _tails_divergence(*(float(change.parameters[n].value) for n in ("share", "factor")))
        total = each * count * kinds * samples
    elif change.effect == "coloured_noise":
        rho = float(change.parameters["coefficient"].value)
        total = -1.5 * np.log1p(-(rho**2)) * count * kinds * samples
    else:
        alike = change.effect == "outside_rate_noise"
        chosen = list(change.sensors)
        gains = [part[:, chosen] for part in change.gain if part is not None]
        total = sum(_level_divergence(gain, alike) for gain in gains) * samples
    triads = 2 * scene.accelerometers
    return float(total * (3 * triads - 9) / (3 * triads))


def _level_divergence(gain: np.ndarray, alike: bool) -> float:
    """KL of N(0, gain^2) from N(0, 1), per sample over triads and axes; gain (T or 1, n).

    With ``alike``, from the constant level of the same mean square in each triad.
    """
    squared = gain**2
    if alike:
        squared = squared / squared.mean(axis=0)
    return float(1.5 * (squared - 1 - np.log(squared)).mean(axis=0).sum())


@lru_cache(maxsize=256)
def _tails_divergence(share: float, factor: float) -> float:
    """KL per triad-sample of a mixture from the Gaussian with its covariance.

    The mixture is (1 - share) N(0, I) + share N(0, factor^2 I) in three dimensions, so the
    integral is over the radius alone.
    """
    radius = np.geomspace(1e-3, 12 * max(factor, 1.0), 4000)
    variance = 1 + share * (factor**2 - 1)

    def log_normal(v):
        return -1.5 * np.log(2 * np.pi * v) - radius**2 / (2 * v)

    with np.errstate(divide="ignore"):
        parts = np.log([1 - share, share])[:, None] + [log_normal(1.0), log_normal(factor**2)]
    mixture = np.logaddexp(*parts)
    density = 4 * np.pi * radius**2 * np.exp(mixture)
    return float(max(np.trapezoid(density * (mixture - log_normal(variance)), radius), 0.0))


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
