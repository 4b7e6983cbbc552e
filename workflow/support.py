"""What the rules share: effective settings, digests of the sources a rule rests on, outputs."""

import ast
import hashlib
import json
import re
import time
from functools import cache
from pathlib import Path
from typing import Any

import grimp
from snakemake.io import report

import imuarray
from imuarray.provenance import digest

ROOT = Path(__file__).parents[1]
ROOTS = {"imuarray": Path(imuarray.__file__).parents[1], "scripts": Path(__file__).parent}

APART = ("blind_", "theory_", "validation_")  # sizes of targets that nothing else rests on
DOCUMENTED = (ast.Module, ast.ClassDef, ast.FunctionDef, ast.AsyncFunctionDef)
SHARING = ("threads", "parts")  # how work is shared: no result depends on it


class Sources:
    """The source files that each script rests on, from the graph of imports."""

    def __init__(self):
        # while workflow/ is on Python's path, the folder of scripts is a package like any other
        self.graph = grimp.build_graph(*ROOTS, exclude_type_checking_imports=True, cache_dir=None)
        for module in self.graph.find_descendants("imuarray"):  # its packages run before it
            self.graph.add_import(importer=module, imported=module.rpartition(".")[0])
        siblings = self.graph.find_descendants("scripts") - {"scripts.job"}  # which only logs
        for module in siblings:  # they import each other by bare names
            for imported in siblings & _bare_imports(module):
                self.graph.add_import(importer=module, imported=imported)

    def files(self, *scripts: str) -> dict[str, Path]:
        """By name, ``scripts`` and all that they import, and the data beside those modules."""
        names = {f"scripts.{name}" for name in scripts}
        modules = names.union(*map(self.graph.find_upstream_modules, names))
        return {name: path for module in modules for name, path in _places(module).items()}

    def digest(self, *scripts: str) -> str:
        """SHA-256 of the files' names and contents: a parameter that changes when one does.

        Of Python counts what it does: comments, layout and docstrings make no difference.
        """
        return digest({name: _content(path) for name, path in self.files(*scripts).items()})


@cache
def _places(module: str) -> dict[str, Path]:
    """A module's file; with a package, the data in its folder; with a script, its Typst pages."""
    root = ROOTS[module.partition(".")[0]]
    place = root.joinpath(*module.split("."))
    files = [place / "__init__.py" if place.is_dir() else place.with_suffix(".py")]
    files += place.parent.glob(f"{place.name}*.typ")
    if place.is_dir() and module not in ROOTS:
        found = (path for path in place.rglob("*.*") if "__pycache__" not in path.parts)
        files += [path for path in found if path.is_file() and path.suffix != ".py"]
    return {path.relative_to(root).as_posix(): path for path in files}


def _bare_imports(script: str) -> set[str]:
    """Modules of scripts/, and others, that a script imports from."""
    path = ROOT.joinpath("workflow", *script.split(".")).with_suffix(".py")
    tree = ast.parse(path.read_text(encoding="utf-8"))
    found = (node for node in ast.walk(tree) if isinstance(node, ast.ImportFrom))
    return {f"scripts.{node.module}" for node in found}


@cache
def _content(path: Path) -> str:
    """A file's text; of Python, its syntax tree without docstrings."""
    text = path.read_text(encoding="utf-8")
    return json.dumps(_shape(ast.parse(text))) if path.suffix == ".py" else text


def _shape(node: Any) -> Any:
    """A syntax tree as lists, the same from every version of Python."""
    if isinstance(node, ast.AST):
        fields = {name: value for name, value in ast.iter_fields(node) if value not in (None, [])}
        if isinstance(node, DOCUMENTED) and ast.get_docstring(node, clean=False) is not None:
            fields["body"] = node.body[1:]
        return [type(node).__name__, *([name, _shape(value)] for name, value in fields.items())]
    return [_shape(item) for item in node] if isinstance(node, list) else repr(node)


def figure(name: str, category: str, caption: str = "", folder: str = "results/{scale}") -> dict:
    """Outputs of a rule that draws: PDF, PNG for the report, and the numbers drawn."""
    path = f"{folder}/figures/{name}"
    caption = f"../report/{caption or name}.rst"
    png = report(f"{path}.png", caption=caption, category=category)
    return {"pdf": f"{path}.pdf", "png": png, "csv": f"{path}.csv"}


def table(
    name: str, category: str = "", caption: str = "", folder: str = "results/{scale}"
) -> dict:
    """Outputs of a rule that writes a table: CSV (in a report's category), LaTeX, Markdown."""
    path = f"{folder}/tables/{name}"
    csv = f"{path}.csv"
    if category:
        csv = report(csv, caption=f"../report/{caption or name}.rst", category=category)
    return {"csv": csv, "tex": f"{path}.tex", "md": f"{path}.md"}


class CoreBudget:
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


def added_effects() -> tuple[str, ...]:
    """Effects that are added to measured recordings; slow to import, so only where asked for."""
    from imuarray.blind.added import ADDED

    return tuple(ADDED)


def contents(*paths: str) -> list[str]:
    """SHA-256 of files outside the pipeline: a parameter that changes when one does."""
    files = [Path(path) for path in paths]
    return [hashlib.sha256(f.read_bytes()).hexdigest() if f.is_file() else "" for f in files]


def read_by(page: str) -> list[str]:
    """The files that a Typst page reads: published ones, the configuration, the citation."""
    folders = {"csv": "paper_figures/", "pdf": "paper_figures/", "yaml": "", "cff": f"{ROOT}/"}
    text = Path(page).read_text(encoding="utf-8")
    found = sorted(set(re.findall(r'"(\w+)\.(csv|pdf|yaml|cff)"', text)))
    return [f"{folders[kind]}{name}.{kind}" for name, kind in found]


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
        if key not in SHARING and (key.startswith(own) if own else not key.startswith(APART))
    }
    return {**found, "scale": {"name": scale, **sizes}}


def blind_settings(config: dict, scale: str) -> dict:
    """The part of the configuration that the blind study depends on: it has scenes of its own."""
    cases = config["scales"][scale]["blind_cases"]
    return {"seed": config["seed"], "scale": {"name": scale, "cases": cases}}
