"""Positions while the samples arrive: a recursive estimate of bounded memory."""

from dataclasses import dataclass, field

import numpy as np

from imuarray.errors import InputError
from imuarray.estimation.collapsed import Collapsed
from imuarray.estimation.newton import fisher_scoring
from imuarray.model import ArrayModel

BLOCK = 200  # samples that are calibrated together


@dataclass
class Online:
    """Maximum likelihood of the positions, block by block of samples.

    A block's motion is eliminated, its positions found by `descend` with all that was learned
    before as a normal prior, and only that prior's mean and precision stay: memory for ``block``
    samples and 3 (A - 1) squared numbers, however long the recording.

    Attributes
    ----------
    model : ArrayModel
        The papers' model with isotropic triads.
    position_sd : float
        m, prior sd of the positions around the nominal ones; the first block alone may not
        determine them.
    block : int
        Samples of a block.
    """

    model: ArrayModel
    position_sd: float
    block: int = BLOCK
    samples: int = 0
    positions: np.ndarray = field(init=False)  # (A, 3) m
    precision: np.ndarray = field(init=False)  # (3 (A - 1),) squared, 1 / m^2
    _waiting: list = field(default_factory=list)

    def __post_init__(self):
        """Nothing seen yet: the nominal positions."""
        self.positions = np.array(self.model.array.relative)
        self.precision = np.eye(self.positions[1:].size) / self.position_sd**2

    @property
    def covariance(self) -> np.ndarray:
        """Of r_2 ... r_A, m^2."""
        return np.linalg.inv(self.precision)

    def add(self, specific_force, angular_rate, saturated=None) -> int:
        """Samples (n, A, 3) m/s^2, (n, G, 3) rad/s and saturated axes (n, G, 3) or None.

        A reading at a gyroscope's rail that ``saturated`` does not mark spoils the positions
        (`Recording.saturated_gyroscopes` finds them). InputError for other shapes and for NaN.
        Returns how many blocks were learned from; what is left waits for more. Where a block
        raises IdentifiabilityError nothing of it is learned and it waits, with what comes next.
        """
        # copies: what waits is not the caller's buffer
        force, rate = np.array(specific_force, float), np.array(angular_rate, float)
        lost = np.zeros(rate.shape, bool) if saturated is None else np.array(saturated, bool)
        counts = self.model.array.accelerometers, self.model.array.gyroscopes
        samples = len(force) if force.ndim else 0
        expected = [(samples, count, 3) for count in (*counts, counts[1])]
        if [part.shape for part in (force, rate, lost)] != expected:
            raise InputError(
                f"online: expected samples of shapes {expected}, found"
                f" {[part.shape for part in (force, rate, lost)]}"
            )
        if not (np.all(np.isfinite(force)) and np.all(np.isfinite(rate))):
            raise InputError("online: expected finite samples, found NaN or infinite ones")
        self._waiting.append((force, rate, lost))
        learned = 0
        while sum(len(part[0]) for part in self._waiting) >= self.block:
            joined = [np.concatenate(part) for part in zip(*self._waiting, strict=True)]
            self._learn(*(part[: self.block] for part in joined))
            self._waiting = [tuple(part[self.block :] for part in joined)]
            learned += 1
        return learned

    def finish(self) -> None:
        """Learn from the samples that wait, fewer than a block."""
        joined = [np.concatenate(part) for part in zip(*self._waiting, strict=True)]
        if joined and len(joined[0]):
            self._learn(*joined)
        self._waiting = []

    def _learn(self, force, rate, saturated) -> None:
        data = Collapsed.of(self.model, np.asarray(force), np.asarray(rate), saturated)
        found = fisher_scoring(data, self.positions, (self.positions[1:].ravel(), self.precision))
        self.positions = found.positions
        self.precision = np.linalg.inv(found.covariance)
        self.samples += data.samples
