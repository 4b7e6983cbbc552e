"""BLAS with one thread, where products are small."""

from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache
from threading import Lock

from threadpoolctl import ThreadpoolController


@cache
def _blas() -> list:
    return ThreadpoolController().select(user_api="blas").lib_controllers


_LOCK, _HELD = Lock(), []  # threads before, for each descent that runs; the last one restores them


@contextmanager
def one_thread() -> Iterator[None]:
    """BLAS' products are small here: more threads only wait for each other, 5 times as long.

    The limit is the whole process': it stays until the last of several descents at a time ends.
    """
    with _LOCK:
        before = _HELD[0] if _HELD else [library.num_threads for library in _blas()]
        _HELD.append(before)
        _set_threads([1] * len(before))
    try:
        yield
    finally:
        with _LOCK:
            _HELD.pop()
            if not _HELD:
                _set_threads(before)


def _set_threads(counts) -> None:
    for library, count in zip(_blas(), counts, strict=True):
        library.set_num_threads(count)
