"""Are two runs' results the same? For the tests, the cluster and the run that is killed."""

from __future__ import annotations

import sys
from pathlib import Path

import xarray as xr

TIMED = ("logs", "benchmarks")  # folders of times
CLOCKED = "timing"  # and the file that claims about times come from


def differences(one: Path, other: Path) -> list[str]:
    """What is in one tree only, or not the same in both; times of day and durations left out."""
    first, second = _files(one), _files(other)
    found = [f"{name}: only in {one}" for name in first if name not in second]
    found += [f"{name}: only in {other}" for name in second if name not in first]
    both = [name for name in first if name in second]
    return found + [f"{name}: differs" for name in both if not _same(one / name, other / name)]


def _files(root: Path) -> list[str]:
    # of what a killed process was writing, a hidden folder is left
    paths = [path.relative_to(root) for path in root.rglob("*") if path.is_file()]
    paths = [p for p in paths if not any(part.startswith(".") for part in p.parts[:-1])]
    return sorted(str(p) for p in paths if not set(p.parts) & set(TIMED) and CLOCKED not in p.stem)


def _same(one: Path, other: Path) -> bool:
    if one.read_bytes() == other.read_bytes():
        return True
    if one.suffix == ".nc":  # HDF5 lays the same values out differently
        with xr.open_datatree(one) as a, xr.open_datatree(other) as b:
            return a.load().identical(b.load())
    return False


def main() -> None:
    """`python -m tests.trees ONE OTHER`: print the differences; 1 if there are some."""
    found = differences(*map(Path, sys.argv[1:3]))
    print("\n".join(found) or "the same")
    sys.exit(bool(found))


if __name__ == "__main__":
    main()
