"""What all tests share: one thread of BLAS each, and the long files first."""

import ctypes
import gc
import io
import os
import shutil
import subprocess
import sys
import zipfile
from contextlib import suppress
from pathlib import Path

import pytest

# Two workers on two cores: products here are small, and a second thread only waits for the first.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
with suppress(OSError):  # not glibc
    C = ctypes.CDLL("libc.so.6")
    C.mallopt(-8, 2)  # M_ARENA_MAX: each arena keeps what it was once given


@pytest.fixture(scope="module", autouse=True)
def forgotten():
    """After each file what it compiled goes, and the memory back: a worker runs dozens of them."""
    yield
    if jax := sys.modules.get("jax"):
        jax.clear_caches()
    gc.collect()
    with suppress(NameError):
        C.malloc_trim(0)


def pytest_collection_modifyitems(items):
    """Files with slow tests begin, so that no core is left with one of them at the end."""
    slow = {item.path for item in items if item.get_closest_marker("slow")}
    items.sort(key=lambda item: item.path not in slow)


@pytest.fixture(scope="session")
def committed(tmp_path_factory):
    """paper_figures/ as committed, whatever a run has left there; in a source archive as it is."""
    root, folder = Path(__file__).parents[1], tmp_path_factory.mktemp("committed")
    place = folder / "paper_figures"
    command = ["git", "-C", str(root), "archive", "--format=zip", "HEAD", "paper_figures"]
    if (root / ".git").exists():
        done = subprocess.run(command, capture_output=True, check=True)
        zipfile.ZipFile(io.BytesIO(done.stdout)).extractall(folder)
    else:
        shutil.copytree(root / "paper_figures", place)
    return place
