"""Errors because of the input, as opposed to because of a defect."""

from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from numbers import Integral

# Sizes that a quantity in SI units may have: what is squared and summed stays a number, and
# seconds since 1970 fit in.
SMALLEST, LARGEST = 1e-15, 1e11


def printable(text: str) -> str:
    """The text with what would control a terminal escaped; line breaks stay."""
    return "".join(
        c if c.isprintable() or c in "\n\N{NO-BREAK SPACE}" else c.encode("unicode_escape").decode()
        for c in text
    )


def one_line(text: object) -> str:
    """Any text as one printable line."""
    return printable(" ".join(str(text).split()))


class InputError(ValueError):
    """The user's input cannot be used.

    The message is one line that says what was expected, what was found and where; the command line
    prints it as it is and exits with status 2.
    """

    def __init__(self, message: str) -> None:
        # what it quotes of a file or of a library's own error may hold line breaks, and worse
        super().__init__(one_line(message))


class IdentifiabilityError(InputError):
    """The input is well formed, but does not determine the quantities asked for."""


def require(holds: object, where: str, expected: str, found: object) -> None:
    """InputError unless something ``holds``: "where: expected ..., found ...".

    ``where`` is empty where the caller alone knows the file, and names it.
    """
    if not holds:
        raise InputError((f"{where}: " if where else "") + f"expected {expected}, found {found}")


@contextmanager
def expecting(where: object, expected: str, errors=Exception, most=None) -> Iterator[None]:
    """InputError, "where: expected ..., found ...", for ``errors`` that are raised within.

    By default for all, with their names: of a damaged file libraries raise nearly anything.
    ``most``: characters of their first line alone, of those whose messages are pages.
    """
    try:
        yield
    except InputError:
        raise
    except errors as error:
        text = str(error) if most is None else str(error).strip().split("\n")[0][:most]
        found = f"{type(error).__name__}: {text}" if errors is Exception else text
        raise InputError(f"{where}: expected {expected}, found {found}") from error


def numbered(reasons) -> str:
    """All reasons in one line, each with its number where there are several."""
    texts = list(reasons)
    return "; ".join(f"({n}) {text}" for n, text in enumerate(texts, 1)) if texts[1:] else texts[0]


def require_integer(name: str, value: object, least: int = 1) -> None:
    """InputError unless ``value`` is an integer of at least ``least``; a bool is none."""
    integral = isinstance(value, Integral) and not isinstance(value, bool)
    require(integral and value >= least, name, f"an integer of at least {least}", repr(value))


def require_one_of(name: str, value: object, known: Iterable[str]) -> None:
    """InputError unless ``value`` is one of the texts ``known``."""
    require(value in known, name, f"any of {', '.join(known)}", repr(value))


def require_shape(name: str, value, shape: tuple[int, ...]) -> None:
    """InputError unless the array ``value`` has that shape; compiled code checks no bounds."""
    require(value.shape == shape, name, f"shape {shape}", value.shape)
