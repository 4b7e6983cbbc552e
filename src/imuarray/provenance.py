"""Where a result comes from, and writing it whole or not at all.

Nothing here knows the time of day: the same code, configuration and seed write the same bytes.
"""

from __future__ import annotations

import errno
import hashlib
import io
import json
import os
import platform
import secrets
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from importlib import metadata
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

import imuarray

if TYPE_CHECKING:
    import pandas as pd
    import xarray as xr

_LIBRARIES = ("numpy", "scipy", "jax", "numba", "emcee", "arviz")


_ADDED: dict[str, tuple[str, str]] = {}  # name and text of code that is not the package's, by place


def add_code(name: str, place: str, text: str) -> None:
    """Let `versions` and `code_digest` know code from outside the package, at a ``place``."""
    _ADDED[place] = name, text


def code_version(place: str) -> str:
    """What `versions` says of the code that `add_code` was told of at ``place``."""
    return f"sha256 {hashlib.sha256(_ADDED[place][1].encode()).hexdigest()}"


def versions() -> dict[str, str]:
    """Versions of imuarray, of Python and of the libraries that the numbers depend on.

    Code from outside has its SHA-256.
    """
    found = {"imuarray": imuarray.__version__, "python": platform.python_version()}
    found |= {name: metadata.version(name) for name in _LIBRARIES}
    for place, (name, _) in _ADDED.items():
        value = code_version(place)
        found[name] = f"{found[name]}, {value}" if name in found else value
    return found


def digest(*objects: Any) -> str:
    """SHA-256, in hexadecimal, of nested dicts, sequences, text, numbers and numpy arrays.

    A dict's order, an array's memory layout and byte order, and tuple against list make no
    difference; 1 and 1.0 do, as do the types of two arrays. Raises TypeError for anything else,
    since the text of an arbitrary object may hold its address.
    """
    state = hashlib.sha256()
    _feed(state, list(objects))
    return state.hexdigest()


def _feed(state: Any, value: Any) -> None:
    """Add one value to the hash, each with its type and length so that no two nestings agree."""
    if isinstance(value, np.generic):
        value = value.item()
    if isinstance(value, Mapping):
        items = sorted(value.items(), key=lambda item: (type(item[0]).__name__, item[0]))
        state.update(f"dict {len(items)};".encode())
        for pair in items:
            _feed(state, pair)
    elif isinstance(value, list | tuple):
        state.update(f"list {len(value)};".encode())
        for item in value:
            _feed(state, item)
    elif isinstance(value, np.ndarray) and value.dtype.kind in "biufcUS":
        array = np.ascontiguousarray(value.astype(value.dtype.newbyteorder("<"), copy=False))
        state.update(f"array {array.dtype.str} {value.shape};".encode())
        state.update(array.tobytes())
    elif value is None or isinstance(value, bool | int | float | complex | str | Path):
        text = str(value) if isinstance(value, Path) else value
        body = repr(text).encode()
        state.update(f"{type(text).__name__} {len(body)};".encode() + body)
    else:
        raise TypeError(f"digest: no stable bytes for an object of type {type(value).__name__}")


def code_digest() -> str:
    """SHA-256, in hexadecimal, of the names and the text of the package's Python files.

    And of what `add_code` was told, if anything.
    """
    root = Path(__file__).parent
    sources = sorted((path.relative_to(root).as_posix(), path) for path in root.rglob("*.py"))
    # a checkout may have changed the line ends
    texts = [[name, path.read_text(encoding="utf-8")] for name, path in sources]
    return digest(texts + sorted([name, text] for name, text in _ADDED.values()))


def stamp(config: Mapping[str, Any], seed: int) -> dict[str, str | int]:
    """Attributes that every result carries: effective configuration, seed and versions.

    Text and an integer only, as NetCDF attributes are flat: `config` and `versions` are JSON.
    """
    return {
        "config": _json(config, sort_keys=True),
        "seed": int(seed),
        "versions": _json(versions(), sort_keys=True),
        "created_by": f"imuarray {imuarray.__version__}",
    }


def _plain(value: Any) -> Any:
    """Numpy's numbers and arrays, and paths, as JSON knows them."""
    if isinstance(value, np.ndarray | np.generic):
        return value.tolist()
    if isinstance(value, Path):
        return str(value)
    raise TypeError(f"JSON: expected plain data, found an object of type {type(value).__name__}")


