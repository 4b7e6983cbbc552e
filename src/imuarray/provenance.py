"""Where a result comes from, and writing it whole or not at all.

Nothing here knows the time of day: the same code, configuration and seed write the same bytes.
"""

from __future__ import annotations

import errno
import hashlib
import io
import json
import math
import os
import platform
import shutil
import stat
import tempfile
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from importlib import metadata
from itertools import chain
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

import imuarray

if TYPE_CHECKING:
    import pandas as pd
    import xarray as xr

ROWS = 2**15  # of an array, digested at a time
_LIBRARIES = ("numpy", "scipy", "jax", "numba", "emcee", "arviz")
_ADDED: dict[str, tuple[str, str]] = {}  # name and text of code that is not the package's, by place


def add_code(name: str, place: str, text: str) -> None:
    """Let `versions` and `code_digest` know code from outside the package, at a ``place``."""
    _ADDED[place] = name, text


def code_version(place: str) -> str:
    """Entry of `versions` on the code that `add_code` was given at ``place``."""
    return f"sha256 {hashlib.sha256(_ADDED[place][1].encode()).hexdigest()}"


def versions() -> dict[str, str]:
    """Versions of imuarray, of Python and of the libraries that the numbers depend on.

    Code from outside has its SHA-256.
    """
    found = {"imuarray": imuarray.__version__, "python": platform.python_version()}
    for name in _LIBRARIES:
        with suppress(metadata.PackageNotFoundError):  # numba is the papers' alone
            found[name] = metadata.version(name)
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
    text = json.dumps(objects, default=_fingerprint, sort_keys=True)
    return hashlib.sha256(text.encode()).hexdigest()


def _fingerprint(value: Any) -> Any:
    """Plain JSON for what JSON does not know; of an array type, shape and SHA-256."""
    array = isinstance(value, np.ndarray) or getattr(value, "left_in_file", False)
    if array and value.dtype.kind in "biufcUS":
        found, kind, shape = hashlib.sha256(), value.dtype.newbyteorder("<"), value.shape
        value = value if value.shape else value[None]
        for first in range(0, len(value), ROWS):
            part = value[first : first + ROWS]
            found.update(np.ascontiguousarray(part, kind).data)
        return {"array": [kind.str, shape, found.hexdigest()]}
    if isinstance(value, np.generic | Path):
        return _plain(value)
    raise TypeError(f"digest: no stable bytes for an object of type {type(value).__name__}")


def code_digest() -> str:
    """SHA-256, in hexadecimal, of the names and the text of the project's Python files.

    And of what `add_code` was given, if anything.
    """
    root = Path(__file__).parents[1]
    files = root.glob("imuarray*/**/*.py")  # the papers' package, too, where it is
    sources = sorted((path.relative_to(root).as_posix(), path) for path in files)
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


def trust(reasons: Sequence[str] = ()) -> dict[str, str | int]:
    """Attributes of every answer: `trusted` 0 or 1, and `reasons` why not, a JSON list."""
    return {"trusted": int(not reasons), "reasons": _json(list(reasons))}


def _plain(value: Any) -> Any:
    """Numpy's numbers and arrays, and paths, as JSON knows them."""
    if isinstance(value, np.ndarray | np.generic):
        return value.tolist()
    if isinstance(value, Path):
        return str(value)
    raise TypeError(f"JSON: expected plain data, found an object of type {type(value).__name__}")


