"""Motion that turns too little, or about one axis, to determine positions (paper 2017)."""

from collections.abc import Callable

import numpy as np

from imuarray.errors import IdentifiabilityError

ONE_AXIS = (
    "motion: expected rotation about more than one axis (or angular acceleration off the axis),"
    " found angular rate and angular acceleration parallel to one axis throughout (Lemma 1 of"
    " paper 2017)"
)


def require_rotation(rate, noise: float, turning: Callable) -> None:
    """Raise IdentifiabilityError where omega and omega_dot stay on one axis throughout.

    Every A_n = Omega(omega)^2 + Omega(omega_dot) is then blind along that axis (Lemma 1). The same
    where there is no angular rate: omega_dot alone leaves the scale free. Noise and the start's
    wrong positions would hide this from a plain rank test, so the motion off the common axis is
    compared with what they can feign: 5 sigma of noise, and a tenth of the centrifugal and Euler
    terms (positions wrong by a tenth of the array).

    ``rate`` (T, 3) rad/s, its ``noise`` sd; ``turning``: gives omega_dot (T, 3) rad/s^2 and its sd.
    """
    values, axes = np.linalg.eigh(rate.T @ rate / len(rate))
    spread = np.sqrt(np.maximum(values[::-1], 0.0))
    if spread[0] <= 5 * noise:
        raise IdentifiabilityError(
            "motion: expected rotation, found no angular rate above the gyroscopes' noise: the"
            " array's scale is then undetermined"
        )
    if spread[1] > max(1e-3 * spread[0], 5 * noise):
        return
    turn, sd = turning()
    whole, along, fast = np.sum(turn**2), np.sum((turn @ axes[:, 2]) ** 2), np.sum(rate**2)
    across, along, fast = np.array([whole - along, along, fast]) / len(rate)
    if np.sqrt(across) <= max(0.1 * np.hypot(np.sqrt(along), fast), 5 * np.sqrt(2) * sd):
        raise IdentifiabilityError(ONE_AXIS)
