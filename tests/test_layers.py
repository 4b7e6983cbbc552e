"""Imports run one way, along the path of the data."""

import ast
import subprocess
import sys
from pathlib import Path

import pytest

import imuarray
import imuarray_papers

TOOL, PAPERS = (Path(package.__file__).parent for package in (imuarray, imuarray_papers))
# Each rests on those above it, or beside it; the injector of the blind study on no model at all.
LAYERS = {
    TOOL: (
        ("errors", "caches", "linear", "tails", "threads"),
        ("streams", "provenance", "geometry"), ("motion",), ("model",), ("words",),
        ("recording",), ("simulation", "firstorder"), ("alignment", "engine"),
        ("posterior",), ("diagnosis",), ("pictures",), ("report", "plots"), ("trust",),
        ("analysis",), ("commands",), ("cli",), ("__main__",),
    ),
    PAPERS: (
        ("compiled",), ("config", "reference", "estimation", "blind"), ("posterior",),
        ("measured", "calibration"), ("studies", "sampling"), ("claims", "figures"),
        ("pipeline", "commands"), ("__main__",),
    ),
}  # fmt: skip


def imported(path: Path, package: str = "imuarray") -> set[str]:
    """The parts of a package that a file imports, inside functions too."""
    names = []
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.ImportFrom):
            names += [node.module, *(f"{node.module}.{alias.name}" for alias in node.names)]
        elif isinstance(node, ast.Import):
            names += [alias.name for alias in node.names]
    parts = [name.split(".") for name in names if name.startswith(f"{package}.")]
    return {part[1] for part in parts} - {"__version__"}


@pytest.mark.parametrize("package", LAYERS, ids=lambda package: package.name)
def test_imports_run_one_way(package):
    place = {name: number for number, names in enumerate(LAYERS[package]) for name in names}
    wrong, seen = [], set()
    for path in package.rglob("*.py"):
        own = path.relative_to(package).parts[0].removesuffix(".py")
        if own == "__init__":
            continue
        seen.add(own)
        found = imported(path, package.name)
        wrong += [(path.name, name) for name in found if place[name] > place[own]]
    assert not wrong and seen <= set(place)


def test_the_tool_knows_nothing_of_the_papers():
    assert not [path for path in TOOL.rglob("*.py") if imported(path, "imuarray_papers")]


def test_the_tool_does_without_the_papers_compiler():
    names = ["imuarray.analysis.sampling", "imuarray.analysis.calibration", "imuarray.cli"]
    names += [
        "imuarray.commands.board",
        "imuarray.commands.diagnose",
        "imuarray.diagnosis.document",
    ]
    code = f"import sys, {', '.join(names)}; sys.exit('numba' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code]).returncode == 0


def test_trust_is_entered_by_its_door():
    files = [path for package in LAYERS for path in package.rglob("*.py")]
    outside = [path for path in files if path.parent.name != "trust"]
    assert not [path for path in outside if "imuarray.trust." in path.read_text(encoding="utf-8")]


def test_the_injector_shares_no_code_with_the_model():
    files = list((PAPERS / "blind").glob("*.py"))
    assert set().union(*(imported(path, "imuarray_papers") for path in files)) == {"blind"}
    found = set().union(*map(imported, files))
    assert found == {"geometry", "motion", "recording", "streams"}


def test_short_jobs_do_not_wait_for_scipy_stats():
    """It is slow to import, and scipy.special has the laws that they need."""
    parts = "measured.positions", "measured.residuals", "claims", "figures.measured"
    papers = [f"imuarray_papers.{part}" for part in (*parts, "studies.checks.timing")]
    names = ["imuarray.analysis.selection", "imuarray.commands.board", *papers]
    code = f"import sys, {', '.join(names)}; sys.exit('scipy.stats' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code]).returncode == 0
