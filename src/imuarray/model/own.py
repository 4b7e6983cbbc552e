"""Effects of a user's own, read from a Python file."""

import traceback
from pathlib import Path

from imuarray.errors import InputError
from imuarray.model.effects import EFFECTS
from imuarray.provenance import add_code, code_version, digest

_READ: dict[str, tuple[str, tuple[str, ...]]] = {}  # by path: digest of the text, and its ids


def read_effects(path: str | Path) -> tuple[str, ...]:
    """Run a Python file that registers effects (docs/effects.md); returns their ids.

    The file is code and does what it says: read your own only. Results carry its name and SHA-256
    beside the versions, and chains made with another text of it are not continued. The same text
    is run once; a changed file replaces its effects. InputError with the line where it fails, or
    where it registers nothing; the catalogue is then as before.
    """
    path = Path(path)
    try:
        text = path.read_text(encoding="utf-8")
    except UnicodeDecodeError as error:
        raise InputError(f"{path}: expected a Python file in UTF-8, found {error}") from None
    except OSError as error:
        raise InputError(f"{path}: expected a Python file, found {error.strerror}") from None
    place, known, before = str(path.resolve()), digest(text), dict(EFFECTS)
    former = _READ.get(place, ("", ()))
    if former[0] == known:
        return former[1]
    for name in former[1]:
        EFFECTS.pop(name, None)
    kept = dict(EFFECTS)
    try:
        code = compile(text, str(path), "exec", dont_inherit=True)
        exec(code, {"__name__": path.stem, "__file__": str(path)})  # noqa: S102
        new = tuple(name for name in EFFECTS if name not in kept)
        if not new:
            raise InputError(
                f"{path}: expected effects (@effect(...) of docs/effects.md), found none"
            )
    except BaseException as error:
        EFFECTS.clear()
        EFFECTS.update(before)
        if isinstance(error, InputError | KeyboardInterrupt):
            raise
        raise InputError(f"{path}{_line(error, path)}: {type(error).__name__}: {error}") from None
    add_code(path.name, place, text)
    _READ[place] = known, new
    return new


def own_version(name: str) -> str | None:
    """SHA-256 of the text of the file that an effect was read from, as results carry it."""
    places = [place for place, (_, names) in _READ.items() if name in names]
    return code_version(places[0]) if places else None


def _line(error: BaseException, path: Path) -> str:
    """', line 3': the last of the file's lines that the error went through."""
    if isinstance(error, SyntaxError):
        return f", line {error.lineno}"
    frames = traceback.extract_tb(error.__traceback__)
    lines = [frame.lineno for frame in frames if frame.filename == str(path)]
    return f", line {lines[-1]}" if lines else ""
