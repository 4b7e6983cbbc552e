"""Compiled kernels are those of the source as it is, another file's included."""

import shutil
import subprocess
import sys
from pathlib import Path

import imuarray

INNER = "from pack.compiled import njit\n\n@njit\ndef inner(x):\n    return x + {}\n"
OUTER = """
from pack.compiled import njit
from pack.inner import inner

@njit
def outer(x):
    return 10 * inner(x)
"""
SCRIPT = "from pack.outer import outer; print(outer(1), sum(outer.stats.cache_hits.values()))"


def said(folder: Path) -> str:
    done = subprocess.run(
        [sys.executable, "-c", SCRIPT], cwd=folder, capture_output=True, text=True, check=True
    )
    return done.stdout.strip()


def test_a_change_in_a_kernel_reaches_those_that_call_it(tmp_path):
    package = tmp_path / "pack"
    package.mkdir()
    (package / "__init__.py").touch()
    shutil.copy(Path(imuarray.__file__).with_name("compiled.py"), package)
    (package / "outer.py").write_text(OUTER)
    (package / "inner.py").write_text(INNER.format(1))
    assert [said(tmp_path), said(tmp_path)] == ["20 0", "20 1"]
    (package / "inner.py").write_text(INNER.format(2))
    assert said(tmp_path) == "30 0"
