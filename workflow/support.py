"""What the rules share: effective settings and the library files a rule rests on."""

from pathlib import Path

import imuarray

PACKAGE = Path(imuarray.__file__).parent

BASE = ("config.py", "errors.py", "provenance.py", "streams.py")  # under every stage

# Every stage rests on those before it: the package's folders are the path of the data.
STAGES = {
    "simulation": ("geometry", "motion", "model", "simulation", "recording", "studies"),
    "estimation": ("estimation",),
    "posterior": ("posterior",),
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


def effective(config: dict, scale: str, *sections: str) -> dict:
    """The part of the configuration a rule depends on, with one scale resolved.

    Without the number of threads, which no result depends on.
    """
    names = ("seed", "array", "noise", *sections)
    sizes = {key: value for key, value in config["scales"][scale].items() if key != "threads"}
    return {**{name: config[name] for name in names}, "scale": {"name": scale, **sizes}}
