"""paper_figures/: what each file there copies, and the configuration that it was made from.

A file that came with a clone has no record with Snakemake. Beside each is a JSON file with the
settings that it was made from: where the configuration at hand says the same, it is up to date.
"""

import json
import os
import re
import sys
from collections.abc import Iterable, Mapping
from pathlib import Path

from imuarray.provenance import write_json
from imuarray_papers.pipeline.recordings import Recordings
from imuarray_papers.pipeline.rules import blind_settings, effective

FOLDER = "paper_figures"
# By pattern of its name, what a published file copies and the sections of the configuration that
# it rests on; the first that fits counts.
PLACES = {
    "2017_fig2|2021_fig1": ("{scale}/figures/{name}", ""),
    r"2017_fig(\d)": ("{scale}/figures/{name}", "paper2017.fig{0}"),
    r"2021_fig[234]": ("{scale}/figures/{name}", "paper2021"),
    "2021_fig5": ("{scale}/figures/{name}", "paper2017 paper2021 experiment recordings"),
    "2021_table1": ("{scale}/tables/{name}", "paper2021"),
    "2021_table2": ("{scale}/tables/{name}", "paper2017 paper2021 experiment recordings"),
    "claims|claims_paper": ("{scale}/claims/claims", "paper2017 paper2021 experiment recordings"),
    "theory_(?:efficiency|convergence|size)": (
        "{scale}/figures/{name}", "paper2017 paper2021 theory"
    ),
    "theory_ranks": ("{scale}/tables/{name}", "paper2017 paper2021 theory"),
    "validation_ranks": ("{scale}/figures/{name}", "paper2021 validation"),
    "validation_coverage": ("{scale}/tables/{name}", "paper2021 validation"),
    "blind_confusion": ("blind/{scale}/figures/{name}", "blind"),
    "blind_bars": ("blind/{scale}/tables/{name}", "blind"),
    "diagnosis_.*": ("measured/tables/{name}", "measured"),
    "(?:causes|experiment|past_rail)_table_.*|left_out_.*": (
        "measured/tables/{name}", "measured"
    ),
    "past_rail_.*|experiment_.*": ("measured/figures/{name}", "measured"),
    "cause_.*": ("", "measured"),
    "measured_.*|criticism.*": ("", "measured"),
}  # fmt: skip


class Published:
    """Files of paper_figures/ under a configuration; ``recordings`` are its own."""

    def __init__(self, config: dict, recordings: Recordings):
        self.config, self.recordings = config, recordings
        self.said = set()  # of which files it was said that they came with the clone

    def scale(self, name: str) -> str:
        """The scale that a file is made at."""
        return "paper" if name == "claims_paper" else self.config["scale"]

    def origin(self, name: str, kind: str) -> str:
        """The file that paper_figures/<name>.<kind> copies."""
        copies = self.recordings.published()
        if name in copies:
            return f"results/measured/{copies[name]}.{kind}"
        return f"results/{_place(name)[0].format(scale=self.scale(name), name=name)}.{kind}"

    def files(self, kinds: Mapping[str, Iterable[str]]) -> list[str]:
        """Published files, endings ``kinds`` by name, and what they copy: all made here."""
        pairs = [(name, kind) for name, endings in kinds.items() for kind in endings]
        made = [self.origin(*pair) for pair in pairs if not pair[0].startswith("cause_")]
        return [*made, *(f"{FOLDER}/{name}.{kind}" for name, kind in pairs)]

    def settings(self, name: str) -> dict:
        """The part of the configuration that a published file rests on."""
        sections = _place(name)[1].split()
        if sections == ["blind"]:
            return blind_settings(self.config, self.scale(name))
        if sections == ["measured"]:  # of no scale
            return effective(self.config, "", "paper2021", "experiment", "recordings")
        return effective(self.config, self.scale(name), *sections)

    def stated(self, name: str, asked: Iterable[str] | None = ()) -> str:
        """A file with the `settings`: newer than what was made from others.

        It is older than all files where what came with the clone was made from the same; a line
        says so of those of ``asked`` that are not made here. With None it is only named.
        """
        path = Path(f"results/settings/{name}.json")
        if asked is None:
            return str(path)
        content = json.loads(json.dumps(self.settings(name)))
        if _read(path) != content:
            write_json(content, path)
            if _read(Path(FOLDER, path.name)) == content:
                os.utime(path, (0, 0))
        if path.stat().st_mtime == 0:
            self._say(name, asked)
        return str(path)

    def _say(self, name: str, asked: Iterable[str]) -> None:
        for target in sorted(
            x for x in map(Path, asked) if (x.parent.name, x.stem) == (FOLDER, name)
        ):
            made = "" if name.startswith("cause_") else self.origin(name, target.suffix[1:])
            if target not in self.said and target.exists() and not Path(made).is_file():
                self.said.add(target)
                again = f"; to make it here: snakemake --cores 2 {made}" if made else ""
                said = f"{target}: came with the clone, made from the configuration at hand{again}"
                print(said, file=sys.stderr)


def _place(name: str) -> tuple[str, str]:
    """Where a published file comes from, and sections of the configuration it rests on."""
    for pattern, (place, sections) in PLACES.items():
        if found := re.fullmatch(pattern, name):
            return place, sections.format(*found.groups())
    raise KeyError(name)


def _read(path: Path):
    try:
        return json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return None
