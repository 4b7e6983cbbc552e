"""What goes wrong because of the input, as opposed to because of a defect."""

from numbers import Integral


class InputError(ValueError):
    """The user's input cannot be used.

    The message is one line that says what was expected, what was found and where; the command line
    prints it as it is and exits with status 2.
    """

    def __init__(self, message: str) -> None:
        # a message built from a library's own error may hold line breaks
        super().__init__(" ".join(str(message).split()))


class IdentifiabilityError(InputError):
    """The input is well formed, but does not determine the quantities asked for."""


def require_integer(name: str, value: object, least: int = 1) -> None:
    """InputError unless ``value`` is an integer of at least ``least``; a bool is none."""
    integral = isinstance(value, Integral) and not isinstance(value, bool)
    if not integral or value < least:
        raise InputError(f"{name}: expected an integer of at least {least}, found {value!r}")


def require_shape(name: str, value, shape: tuple[int, ...]) -> None:
    """InputError unless the array ``value`` has that shape; compiled code checks no bounds."""
    if value.shape != shape:
        raise InputError(f"{name}: expected shape {shape}, found {value.shape}")
