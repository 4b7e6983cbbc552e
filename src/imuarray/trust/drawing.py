"""Estimated positions against the drawing: by how much they depart, and what would explain it.

The drawing says where each triad is, to within a declared sd. What departs from it by more than
chance allows is compared with what a known mistake would make of the drawing: another size, a
turned, inverted or mirrored array, two IMUs exchanged.
"""

from collections.abc import Iterator
from itertools import combinations
from typing import NamedTuple

import numpy as np
from scipy.spatial.transform import Rotation
from scipy.special import chdtrc

from imuarray.recording.units import GRAVITY
from imuarray.trust.settings import SETTINGS

DEGREE = np.degrees(1.0)
LENGTHS = {"m": 1.0, "cm": 1e-2, "inches": 0.0254, "mm": 1e-3}
MISTAKES = (  # (size of the array found over the drawn one, words)
    (DEGREE**-2, "gyroscopes in deg/s declared rad/s"),
    (DEGREE**2, "gyroscopes in rad/s declared deg/s, or degrees turned to radians twice"),
    (DEGREE**4, "degrees turned to radians three times"),
    (1 / GRAVITY, "specific force in g declared m/s^2"),
    (GRAVITY, "specific force in m/s^2 declared g"),
    *((size / LENGTHS[declared], f"nominal positions in {unit} declared {declared}")
      for declared in ("m", "mm") for unit, size in LENGTHS.items() if unit != declared),
)  # fmt: skip


class Places(NamedTuple):
    """Found and nominal positions of triads."""

    labels: tuple[str, ...]
    found: np.ndarray  # (A, 3) m
    nominal: np.ndarray  # (A, 3) m
    covariance: np.ndarray  # (3 A, 3 A) m^2 of the found ones
    prior_sd: float  # m, of each coordinate of each triad of the drawing, the reference's too
    hand: int = 0  # 1 or -1 where rates and forces turn in the same sense or not; 0: not known

    def learnt(self) -> bool:
        """True where the positions are known better than by the drawing."""
        coordinates = 3 * (len(self.found) - 1)
        return float(np.trace(self.covariance)) < coordinates * self.prior_sd**2


def centred(places) -> np.ndarray:
    """Relative to the triads' centre."""
    return places - places.mean(axis=0)


def precision(places: Places) -> np.ndarray:
    """Precision of found less nominal positions, (3 A, 3 A) 1/m^2, wherever the origin."""
    drawn = places.prior_sd**2 * np.eye(len(places.covariance))
    inverse = np.linalg.inv(places.covariance + drawn)
    moved = np.tile(np.eye(3), (len(places.found), 1))
    pull = inverse @ moved
    return inverse - pull @ np.linalg.solve(moved.T @ pull, pull.T)


def chi_square(weight, off) -> float:
    """Squared distance of ``off`` (A, 3) m."""
    return float(off.ravel() @ weight @ off.ravel())


def size_of(places: Places) -> tuple[float, float]:
    """Size of the array against the drawing, and its sd (the drawing's own error included)."""
    weight, shape = precision(places), places.nominal.ravel()
    known = float(shape @ weight @ shape)
    return float(shape @ weight @ places.found.ravel()) / known, known**-0.5


def departures(places: Places) -> str | None:
    """One sentence where the array found is not the array drawn, or None.

    Tests of all coordinates, the size, the orientation and each triad, at `alarm` among them all.
    """
    weight, off = precision(places), places.found - places.nominal
    count = len(places.found)
    size, sd = size_of(places)
    turns = np.stack([np.cross(e, places.nominal).ravel() for e in np.eye(3)], axis=1)
    pull = turns.T @ weight @ off.ravel()
    known = turns.T @ weight @ turns
    turned = float(pull @ np.linalg.lstsq(known, pull, rcond=1e-9)[0])
    moments, blocks = (weight @ off.ravel()).reshape(-1, 3), weight.reshape(count, 3, count, 3)
    # what a free place of each triad alone would take away
    alone = np.array(
        [moments[k] @ np.linalg.solve(blocks[k, :, k], moments[k]) for k in range(count)]
    )
    tests = [chdtrc(3 * (count - 1), chi_square(weight, off)), chdtrc(1, ((size - 1) / sd) ** 2),
             chdtrc(3, turned), *chdtrc(3, alone)]  # fmt: skip
    if len(tests) * min(tests) >= SETTINGS.alarm:
        return None
    if (unit := another_size(places)) or not places.learnt():
        return unit  # of what is known worse than by the drawing, only a unit's factor tells
    return _explained(places) or _unnamed(places, alone, tests)


def another_size(places: Places) -> str | None:
    """One sentence where the array is the drawn one at quite another size, or None.

    Positions that the recording hardly tells may have any size: then only that of a mistake.
    """
    found, drawn = centred(places.found), centred(places.nominal)
    size = float(np.linalg.norm(found) / np.linalg.norm(drawn))
    off = np.linalg.norm(found / size - drawn) / np.linalg.norm(drawn)
    fitted, sd = size_of(places)
    other = abs(fitted - 1) > SETTINGS.far * sd and off < SETTINGS.same_shape
    if not other or SETTINGS.sizes[0] < size < SETTINGS.sizes[1]:
        return None
    return size_words(size) if places.learnt() or _mistakes(size) else None


