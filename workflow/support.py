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

    Without the number of threads, which no result depends on; ``scaled=False`` leaves the scale
    out, for results that all scales share.
    """
    names = ("seed", "array", "noise", *sections)
    if not scaled:
        return {name: config[name] for name in names}
    sizes = {key: value for key, value in config["scales"][scale].items() if key != "threads"}
    return {**{name: config[name] for name in names}, "scale": {"name": scale, **sizes}}
