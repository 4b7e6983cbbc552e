"""Types of a command line's texts; each refuses a wrong one with what was expected."""

import argparse
import math
from functools import partial
from pathlib import Path

from imuarray.analysis import methods
from imuarray.errors import LARGEST, SMALLEST

BAGS = (".bag", ".mcap", ".db3")


class InputFile(type(Path())):  # type: ignore[misc]
    """A file that a command reads."""


class InputLog(InputFile):
    """A logger's output, a file or a folder of files, that a command reads."""


def bag(text: str) -> InputLog:
    """A ROS bag, by its ending where it is no folder."""
    path = InputLog(text)
    if path.is_file() and path.suffix.lower() not in BAGS:
        raise argparse.ArgumentTypeError(
            f"expected a folder or a file of {', '.join(BAGS)}, found {text!r}"
        )
    return path


def effects(text: str) -> tuple[str, ...]:
    """Comma-separated names; whether they exist is for the measurement model to say."""
    names = tuple(name.strip() for name in text.split(",") if name.strip())
    if len(set(names)) != len(names):
        raise argparse.ArgumentTypeError(f"expected each effect once, found {text!r}")
    return names


def model(text: str) -> str | InputFile:
    """A model's name, or the calibration that has one."""
    if text in methods.MODELS:
        return text
    if not methods.is_file(text):
        known = ", ".join(methods.MODELS)
        raise argparse.ArgumentTypeError(f"expected {known} or a calibration (.nc), found {text!r}")
    return InputFile(text)


def _number(kind: type, least: float, most: float, expected: str, text: str) -> float:
    """A number of a ``kind`` (int or float) within bounds."""
    try:
        value = kind(text)
    except ValueError:
        value = math.nan
    if not least <= value <= most:
        raise argparse.ArgumentTypeError(f"expected {expected}, found {text!r}")
    return value


count, seed = (
    partial(_number, int, least, 2**63 - 1, f"an integer of at least {least}") for least in (1, 0)
)
SIZES = f"a positive number, between {SMALLEST:g} and {LARGEST:g}"
positive = partial(_number, float, SMALLEST, LARGEST, SIZES)
