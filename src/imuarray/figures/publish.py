"""From a rule's input files to those of its figure or table."""

import inspect
import json
from collections.abc import Callable
from pathlib import Path

import pandas as pd

from imuarray.figures.style import write_figure
from imuarray.figures.tables import write_table

READERS = {
    ".csv": pd.read_csv,
    ".json": lambda path: json.loads(Path(path).read_text(encoding="utf-8")),
}


def _read(path: str):
    return READERS[Path(path).suffix](path)


def publish(function: Callable, snakemake, **readers: Callable) -> None:
    """Draw a figure (PDF, PNG, CSV) or make a table (CSV, LaTeX, Markdown) and write it.

    ``function`` gives (figure, table), or what `tables.write_table` takes if its name begins with
    "table". It is given what it asks for by name: the rule's input files, read by `READERS` or by
    the one of ``readers`` for that name, its parameters and its wildcards.
    """
    wanted = inspect.signature(function).parameters
    sources = (snakemake.wildcards, snakemake.params)
    given = {key: value for source in sources for key, value in source.items()}
    for key, paths in snakemake.input.items():
        if key in wanted:
            read = readers.get(key, _read)
            given[key] = read(paths) if isinstance(paths, str) else [read(path) for path in paths]
    write = write_table if function.__name__.startswith("table") else write_figure
    made = function(**{key: value for key, value in given.items() if key in wanted})
    write(*made, **dict(snakemake.output.items()))
