"""Imports run one way, along the path of the data."""

import ast
import subprocess
import sys
from pathlib import Path

import imuarray

PACKAGE = Path(imuarray.__file__).parent
# Each rests on those above it, or beside it; the injector of the blind study on no model at all.
LAYERS = (
    ("errors", "caches", "linear", "tails", "walk"), ("compiled",),
    ("streams", "provenance", "geometry"), ("motion",), ("model", "config"),
    ("recording",), ("simulation", "firstorder", "estimation"), ("alignment", "engine"),
    ("posterior",), ("studies", "measured"), ("blind", "diagnosis"), ("claims", "figures"),
    ("report",), ("analysis",), ("plots", "pipeline"), ("commands",), ("cli",), ("__main__",),
)  # fmt: skip
PLACE = {name: number for number, names in enumerate(LAYERS) for name in names}


def imported(path: Path) -> set[str]:
    """The package's parts that a file of it imports, inside functions too."""
    names = []
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.ImportFrom):
            names += [node.module, *(f"{node.module}.{alias.name}" for alias in node.names)]
        elif isinstance(node, ast.Import):
            names += [alias.name for alias in node.names]
    parts = [name.split(".") for name in names if name.startswith("imuarray.")]
    return {part[1] for part in parts} - {"__version__"}


def test_imports_run_one_way():
    wrong, seen = [], set()
    for path in PACKAGE.rglob("*.py"):
        own = path.relative_to(PACKAGE).parts[0].removesuffix(".py")
        if own == "__init__":
            continue
        seen.add(own)
        wrong += [(path.name, name) for name in imported(path) if PLACE[name] > PLACE[own]]
    assert not wrong and seen <= set(PLACE)


def test_the_injector_shares_no_code_with_the_model():
    found = set().union(*(imported(path) for path in (PACKAGE / "blind").glob("*.py")))
    assert found == {"blind", "geometry", "motion", "recording", "streams"}


def test_short_jobs_do_not_wait_for_scipy_stats():
    """It is slow to import, and scipy.special has the laws that they need."""
    parts = "estimation.selection", "measured.positions", "measured.residuals", "claims"
    names = [f"imuarray.{part}" for part in (*parts, "figures.measured", "studies.checks.timing")]
    code = f"import sys, {', '.join(names)}; sys.exit('scipy.stats' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code]).returncode == 0
