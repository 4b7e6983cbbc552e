"""What made each file of paper_figures/, and whether its code is still the tree's.

``python workflow/published.py stale`` lists the files whose code has changed since they were made,
and says so in published.csv; ``begin`` removes those that came with a clone; ``write`` FILE...
states what has just made these files.
"""

import argparse
import csv
import hashlib
import io
import re
import subprocess
import sys
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import NamedTuple

from support import Sources

from imuarray.errors import InputError
from imuarray.provenance import write_bytes

ROOT = Path(__file__).parents[1]
MANIFEST = "paper_figures/published.csv"
BEGUN = "results/publishing_begun"  # in a folder that makes its files itself
CODE = ("src", "workflow", "config.yaml", "Snakefile")
COLUMNS = ("file", "current", "commit", "command", "scale", "sha256", "code", "scripts")
SCALES = {"quick", "default", "paper"}


class Made(NamedTuple):
    """How a file was made: by which rule, from which files; whether it is to be made again."""

    rule: str
    inputs: list[str]
    outdated: bool


def ancestry(summary: str) -> dict[str, Made]:
    """By file, how it was made, from what ``snakemake --detailed-summary`` prints."""
    table = csv.DictReader(io.StringIO(summary), delimiter="\t", quoting=csv.QUOTE_NONE)
    return {
        row["output_file"]: Made(
            row["rule"], row["input-file(s)"].split(","), row["plan"] == "update pending"
        )
        for row in table
    }


def origin(file: str, made: Mapping[str, Made], known: Iterable[str] = ()) -> set[str]:
    """A file and all that it was made from, of what rules have made, back to what is ``known``."""
    found, ahead = set(), {file}
    while ahead:
        found |= ahead
        further = {name for one in ahead - set(known) for name in made[one].inputs}
        ahead = {name for name in further if name in made} - found
    return found


def scripts() -> dict[str, str]:
    """By rule, the script that it runs."""
    rules = "".join(
        path.read_text(encoding="utf-8") for path in sorted((ROOT / "workflow/rules").glob("*.smk"))
    )
    found = {}
    for block in re.split(r"(?m)^(?:rule|checkpoint|use rule) ", rules)[1:]:
        name, _, heir = block.partition(":")[0].removesuffix(" with").partition(" as ")
        if script := re.search(r"scripts/(\w+)\.py", block):
            found[name] = script[1]
        if heir and name in found:
            found[heir] = found[name]
    return found


def entry(
    file: str, made: Mapping[str, Made], by_rule: Mapping[str, str], sources: Sources,
    stated: Iterable[Mapping] = (),
) -> dict:  # fmt: skip
    """A file's row, but for the commit; ``by_rule`` as from `scripts`.

    Published files that it is made from, and whose rows are ``stated``, need not be made again.

    Raises InputError where the tree's code would make something else of what it rests on, and where
    no rule made it in this folder.
    """
    if made[file].inputs == ["-"]:
        raise InputError(f"{file}: expected a file that a rule has made here, found one of a clone")
    known = {name: row for row in stated if (name := f"paper_figures/{row['file']}") != file}
    back = origin(file, made, known)
    own, taken = back - set(known), [known[name] for name in back & set(known)]
    if outdated := sorted(name for name in own if made[name].outdated):
        raise InputError(f"{file}: expected it up to date, found {outdated[0]} to be made again")
    used = {by_rule[made[name].rule] for name in own if made[name].rule in by_rule}
    names = sorted(used.union(*(row["scripts"].split() for row in taken)))
    scales = {part for name in own for part in name.split("/")}
    scales = scales.union(*(row["scale"].split() for row in taken))
    return {
        "file": Path(file).name,
        "current": "yes",
        "command": f"snakemake --cores 2 -- {file}",
        "scale": " ".join(sorted(SCALES & scales)),
        "sha256": hashlib.sha256(Path(file).read_bytes()).hexdigest(),
        "code": sources.digest(*names),
        "scripts": " ".join(names),
    }


