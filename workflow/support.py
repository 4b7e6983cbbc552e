"""What the rules share: effective settings and the library files a rule rests on."""

import ast
import hashlib
import json
import threading
import time
from collections.abc import Iterator
from functools import cache
from pathlib import Path

import imuarray

PACKAGE = Path(imuarray.__file__).parent

BASE = ("compiled.py", "config.py", "errors.py", "provenance.py", "streams.py")  # under every stage

APART = ("blind_", "theory_", "validation_")  # sizes of targets that nothing else rests on
CREWS = ("threads", "parts")  # how work is shared: no result depends on it

# Files that nothing of the papers rests on: theory and validation.
ASIDE = ("blind", "theory", "validation", "bound.", "calibrated", "joint", "levels",
         "truths")  # fmt: skip
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
    files = [path for path in files if not path.name.startswith(ASIDE)]
    return sorted(str(path) for path in [*files, *(PACKAGE / name for name in BASE)])


def resting_on(*names: str) -> list[str]:
    """The package's files ``names`` and all of its files that they import, however far down."""
    found, waiting = set(), [PACKAGE / name for name in names]
    while waiting:
        path = waiting.pop()
        if path not in found:
            found.add(path)
            waiting += imported(path) if path.suffix == ".py" else []
    return sorted(map(str, found))


@cache
def imported(path: Path) -> list[Path]:
    """Files of the package that a file of it imports, those of the packages on the way too."""
    names = []
    for node in _run(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.ImportFrom):
            names += [node.module, *(homes(node.module, alias.name) for alias in node.names)]
        elif isinstance(node, ast.Import):
            names += [alias.name for alias in node.names]
    parts = [name.split(".")[1:] for name in names if name.split(".")[0] == "imuarray"]
    steps = {PACKAGE.joinpath(*part[:depth]) for part in parts for depth in range(len(part) + 1)}
    files = [place for step in steps for place in (step / "__init__.py", step.with_suffix(".py"))]
    return [file for file in files if file.is_file() and PACKAGE in file.parents]


def homes(module: str, name: str) -> str:
    """The module of what another one gives, also where a package loads it when it is used."""
    home = _homes(module).get(name, name)
    return home if home.startswith("imuarray.") else f"{module}.{home}"


@cache
def _homes(module: str) -> dict[str, str]:
    """The table by which a package loads modules when they are used; empty for others."""
    place = PACKAGE.joinpath(*module.split(".")[1:]) / "__init__.py"
    if module.split(".")[0] == "imuarray" and place.is_file():
        for node in ast.parse(place.read_text(encoding="utf-8")).body:
            if isinstance(node, ast.Assign) and ast.unparse(node.targets[0]) == "_HOME":
                return ast.literal_eval(node.value)
    return {}


def _run(tree: ast.AST) -> Iterator[ast.AST]:
    """The nodes of a file but for those that only type checkers see."""
    for node in ast.iter_child_nodes(tree):
        if isinstance(node, ast.If) and ast.unparse(node.test) == "TYPE_CHECKING":
            continue
        yield node
        yield from _run(node)


class Crew:
    """How work is shared: among ``cores`` of this machine, or a cluster's (None)."""

    def __init__(self, config: dict, cores: int | None):
        self.scales, self.cores = config["scales"], cores

    def threads(self, scale: str) -> int:
        """Of a heavy job: at most half of the cores, or others wait through its serial parts."""
        wanted = self.scales[scale]["threads"]
        return wanted if self.cores is None else max(1, min(wanted, self.cores // 2))

    def parts(self, scale: str, study: str = "samples") -> int:
        """Jobs that the realisations of a study are dealt to; those but "samples" are small."""
        return self.scales[scale]["parts"] if study == "samples" else 1


def one_look_at_a_time(scheduler) -> None:
    """Keep Snakemake from looking for jobs to start ever more often.

    Because of its limit of starts a second it looks again a second after each look, and every job's
    end begins another such series: a hundred looks a second at last, half of a core.
    """
    pending = threading.Event()

    def look():
        pending.clear()
        scheduler._open_jobs.release()

    def later(delay):
        if not pending.is_set():
            pending.set()
            threading.Timer(delay, look).start()

    scheduler._schedule_reevalutation = later


def contents(*paths: str) -> list[str]:
    """SHA-256 of files outside the pipeline: a parameter that changes when one does."""
    files = [Path(path) for path in paths]
    return [hashlib.sha256(f.read_bytes()).hexdigest() if f.is_file() else "" for f in files]


def own_files(entry: dict) -> list[str]:
    """The files that a recording's entry in the configuration names."""
    return [entry[key] for key in ("file", "columns", "positions") if key in entry]


def attempt(path: str) -> float:
    """A parameter that changes with every run while recordings are missing, so they are retried."""
    try:
        missing = json.loads(Path(path).read_text(encoding="utf-8"))["missing"]
    except (OSError, ValueError, KeyError):
        return 0.0
    return time.time() if missing else 0.0


def effective(config: dict, scale: str, *sections: str, scaled: bool = True, own: str = "") -> dict:
    """The part of the configuration a rule depends on, with one scale resolved.

    Without the numbers of threads and parts, which no result depends on, and the keys that only
    the blind study or ``own`` targets (a prefix such as "theory_") depend on; ``scaled=False``
    leaves the scale out, for results that all scales share.
    """
    names = ("seed", "array", "noise", *sections)
    found = {name: config[name] for name in names}
    if "file" in config["array"]:  # results rest on what is in it
        found["array_contents"] = contents(config["array"]["file"])
    if not scaled:
        return found
    sizes = {
        key: value
        for key, value in config["scales"][scale].items()
        if key not in CREWS and (key.startswith(own) if own else not key.startswith(APART))
    }
    return {**found, "scale": {"name": scale, **sizes}}


def blind_settings(config: dict, scale: str) -> dict:
    """The part of the configuration that the blind study depends on: it has scenes of its own."""
    cases = config["scales"][scale]["blind_cases"]
    return {"seed": config["seed"], "scale": {"name": scale, "cases": cases}}
