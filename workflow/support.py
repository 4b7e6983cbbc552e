"""What the rules share: effective settings and the library files a rule rests on."""

import json
import time
from pathlib import Path

import imuarray

PACKAGE = Path(imuarray.__file__).parent

BASE = ("config.py", "errors.py", "provenance.py", "streams.py")  # under every stage

# Every stage rests on those before it: the package's folders are the path of the data.
STAGES = {
    "simulation": ("geometry", "motion", "model", "simulation", "recording", "studies"),
    "estimation": ("estimation",),
    "posterior": ("posterior",),
    "measured": ("firstorder", "measured"),
    "figures": ("figures",),
    "claims": ("claims",),
}
# The blind study's, which the papers' figures do not rest on, and of these the grading, which
# the diagnoses do not rest on.
DIAGNOSING = ("geometry", "motion", "model", "recording", "estimation", "criticism", "blind")
GRADING = ("grade.py", "summary.py", "bars.py")


def library(stage: str) -> list[str]:
    """Source files of ``stage`` and the stages before it (figures and claims: theirs alone)."""
    if stage in ("figures", "claims"):
        folders = list(STAGES[stage])
    else:
        folders = []
        for name, members in STAGES.items():
            folders.extend(members)
            if name == stage:
                break
    files = [path for folder in folders for path in (PACKAGE / folder).glob("*.py")]
    files = [path for path in files if not path.name.startswith("blind")]
    return sorted(str(path) for path in [*files, *(PACKAGE / name for name in BASE)])


def diagnosing() -> list[str]:
    """Source files and thresholds that the blind study's diagnoses rest on."""
    files = [path for name in DIAGNOSING for path in (PACKAGE / name).glob("*.py")]
    apart = [PACKAGE / "blind" / name for name in GRADING]
    files = [path for path in files if path not in apart]
    files.append(PACKAGE / "criticism" / "thresholds.json")
    return sorted(str(path) for path in [*files, *(PACKAGE / name for name in BASE)])


def grading(*figures: str) -> list[str]:
    """Source files that the blind study's grades and tables rest on, and files of figures/."""
    files = [PACKAGE / "blind" / name for name in GRADING]
    files += [PACKAGE / "figures" / name for name in figures]
    return sorted(str(path) for path in [*files, *(PACKAGE / name for name in BASE)])


def attempt(path: str) -> float:
    """A parameter that changes with every run while recordings are missing, so they are retried."""
    try:
        missing = json.loads(Path(path).read_text(encoding="utf-8"))["missing"]
    except (OSError, ValueError, KeyError):
        return 0.0
    return time.time() if missing else 0.0


def effective(config: dict, scale: str, *sections: str, scaled: bool = True) -> dict:
    """The part of the configuration a rule depends on, with one scale resolved.

    Without the number of threads, which no result depends on, and the blind study's keys, which
    only its own do; ``scaled=False`` leaves the scale out, for results that all scales share.
    """
    names = ("seed", "array", "noise", *sections)
    if not scaled:
        return {name: config[name] for name in names}
    sizes = {
        key: value
        for key, value in config["scales"][scale].items()
        if key != "threads" and not key.startswith("blind_")
    }
    return {**{name: config[name] for name in names}, "scale": {"name": scale, **sizes}}


def blind_settings(config: dict, scale: str) -> dict:
    """The part of the configuration that the blind study depends on: it has scenes of its own."""
    cases = config["scales"][scale]["blind_cases"]
    return {"seed": config["seed"], "scale": {"name": scale, "cases": cases}}
