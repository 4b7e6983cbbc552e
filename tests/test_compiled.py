"""Compiled kernels are those of the source as it is, another file's included."""

import shutil
import subprocess
import sys
from pathlib import Path

import imuarray_papers

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
    shutil.copy(Path(imuarray_papers.__file__).with_name("compiled.py"), package)
    (package / "outer.py").write_text(OUTER)
    (package / "inner.py").write_text(INNER.format(1))
    assert [said(tmp_path), said(tmp_path)] == ["20 0", "20 1"]
    (package / "inner.py").write_text(INNER.format(2))
    assert said(tmp_path) == "30 0"


JITTED = """
from pathlib import Path
from imuarray import caches
caches.PACKAGE = Path.cwd()
from imuarray.model.jax64 import jax, jnp
print(jax.jit(lambda x: jnp.sum(jnp.sin(x) ** 2))(jnp.arange(5.0)))
print(jax.config.jax_compilation_cache_dir)
"""


def test_what_jax_compiled_is_kept_and_a_damaged_entry_made_again(tmp_path):
    def run():
        done = subprocess.run(
            [sys.executable, "-c", JITTED], cwd=tmp_path, capture_output=True, text=True, check=True
        )
        assert not done.stderr
        return done.stdout.split()

    first = run()
    assert Path(first[1]).parent == tmp_path / "__pycache__"
    entries = [path for path in Path(first[1]).iterdir() if path.stat().st_size > 100]
    assert entries
    for path in entries:
        path.write_bytes(path.read_bytes()[:-20])
    assert run() == first
