"""From a rule's input files to those of its figure or table."""

import inspect
import json
from functools import partial
from importlib import import_module
from pathlib import Path

import pandas as pd

from imuarray.posterior.chains import read_chains
from imuarray.recording import array_of, load_dataset, read_recording
from imuarray_papers.figures.style import write_figure, write_table


def _diagnosis(path: str) -> tuple[dict, dict[str, pd.DataFrame]]:
    """diagnosis.json, and the tables beside it by name."""
    tables = {each.stem: pd.read_csv(each) for each in Path(path).parent.glob("*.csv")}
    return json.loads(Path(path).read_text(encoding="utf-8")), tables


# by an input's name, or else by its ending
READERS = {
    "chains": read_chains,
    "recordings": lambda path: array_of(read_recording(path)),
    "located": load_dataset,
    **dict.fromkeys(("diagnosis", "diagnoses", "controls"), _diagnosis),
    ".csv": pd.read_csv,
    ".json": lambda path: json.loads(Path(path).read_text(encoding="utf-8")),
}


def publish(snakemake) -> None:
    """Draw a figure (PDF, PNG, CSV) or make a table (CSV, LaTeX, Markdown) and write it.

    The rule's parameter ``by`` names a function of the package, such as "figures.measured.allan".
    It gives (drawing function, table), or (table, words of its notes) if its name begins with
    "table"; the rest of the name is its place in tables.yaml. It is given what it asks for by name:
    the rule's input files, read by `READERS`, its parameters and its wildcards.
    """
    module, _, name = snakemake.params.by.rpartition(".")
    function = getattr(import_module(f"imuarray_papers.{module}"), name)
    wanted = inspect.signature(function).parameters
    sources = (snakemake.wildcards, snakemake.params)
    given = {key: value for source in sources for key, value in source.items()}
    for key, paths in snakemake.input.items():
        if key in wanted:
            files = [paths] if isinstance(paths, str) else paths
            read = [READERS.get(key, READERS.get(Path(path).suffix))(path) for path in files]
            given[key] = read[0] if isinstance(paths, str) else read
    kind, _, own = name.partition("_")
    write = partial(write_table, own) if kind == "table" else write_figure
    made = function(**{key: value for key, value in given.items() if key in wanted})
    write(*made, **dict(snakemake.output.items()))
