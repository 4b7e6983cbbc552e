"""Numbers with units as people read them: SI in the files, degrees and micrometres on the page."""

import math

from imuarray.model.catalogue import FULL_SCALE_FORCE, FULL_SCALE_RATE
from imuarray.model.effects import known_effect

DEGREE = math.degrees(1.0)
NARROW = "\u00a0"  # a space at which no line is broken
STANDARD_GRAVITY = 9.80665  # m/s^2
# A parameter's unit as files have it -> (factor, unit) pairs to be shown, the first that makes the
# value at least 0.1, then what is said beside it.
SHOWN = {
    "m s-2": (((1.0, "m/s²"), (1e3, "mm/s²")), None),
    "rad s-1": (((1.0, "rad/s"), (1e3, "mrad/s"), (1e6, "µrad/s")), (DEGREE, "deg/s")),
    "rad s m-1": (
        ((1.0, "rad/s per m/s²"), (1e3, "mrad/s per m/s²"), (1e6, "µrad/s per m/s²")),
        (DEGREE * STANDARD_GRAVITY, "deg/s per g"),
    ),
    "s2 m-1": (((1e6, "ppm per m/s²"),), (100 * FULL_SCALE_FORCE, "% at 16 g")),
    "s rad-1": (((1e6, "ppm per rad/s"),), (100 * FULL_SCALE_RATE, "% at 2000 deg/s")),
    "m": (((1e3, "mm"), (1e6, "µm")), None),
    "s": (((1.0, "s"), (1e3, "ms"), (1e6, "µs")), None),
    "s2": (((1e6, "ms²"),), None),
    "s3": (((1e9, "ms³"),), None),
    "m rad-2": (((1e3, "mm/rad²"),), None),
    "Hz": (((1.0, "Hz"),), None),
    "Hz/s": (((1e3, "mHz/s"), (1e6, "µHz/s")), None),
    "m s-3": (((1.0, "m/s³"),), None),
    "s-1": (((1.0, "1/s"), (1e3, "1/(1000 s)")), None),
    "rad": (((1e3, "mrad"), (1e6, "µrad")), (DEGREE, "deg")),
    "%": (((100.0, "%"), (1e6, "ppm")), None),
    "1": (((1.0, ""),), None),
}


def unit_shown(effect: str, name: str, unit: str) -> str:
    """The unit that a parameter is shown in: what "1" means depends on whose it is."""
    if unit != "1":
        return unit
    return "%" if name.startswith("share") else known_effect(effect).shown or unit


def number(value: float, digits: int = 3) -> str:
    """Some significant digits, no exponent between 10^-4 and 10^6, a true minus sign."""
    if not math.isfinite(value):
        return "not known"
    if value != 0 and not 1e-4 <= abs(value) < 1e6:
        power = math.floor(math.log10(abs(value)))
        digit = number(value / 10.0**power, digits)
        return f"{digit}{NARROW}·{NARROW}{power_of_ten(power)}"
    text = f"{float(f'{value:.{digits}g}'):.12g}"
    return text.replace("-", "−")


def power_of_ten(power: int) -> str:
    """'10⁻⁷⁷'."""
    return "10" + str(power).translate(str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹"))


def plus_minus(value: float, error: float | None) -> str:
    """A value with its error, both to the error's second digit; without one, three digits."""
    if error is None or not math.isfinite(error) or error <= 0 or not math.isfinite(value):
        return number(value)
    if max(abs(value), error) >= 1e6:
        power = math.floor(math.log10(max(abs(value), error)))
        inner = plus_minus(value / 10.0**power, error / 10.0**power)
        return f"({inner}){NARROW}·{NARROW}{power_of_ten(power)}"
    places = 1 - math.floor(math.log10(error))
    shown = [round(value, places), round(error, places)]
    texts = [f"{v:.{max(places, 0)}f}".replace("-", "−") for v in shown]
    return f"{texts[0]}{NARROW}±{NARROW}{texts[1]}"


def shown_in(unit: str, size: float) -> list[tuple[float, str]]:
    """(factor, unit) that a value of some size is shown in, and what is said beside it.

    ``unit``: a key of `SHOWN`, others are shown as they are.
    """
    choices, beside = SHOWN.get(unit, (((1.0, unit),), None))
    large = [choice for choice in choices if choice[0] * size >= 0.0999]
    return [large[0] if large else choices[-1], *([beside] if beside else [])]


def with_units(texts, parts) -> str:
    """'10.0 mrad/s (0.573 deg/s)': numbers as text with the units of `shown_in`."""
    both = [f"{t}{NARROW}{name}" if name else t for t, (_, name) in zip(texts, parts, strict=True)]
    return both[0] if len(both) == 1 else f"{both[0]} ({both[1]})"


def quantity(value: float, error: float | None, unit: str, size: float | None = None) -> str:
    """A value in SI with its error as a page shows it, degrees beside radians.

    ``size``: what chooses the prefix, the value itself if None.
    """
    parts = shown_in(unit, abs(value) if size is None else size)
    texts = [plus_minus(f * value, None if error is None else f * abs(error)) for f, _ in parts]
    return with_units(texts, parts)


def span(low: float, high: float, unit: str) -> str:
    """'1.02 to 1.07 mrad/s (0.0586 to 0.0612 deg/s)'; one value where both read alike."""
    parts = shown_in(unit, max(abs(low), abs(high)))
    ends = [[number(factor * end) for end in (low, high)] for factor, _ in parts]
    return with_units([" to ".join(dict.fromkeys(both)) for both in ends], parts)


def ratio(value: float) -> str:
    """Two decimals where it is near one, so that 1.00 is seen to be no round number."""
    return f"{value:.2f}" if 0.1 <= value < 10 else number(value)


def symbols(text: str) -> str:
    """Greek letters and true minus signs for what files spell out."""
    for plain, symbol in (
        ("omega double dot", "d²ω/dt²"), ("omega dot", "dω/dt"), ("omega_dot", "dω/dt"),
        ("omega", "ω"), ("tau", "τ"), ("phi", "φ"), (" -", " −"),
    ):  # fmt: skip
        text = text.replace(plain, symbol)
    return text


def probability(log10_p: float) -> str:
    """'0.012', a power of ten, or '< 10⁻⁶': no law of chance is known farther out."""
    if log10_p > -4:
        return number(10.0**log10_p, 2)
    return power_of_ten(math.ceil(log10_p)) if log10_p > -6 else f"<{NARROW}{power_of_ten(-6)}"


def joined(items) -> str:
    """'a', 'a and b', 'a, b and c'."""
    items = [str(item) for item in items]
    return " and ".join([", ".join(items[:-1]), items[-1]] if len(items) > 1 else items)


def first_up(text: str) -> str:
    """With a capital."""
    return text[:1].upper() + text[1:]


def fixed(value: float, decimals: int) -> str:
    """A number whose column lines up; zero has no sign."""
    return f"{round(value, decimals) + 0.0:.{decimals}f}".replace("-", "−")