def _json(value: Any, **options: Any) -> str:
    """JSON text; NaN and infinity, which JSON does not have, are a ValueError."""
    return json.dumps(value, default=_plain, allow_nan=False, ensure_ascii=False, **options)


@contextmanager
def atomic_write(path: str | Path) -> Iterator[Path]:
    """Give a temporary path beside `path`; it becomes `path` if the block ends without an error.

    A reader sees the old file or the new one, never a part; a failure leaves nothing behind.
    Raises FileNotFoundError if the folder does not exist; an OSError in the block, such as that
    of a full disk, names ``path``.
    """
    path = Path(path)
    if not path.parent.is_dir():
        raise FileNotFoundError(errno.ENOENT, "the output's folder does not exist", str(path))
    own = f".{path.stem}.{platform.node()}-"
    _sweep(path.parent, own)
    # the ending stays last: some writers choose the format by it
    temporary = path.with_name(f"{own}{os.getpid()}-{secrets.token_hex(4)}{path.suffix}")
    try:
        yield temporary
        os.replace(temporary, path)
    except OSError as error:
        if error.errno is None:
            raise
        raise OSError(error.errno, os.strerror(error.errno), str(path)) from error
    finally:
        # after a success there is nothing left to delete
        temporary.unlink(missing_ok=True)


def _sweep(folder: Path, own: str) -> None:
    """Remove the temporary files of this machine's processes that were killed."""
    for left in folder.iterdir():
        if not left.name.startswith(own):
            continue
        process = left.name.removeprefix(own).partition("-")[0]
        if process.isdigit() and not _runs(int(process)):
            left.unlink(missing_ok=True)


def _runs(process: int) -> bool:
    if os.name != "posix":  # signal 0 is another thing there
        return True
    try:
        os.kill(process, 0)
    except ProcessLookupError:
        return False
    except PermissionError:  # another user's
        return True
    return True


def write_json(value: Any, path: str | Path) -> None:
    """Write plain data (numpy's too) as indented JSON in the given order; see `_json` on NaN."""
    with atomic_write(path) as temporary:
        temporary.write_text(_json(value, indent=2) + "\n", encoding="utf-8", newline="\n")


def write_csv(frame: pd.DataFrame, path: str | Path) -> None:
    """Write a table without its index; numbers have the digits that give them back exactly."""
    with atomic_write(path) as temporary:
        frame.to_csv(temporary, index=False, lineterminator="\n")


def write_netcdf(
    data: xr.Dataset | xr.DataTree, path: str | Path, groups: Mapping[str, xr.Dataset] | None = None
) -> None:
    """Write a dataset or a tree of them as NetCDF-4, sealed, with further ``groups`` by name.

    The file is made in memory: HDF5 on a full disk ends the process.
    """
    image = io.BytesIO()
    data.to_netcdf(image, engine="h5netcdf")
    for name, dataset in (groups or {}).items():
        dataset.to_netcdf(image, mode="a", group=name, engine="h5netcdf")
    content = image.getvalue()
    with atomic_write(path) as temporary:
        temporary.write_bytes(content + SEAL + hashlib.sha256(content).digest())


SEAL = b"imuarray sha-256"  # before the digest, at a file's end, where HDF5 does not look


def seal_of(path: str | Path) -> bytes | None:
    """The digest at the end of a sealed file, or None."""
    length = len(SEAL) + hashlib.sha256().digest_size
    with open(path, "rb") as handle:
        size = handle.seek(0, os.SEEK_END)
        if size < length:
            return None
        handle.seek(size - length)
        tail = handle.read()
    return tail[len(SEAL) :] if tail.startswith(SEAL) else None


def is_damaged(path: str | Path) -> bool:
    """Whether a sealed file is not as `write_netcdf` wrote it; without a seal none can tell.

    To be asked before HDF5 reads the file: wrong bytes make it read wrong numbers, or loop.
    """
    found = seal_of(path)
    if found is None:
        return False
    state, left = hashlib.sha256(), os.path.getsize(path) - len(SEAL) - len(found)
    with open(path, "rb") as handle:
        while left:
            piece = handle.read(min(left, 1 << 20))
            state.update(piece)
            left -= len(piece)
    return found != state.digest()
