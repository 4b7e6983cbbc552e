"""Folders where compiled code is kept between processes, and JAX set to use one."""

import hashlib
import os
import platform
import warnings
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path

PACKAGE = Path(__file__).parent


def cache_folder(name: str, own: str | None = None) -> Path | None:
    """A folder of that name that can be written to; None where there is none.

    In ``own`` if a user names one, or beside the package, or with the user's caches.
    """
    for place in [Path(own)] if own else _places():
        with suppress(OSError):
            (place / name).mkdir(parents=True, exist_ok=True)
            if os.access(place / name, os.W_OK):
                return place / name
    return None


def _places() -> Iterator[Path]:
    yield PACKAGE / "__pycache__"
    with suppress(RuntimeError):  # no home
        yield Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "imuarray"


def keep_compiled(jax) -> None:
    """Let JAX keep what it has compiled, unless a user's own setting says where.

    The machine code is the same whether it was just made or read (tests/test_same_bytes.py). What
    is in the folder may be deleted at any time. An entry that is damaged, or half-written by
    another process, is compiled again without a word.
    """
    if jax.config.jax_compilation_cache_dir is not None:
        return
    folder = cache_folder(f"xla-{_processor()[:16]}")
    if folder is not None:
        jax.config.update("jax_compilation_cache_dir", str(folder))
        jax.config.update("jax_persistent_cache_min_compile_time_secs", 0.0)
        jax.config.update("jax_persistent_cache_min_entry_size_bytes", -1)
        warnings.filterwarnings("ignore", "Error (reading|writing) persistent compilation cache")


def _processor() -> str:
    """SHA-256 of what the processor can do: machines that share a folder may differ."""
    lines = []
    with suppress(OSError):
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
    able = next((line for line in lines if line.startswith(("flags", "Features"))), "")
    return hashlib.sha256(
        f"{platform.machine()} {platform.processor()} {able}".encode()
    ).hexdigest()
