"""Selection of samples: moving, off the rails, informative."""

from dataclasses import dataclass

import numpy as np
from scipy.ndimage import binary_dilation

from imuarray.errors import InputError, require
from imuarray.geometry.array import require_planar_extent
from imuarray.model.structure import design, products
from imuarray.recording import Recording
from imuarray.recording.channels import require_once
from imuarray.recording.record import few

SLOWEST = np.radians(100.0)  # rad/s; slower samples say nearly nothing of the positions
SHAKEN = 3.0  # m/s^2, sd; a board in a hand that does not turn it has less
INFORMATIVE = 0.5  # the share of the moving, unsaturated samples that is kept: a half


@dataclass(frozen=True)
class Selection:
    """Indices of the samples kept, and how many each criterion removed, in this order.

    ``informative`` (n,) are the samples to calibrate with, ``usable`` (m,) all that move
    and are off the rails; ``removed`` maps a criterion's words to a count of samples.
    """

    informative: np.ndarray
    usable: np.ndarray
    removed: dict[str, int]

    def spread(self, count: int | None) -> np.ndarray:
        """Indices of ``count`` informative samples, spread evenly; of all of them for None."""
        return self.informative if count is None else disjoint(self.informative, [count])[count]


def disjoint(left: np.ndarray, counts) -> dict[int, np.ndarray]:
    """Disjoint subsets of the samples ``left``, of ``counts`` each, spread evenly over them.

    InputError where there are too few.
    """
    wanted, chosen = f"at least {sum(counts)} informative samples", {}
    require(len(left) >= sum(counts), "recording", wanted, len(left))
    for count in sorted(counts, reverse=True):
        picks = np.linspace(0, len(left) - 1, count).round().astype(int)
        chosen[count] = left[picks]
        left = np.delete(left, picks)
    return chosen


def information(recording: Recording) -> np.ndarray:
    """Size of A_t = Omega(omega)^2 + Omega(omega_dot), (T,) 1/s^2: how a position shows itself.

    omega is the gyroscopes' mean; omega_dot comes from the accelerometers at their nominal
    positions, by least squares given omega.
    """
    both, sizes = design(recording.relative_positions()), []
    for part in recording.parts():
        rate = part.angular_rate.mean(axis=1)
        force = part.specific_force.reshape(len(rate), -1) - products(rate) @ both[:, :6].T
        turn = np.linalg.lstsq(both[:, 6:], force.T)[0][:3].T
        # |Omega(w)^2|_F^2 = 2 |w|^4, |Omega(w')|_F^2 = 2 |w'|^2, and the two are orthogonal
        squares = 2 * np.sum(rate**2, axis=1) ** 2 + 2 * np.sum(turn**2, axis=1)
        sizes.append(np.sqrt(squares))
    return np.concatenate(sizes)


def select_dynamic(recording: Recording) -> Selection:
    """Moving samples with no reading at a rail, nor next to one; of these the informative.

    InputError where none moves off the rails, or a part of the recording is there twice.
    """
    require_once(recording)
    require_planar_extent(recording.accelerometer_position, "recording")
    rates = [part.angular_rate.mean(axis=1) for part in recording.parts()]
    speed = np.linalg.norm(np.concatenate(rates), axis=1)
    still = recording.still()
    rails = recording.at_rail("accelerometer"), recording.at_rail("gyroscope")
    criteria = {
        "still pose": still,
        f"slower than {np.degrees(SLOWEST):g} deg/s": speed < SLOWEST,
        "accelerometer at a rail": rails[0],
        "gyroscope at a rail": rails[1],
        "next to a rail": binary_dilation(rails[0] | rails[1]),
    }
    left, removed = np.ones(speed.shape, bool), {}
    for words, bad in criteria.items():
        removed[words] = int((left & bad).sum())
        left &= ~bad
    usable = np.flatnonzero(left)
    if not len(usable):
        each = ", ".join(f"{count} {words}" for words, count in removed.items())
        found = f"none ({each}){_shaken(recording, still, speed)}"
        raise InputError(f"recording: expected moving samples off the rails, found {found}")
    size = information(recording.select(usable))
    keep = size >= np.quantile(size, 1 - INFORMATIVE)
    removed["less informative half"] = int((~keep).sum())
    return Selection(usable[keep], usable, removed)


def _shaken(recording: Recording, still, speed) -> str:
    """A hint where the forces say that the array turns and no rate does."""
    moving = recording.specific_force[few(np.flatnonzero(~still))]
    if speed.max() > SLOWEST or not len(moving) or moving.std(axis=0).max() < SHAKEN:
        return ""
    return (
        f"; the specific force varies by {moving.std(axis=0).max():.2g} m/s^2 at rates of at most"
        f" {np.degrees(speed.max()):.2g} deg/s: rates in rad/s declared deg/s?"
    )