def finite(value: Any) -> Any:
    """Plain data as JSON knows it: numpy's numbers and arrays as lists, what is not finite null."""
    if hasattr(value, "tolist"):
        value = value.tolist()
    if isinstance(value, dict):
        return {str(key): finite(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [finite(item) for item in value]
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value


def _json(value: Any, **options: Any) -> str:
    """JSON text; NaN and infinity, which JSON does not have, are a ValueError."""
    return json.dumps(value, default=_plain, allow_nan=False, ensure_ascii=False, **options)


@contextmanager
def atomic_folder(folder: str | Path, last: str) -> Iterator[Path]:
    """Give a temporary folder, whose files go to ``folder`` if the block ends without an error.

    The one named ``last`` says that all others are there. A failure leaves ``folder`` as it was, or
    away, a process that is killed the hidden folder; an OSError names ``folder``.
    """
    folder = Path(folder)
    there = folder.exists()
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryDirectory(prefix=f".{Path(last).stem}.", dir=folder) as name:
            yield Path(name)
            for path in sorted(Path(name).iterdir(), key=lambda path: (path.name == last, path)):
                os.replace(path, folder / path.name)
    except BaseException as error:
        if not there:
            with suppress(OSError):
                folder.rmdir()
        if isinstance(error, OSError):
            raise OSError(error.errno, error.strerror or str(error), str(folder)) from error
        raise


@contextmanager
def atomic_write(path: str | Path) -> Iterator[Path]:
    """Give a temporary path, which becomes `path` if the block ends without an error.

    It is in a folder beside `path`, or beside what a symbolic link there leads to; folders that
    are missing are made. A reader sees the old file or the new one, never a part; a failure leaves
    nothing behind, a process that is killed the hidden folder.

    Raises OSError as `target_of`; an OSError in the block, such as that of a full disk, names
    ``path``.
    """
    target = target_of(path)
    try:
        target.parent.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryDirectory(prefix=f".{target.stem}.", dir=target.parent) as folder:
            # the same name: some writers choose the format by its ending
            temporary = Path(folder, Path(path).name)
            yield temporary
            os.replace(temporary, target)
    except OSError as error:
        if error.errno is None:
            raise
        raise OSError(error.errno, os.strerror(error.errno), str(path)) from error


def target_of(path: str | Path) -> Path:
    """The file that is written for ``path``: links are followed, and only a file is ever replaced.

    Raises OSError for a folder, a device, a pipe, a socket, and where standard output goes.
    """
    target = Path(os.path.realpath(path))
    try:
        found = target.stat()
    except FileNotFoundError:
        return target
    kinds = {stat.S_IFREG: None, stat.S_IFDIR: "a folder", stat.S_IFIFO: "a pipe",
             stat.S_IFSOCK: "a socket"}  # fmt: skip
    kind = kinds.get(stat.S_IFMT(found.st_mode), "a device")
    with suppress(OSError):  # a process may have closed it
        if os.path.samestat(found, os.fstat(1)):
            kind = "standard output"
    if kind is not None:
        raise OSError(errno.EINVAL, f"expected a file to write, found {kind}", str(path))
    return target


def write_bytes(content: bytes, path: str | Path) -> None:
    """Write a file as `atomic_write` does."""
    with atomic_write(path) as temporary:
        temporary.write_bytes(content)


def write_json(value: Any, path: str | Path) -> None:
    """Write plain data (numpy's too) as indented JSON in the given order; see `_json` on NaN."""
    write_bytes(f"{_json(value, indent=2)}\n".encode(), path)


def write_csv(frame: pd.DataFrame, path: str | Path) -> None:
    """Write a table without its index; numbers have the digits that give them back exactly."""
    write_bytes(frame.to_csv(index=False, lineterminator="\n").encode(), path)


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
    with atomic_write(path) as temporary:
        temporary.write_bytes(image.getbuffer())
        _seal(temporary)


def write_netcdf_parts(
    parts: Iterable[xr.Dataset], length: int, path: str | Path,
    groups: Mapping[str, xr.Dataset] | None = None,
) -> None:  # fmt: skip
    """Write a dataset that comes in ``parts`` along time, ``length`` samples in all.

    Attributes and what has no time are the first part's. The room is taken on the disk before HDF5
    writes to it: OSError where there is too little.
    """
    parts = iter(parts)
    first = next(parts)
    if first.sizes["time"] == length:
        write_netcdf(first, path, groups)
        return
    import h5netcdf
    import xarray as xr

    along = [name for name, item in first.variables.items() if item.dims[:1] == ("time",)]
    encoded = {n: xr.conventions.encode_cf_variable(first.variables[n], name=n) for n in along}
    room = sum(one.nbytes for one in encoded.values()) * length // first.sizes["time"]
    with atomic_write(path) as temporary:
        if shutil.disk_usage(temporary.parent).free < room:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        first.drop_vars(along).to_netcdf(temporary, engine="h5netcdf")
        for name, dataset in (groups or {}).items():
            dataset.to_netcdf(temporary, mode="a", group=name, engine="h5netcdf")
        with h5netcdf.File(temporary, "a") as file:
            file.dimensions["time"] = length
            for name, one in encoded.items():
                made = file.create_variable(name, one.dims, one.dtype)
                made.attrs.update({key: x for key, x in one.attrs.items() if key != "_FillValue"})
        with open(temporary, "r+b") as handle:
            os.posix_fallocate(handle.fileno(), 0, os.fstat(handle.fileno()).st_size + room)
        with h5netcdf.File(temporary, "a") as file:
            start = 0
            for part in chain((first,), parts):
                stop = start + part.sizes["time"]
                for name in along:
                    file[name][start:stop] = part[name].to_numpy()
                start = stop
        _seal(temporary)


def _seal(path: Path) -> None:
    with open(path, "r+b") as handle:
        handle.write(SEAL + hashlib.file_digest(handle, "sha256").digest())


SEAL = b"imuarray sha-256"  # before the digest, at a file's end, where HDF5 does not look


def seal_of(path: str | Path) -> bytes | None:
    """The digest at the end of a sealed file, or None."""
    length = len(SEAL) + hashlib.sha256().digest_size
    with open(path, "rb") as handle:
        handle.seek(max(handle.seek(0, os.SEEK_END) - length, 0))
        tail = handle.read()
    return tail[len(SEAL) :] if tail.startswith(SEAL) and len(tail) == length else None


def is_damaged(path: str | Path) -> bool:
    """True where a sealed file is not as `write_netcdf` wrote it; without a seal this is unknown.

    To be asked before HDF5 reads the file: wrong bytes make it read wrong numbers, or loop.
    """
    found = seal_of(path)
    if found is None:
        return False
    content, left = hashlib.sha256(), os.stat(path).st_size - len(SEAL) - len(found)
    with open(path, "rb") as handle:
        while left and (part := handle.read(min(left, 2**20))):
            content.update(part)
            left -= len(part)
    return content.digest() != found
