"""The files that the workflow rests on: where they are, and a script's as a digest."""

import ast
import json
import os
import sys
from collections.abc import Callable
from functools import cache, cached_property
from pathlib import Path
from typing import Any

from snakemake.sourcecache import LocalGitFile

import imuarray
from imuarray.provenance import digest

ROOT = Path(imuarray.__file__).parents[1]
PACKAGES = "imuarray", "imuarray_papers"
DOCUMENTED = (ast.Module, ast.ClassDef, ast.FunctionDef, ast.AsyncFunctionDef)


class Sources:
    """The files that scripts rest on, from the package's graph of imports.

    ``read`` gives a script's text by its name.
    """

    def __init__(self, read: Callable[[str], str]):
        self.read = read

    @cached_property
    def graph(self):
        import grimp

        graph = grimp.build_graph(*PACKAGES, exclude_type_checking_imports=True, cache_dir=None)
        for module in graph.modules - set(PACKAGES):  # its packages run before it
            graph.add_import(importer=module, imported=module.rpartition(".")[0])
        return graph

    def files(self, script: str, *more: str) -> dict[str, Path]:
        """By name, files of the modules that a script imports, and of ``more``, with their data."""
        own = {name for name in _imported(self.read(script)) if name in self.graph.modules}
        own |= set(more)
        own -= {"imuarray_papers.pipeline.job"}  # which only logs
        modules = own.union(*map(self.graph.find_upstream_modules, own))
        return {name: path for module in modules for name, path in _places(module).items()}

    def digest(self, script: str, *more: str) -> str:
        """SHA-256 of a script, of what it imports and of ``more`` modules.

        Of Python counts what it does: comments, layout and docstrings make no difference.
        """
        files = {name: _content(path) for name, path in self.files(script, *more).items()}
        return digest(_shape(ast.parse(self.read(script))), files)


def _imported(text: str) -> set[str]:
    """Imports of a script: modules, and names in them, which may be modules."""
    found = [node for node in ast.walk(ast.parse(text)) if isinstance(node, ast.ImportFrom)]
    names = {f"{node.module}.{alias.name}" for node in found for alias in node.names}
    return names | {node.module for node in found}


@cache
def _places(module: str) -> dict[str, Path]:
    """A module's file; with a package, the data in its folder."""
    place = ROOT.joinpath(*module.split("."))
    files = [place / "__init__.py" if place.is_dir() else place.with_suffix(".py")]
    if place.is_dir() and module not in PACKAGES:
        found = (path for path in place.rglob("*.*") if "__pycache__" not in path.parts)
        files += [path for path in found if path.is_file() and path.suffix != ".py"]
    return {path.relative_to(ROOT).as_posix(): path for path in files}


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


class Home:
    """Where the workflow's own files are: a folder, or a repository that Snakemake reads from afar.

    ``folder``: what Snakemake calls the basedir of the main Snakefile, workflow/.
    """

    def __init__(self, folder):
        self.folder = folder
        self.is_local = getattr(folder, "is_local", True) and not isinstance(folder, LocalGitFile)
        if isinstance(folder, LocalGitFile):
            LocalGitFile.join = _joined

    def recording(self, path: str) -> str:
        """A recording's file: in the working directory, or else one that came with the workflow.

        Ends with one line and status 2 where there is none.
        """
        if os.path.exists(path):
            return path
        if not self.is_local and path.startswith("data/"):
            return f"results/measured/data/{path}"
        beside = Path(str(self.folder)).resolve().parent / path
        if self.is_local and beside.exists():
            return os.path.relpath(beside)
        print(f"imuarray: {path}: expected a file to read, found none", file=sys.stderr)
        sys.exit(2)

    def blob(self, path: str) -> str:
        """The command that prints a file of the repository: Snakemake's copies are text."""
        repository = getattr(self.folder, "repo_path", None) or self.folder.hosted_repo.repo_clone
        return f"git -C '{os.path.abspath(repository)}' cat-file blob '{self.folder.ref}:{path}'"


def _joined(folder, path, join=LocalGitFile.join):
    """Snakemake 9.27 joins texts only, but gives itself a path that is none (git+file)."""
    return join(folder, str(path))
