"""An array of triads on one rigid body: labels, nominal positions, sides."""

from dataclasses import dataclass

import numpy as np

from imuarray.errors import IdentifiabilityError, require


@dataclass(frozen=True)
class Array:
    """Nominal geometry of an inertial sensor array.

    Attributes
    ----------
    positions : ndarray (A, 3), metres, array frame
        Accelerometer triads; the first is the reference.
    labels : tuple of A str
    gyroscopes : int
        Number G of gyroscope triads (all measure the same angular rate).
    axes : ndarray (A, 3, 3) or None
        Rotations from the accelerometers' own axes to the array's; None for identities.
    package : tuple of 3 floats, metres
        Outline of one IMU package, for drawings only.
    """

    positions: np.ndarray
    labels: tuple[str, ...]
    gyroscopes: int
    name: str = "array"
    package: tuple[float, float, float] = (0.004, 0.004, 0.001)
    axes: np.ndarray | None = None

    @property
    def accelerometers(self) -> int:
        """Number A of accelerometer triads."""
        return len(self.positions)

    @property
    def turns(self) -> np.ndarray:
        """`axes`, (A, 3, 3)."""
        return np.tile(np.eye(3), (self.accelerometers, 1, 1)) if self.axes is None else self.axes

    @property
    def relative(self) -> np.ndarray:
        """Positions relative to the reference triad, (A, 3) metres; row 0 is zero."""
        return self.positions - self.positions[0]

    @property
    def parameters(self) -> np.ndarray:
        """theta of paper 2021: r_2 ... r_A relative to r_1, shape (3 (A - 1),), metres."""
        return self.relative[1:].ravel()


def sub_array(array: Array, triads: int) -> Array:
    """``triads`` of an array's IMUs, spread evenly over its list."""
    if triads >= array.accelerometers:
        return array
    chosen = np.linspace(0, array.accelerometers - 1, triads).round().astype(int)
    labels = tuple(array.labels[k] for k in chosen)
    axes = None if array.axes is None else array.axes[chosen]
    return Array(array.positions[chosen], labels, triads, array.name, array.package, axes)


def positions_of(theta) -> np.ndarray:
    """(A, 3) m relative to the reference triad, of theta (3 (A - 1),), r_2 ... r_A."""
    return np.vstack([np.zeros(3), np.reshape(theta, (-1, 3))])


MAX_TRIADS = 256  # of a kind; the slowest estimator takes half a minute and 5 GB for as many


def require_count(count: int, where: str, kind: str) -> None:
    """InputError for more triads than `MAX_TRIADS`."""
    require(count <= MAX_TRIADS, where, f"at most {MAX_TRIADS} {kind} triads", count)


def require_apart(positions: np.ndarray, where: str) -> None:
    """IdentifiabilityError for fewer than two triads, two at one place, or collinear ones."""
    if len(positions) > 2:
        require_planar_extent(positions, where)
    elif len(positions) < 2 or np.array_equal(*positions):
        raise IdentifiabilityError(
            f"{where}: expected two accelerometer triads at least, at different places, found"
            f" {len(positions)}"
        )


def require_planar_extent(positions: np.ndarray, where: str = "array") -> None:
    """Raise IdentifiabilityError for fewer than three or collinear triads (2017, section II)."""
    if len(positions) < 3:
        raise IdentifiabilityError(
            f"{where}: expected at least 3 accelerometer triads, found {len(positions)}: two leave"
            " each sample's angular acceleration open about the line through them; `calibrate`,"
            " `apply` and `diagnose` take it from the gyroscopes' change, from sample to sample"
        )
    spread = np.linalg.svd(positions - positions.mean(axis=0), compute_uv=False)
    if spread[1] <= 1e-9 * spread[0]:
        raise IdentifiabilityError(
            f"{where}: expected accelerometer triads that span a plane, found them collinear"
        )
