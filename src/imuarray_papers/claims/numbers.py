"""Numbers of the claims as text, and laws that they are held against."""

import numpy as np


def show(value: float, digits: int = 3) -> str:
    """A number with ``digits`` significant digits."""
    return f"{value:.{digits}g}"


def listed(values, digits: int = 3) -> str:
    """Numbers side by side."""
    return ", ".join(show(value, digits) for value in values)


def by_samples(values: dict, digits: int = 3) -> str:
    """T = ...: value; ...; a value may be several numbers."""
    parts = ((samples, np.atleast_1d(value)) for samples, value in values.items())
    return "; ".join(f"T = {samples}: {listed(value, digits)}" for samples, value in parts)


def tiny(value: float, limit: float) -> str:
    """A rounding error, whose digits differ between processors: below ``limit``, or itself."""
    return f"below {limit:g}" if value < limit else show(value, 2)


def power_law(x, y, error) -> tuple[float, float]:
    """Exponent of y ~ x^p and its standard error, from sds ``error`` of independent y's."""
    x, y, error = (np.asarray(values, float) for values in (x, y, error))
    weight = (y / error) ** 2
    centred = np.log(x) - np.sum(weight * np.log(x)) / weight.sum()
    spread = np.sum(weight * centred**2)
    return float(np.sum(weight * centred * np.log(y)) / spread), float(spread**-0.5)


def rises(values, errors, z: float = 3.0) -> int:
    """Number of steps of a sequence that go up by more than ``z`` combined standard errors."""
    values, errors = np.asarray(values, float), np.asarray(errors, float)
    limit = z * np.hypot(errors[1:], errors[:-1])
    return int(np.sum(np.diff(values) > limit))


def near(value: float, wanted: float, error: float, least: float) -> bool:
    """True of a value within ``least`` or three standard errors of what is wanted."""
    return abs(value - wanted) <= max(least, 3 * error)


def falls(values) -> bool:
    """True where each of a sequence (of numbers or of arrays) is below the one before."""
    return bool(np.all(np.diff(np.asarray(list(values), float), axis=0) < 0))


def ratio(a, a_error, b, b_error):
    """a / b and its standard error for independent a and b, numbers or columns."""
    value = a / b
    return value, abs(value) * np.hypot(a_error / a, b_error / b)