def size_words(size: float) -> str:
    """Words on how far off a size is, and the scales, or the mistake, that would make it so."""
    off = factor_words(size)
    if SETTINGS.sizes[0] < size < SETTINGS.sizes[1]:
        cause = f": gyroscopes {factor_words(size**-0.5)}, or accelerometers {off}?"
    elif found := _mistakes(size):
        cause = f": {', or '.join(found)}?"
    else:
        cause = ": a unit of the rates, of the specific force or of the nominal positions?"
    return f"the array comes out {off}{cause}"


def factor_words(factor: float) -> str:
    """By how much something is too large, or too small, as a user thinks of it."""
    word = "large" if factor > 1 else "small"
    if SETTINGS.sizes[0] < factor < SETTINGS.sizes[1]:
        return f"{100 * abs(factor - 1):.2g} % too {word}"
    return f"{max(factor, 1 / factor):.4g} times too {word}"


def _mistakes(size: float) -> list[str]:
    """Words on the mistakes that make such a size, the nearest first."""
    near = sorted((abs(np.log(size / factor)), words) for factor, words in MISTAKES)
    return [words for off, words in near if off < 0.2]


def _explained(places: Places) -> str | None:
    """The explanations that fit the drawing's sd, or far better than the drawing itself."""
    weight = precision(places)
    before = chi_square(weight, places.found - places.nominal)
    freedom = 3 * (len(places.found) - 1)
    # each further unknown has to pay for itself
    fits = []
    for words, drawn, unknowns in _explanations(places):
        paid = SETTINGS.as_good * unknowns
        fits.append((chi_square(weight, places.found - drawn) + paid, paid, words))
    score, paid, best = min(fits, key=lambda fit: fit[0])
    left = score - paid
    explained = before - left > 0.5 * (before - freedom)
    unlikely = chdtrc(freedom, left) < SETTINGS.alarm and left > SETTINGS.unexplained * before
    if unlikely or not explained:
        return None
    close = score + SETTINGS.as_good
    others = [words for fit, _, words in fits if words is not best and fit < close]
    return ", or ".join([best, *others[:2]])


def _explanations(places: Places) -> Iterator[tuple[str, np.ndarray, int]]:
    """Mistakes in words, the drawing (A, 3) m that each would make, the number of its unknowns."""
    nominal, labels, out = places.nominal, places.labels, "the array comes out"
    wrong = "specific force of the wrong sign (gravity's instead of minus gravity's)?"
    yield f"{out} inverted: {wrong}", -nominal, 1
    turn, _ = Rotation.align_vectors(centred(places.found), centred(nominal))
    frame = "are the sensors in the drawing's frame?"
    yield f"{out} turned by {angle_words(turn)}: {frame}", turn.apply(nominal), 3
    size, _ = size_of(places)
    if size > 0:
        yield size_words(size), size * nominal, 1
    for axis, flip in zip("xyz", 1 - 2 * np.eye(3), strict=True):
        yield f"{out} mirrored in {axis}: {_mirrored_words(places)}?", nominal * flip, 1
    for i, j in combinations(range(len(nominal)), 2):
        order = np.arange(len(nominal))
        order[[i, j]] = j, i
        said = f"IMUs {labels[i]} and {labels[j]} come out at each other's place"
        yield f"{said}: were they exchanged?", nominal[order], 1
    for k, label in enumerate(labels):
        moved = nominal.copy()
        moved[k] += _apart(places, k)
        distance = 1e3 * np.linalg.norm(moved[k] - nominal[k])
        said = f"IMU {label} comes out {distance:.3g} mm from its place"
        yield f"{said}: is it the one drawn there?", moved, 3


def _mirrored_words(places: Places) -> str:
    """Mistakes that mirror a drawing; of a flat board half a turn does the same."""
    sizes = np.linalg.svd(centred(places.nominal), compute_uv=False)
    words = ["left-handed axes"] if places.hand <= 0 else []
    words += ["was it drawn from the other side"] if places.hand >= 0 else []
    words += ["or turned by 180 degrees"] if sizes[-1] < SETTINGS.flat * sizes[0] else []
    return ", ".join(words)


def _apart(places: Places, k: int) -> np.ndarray:
    """By how much triad ``k`` is off, the others' mean being where it is drawn."""
    off = places.found - places.nominal
    return off[k] - np.delete(off, k, axis=0).mean(axis=0)


def angle_words(rotation: Rotation) -> str:
    """The angle of a rotation for a person."""
    angle = np.degrees(rotation.magnitude())
    return f"{angle:.0f} degrees" if angle >= 10 else f"{angle:.2g} degrees"


def _unnamed(places: Places, alone, tests) -> str:
    """Words on the triad that departs most, by how much, and on the least likely of the tests."""
    off = centred(places.found) - centred(places.nominal)
    worst = int(np.argmax(alone))
    distance = float(np.linalg.norm(_apart(places, worst)))
    rms = float(np.sqrt(np.mean(off**2)))
    least = int(np.argmin(tests))
    names = "all positions", "the size", "the orientation", *map("IMU {}".format, places.labels)
    return (
        f"the positions are {1e3 * rms:.3g} mm rms from the drawing, {rms / places.prior_sd:.2g} of"
        f" its sds (p = {max(tests[least], 1e-300):.1g} of {names[least]}); most of all IMU"
        f" {places.labels[worst]}, {1e3 * distance:.3g} mm"
    )