def commit() -> str:
    """The tree's commit; InputError where the code has changes that are in none."""
    if _run("git", "status", "--porcelain", "--", *CODE, cwd=ROOT):
        raise InputError("published: expected code as committed, found changes: git status")
    return _run("git", "rev-parse", "HEAD", cwd=ROOT).strip()


def summary(snakefile: str, scale: str, files: Iterable[str]) -> str:
    """What Snakemake knows of the files and of all that they rest on."""
    options = ["--workflow-profile", "none", "--cores", "1", "--config", f"scale={scale}"]
    return _run("snakemake", "-s", snakefile, *options, "--detailed-summary", "--", *files)


def _run(*command: str, **options) -> str:
    return subprocess.run(command, check=True, stdout=subprocess.PIPE, text=True, **options).stdout


def read(text: str) -> list[dict]:
    """The manifest's rows."""
    return list(csv.DictReader(io.StringIO(text)))


def write(rows: Iterable[Mapping], path: str | Path) -> None:
    """The manifest."""
    text = io.StringIO()
    table = csv.DictWriter(text, COLUMNS, lineterminator="\n")
    table.writeheader()
    table.writerows(sorted(rows, key=lambda row: row["file"]))
    write_bytes(text.getvalue().encode(), path)


def changed(rows: Iterable[Mapping], sources: Sources) -> list[str]:
    """Files that the manifest calls current, and whose code is not what it says."""
    rows = [row for row in rows if row["current"] == "yes"]
    digests = {names: sources.digest(*names.split()) for names in {row["scripts"] for row in rows}}
    return [row["file"] for row in rows if digests[row["scripts"]] != row["code"]]


def begin() -> None:
    """Remove published files that came with a clone: without a record Snakemake keeps them."""
    if Path(BEGUN).exists():
        return
    for row in read(Path(MANIFEST).read_text(encoding="utf-8")):
        Path(MANIFEST).with_name(row["file"]).unlink(missing_ok=True)
    Path(BEGUN).touch()


def mark() -> None:
    """Say in the manifest which files are stale, and list all that are."""
    rows = read((ROOT / MANIFEST).read_text(encoding="utf-8"))
    found = changed(rows, Sources())
    for row in rows:
        row["current"] = "no" if row["file"] in found else row["current"]
        if row["current"] == "no":
            print(f"{row['file']}: of commit {row['commit'][:7]}, its code has changed since")
    write(rows, ROOT / MANIFEST)


def _sum(manifest: Path, name: str) -> str:
    return hashlib.sha256(manifest.with_name(name).read_bytes()).hexdigest()


def state(files: Iterable[str], made_at: str, made: Mapping) -> None:
    """Write the rows of ``files``; those of other files that are there stay."""
    path, sources, by_rule = Path(MANIFEST), Sources(), scripts()
    rows = read(path.read_text(encoding="utf-8")) if path.exists() else []
    found = {row["file"]: row for row in rows if path.with_name(row["file"]).exists()}
    old = {*changed(found.values(), sources), *(Path(file).name for file in files)}
    stated = [
        row for name, row in found.items()
        if name not in old and row["current"] == "yes" and row["sha256"] == _sum(path, name)
    ]  # fmt: skip
    found |= {
        Path(file).name: entry(file, made, by_rule, sources, stated) | {"commit": made_at}
        for file in files
    }
    write(found.values(), path)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    verbs = parser.add_subparsers(dest="verb", required=True)
    verbs.add_parser("stale")
    verbs.add_parser("begin")
    writing = verbs.add_parser("write")
    writing.add_argument("--snakefile", default=str(ROOT / "Snakefile"))
    writing.add_argument("--scale", default="default")
    writing.add_argument("files", nargs="+")
    given = parser.parse_args()
    if given.verb == "stale":
        return mark()
    if given.verb == "begin":
        return begin()
    state(given.files, commit(), ancestry(summary(given.snakefile, given.scale, given.files)))


if __name__ == "__main__":
    try:
        main()
    except InputError as error:
        print(f"imuarray: {error}", file=sys.stderr)
        sys.exit(2)
