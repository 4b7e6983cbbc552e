"""The code blocks of the README and of docs/*.md: what each is, and how a page runs.

A page is one program: its blocks run in their order, in one namespace and one folder.

- ``python`` is run. ``sh`` is run where each command is an `imuarray` one, so other commands must
  be marked.
  `# status 3` in it says that what they give is not to be trusted, and why the page shows it.
- A block under a line that is a file's name alone, as code, is that file.
- ``text`` right below a block that has run is what it printed, numbers to within a fifth;
  elsewhere it is a drawing.
- ``<!-- not run: reason -->`` on the line before a block leaves it out, ``<!-- source: path -->``
  says that it stands in that file as it is.

`python -m tests.doc_pages docs/tutorial_simulated.md --figures docs/images` runs a page and keeps
the figures that it draws.
"""

import argparse
import contextlib
import io
import math
import os
import re
import shlex
import shutil
import tempfile
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
PAGES = (ROOT / "README.md", *sorted((ROOT / "docs").glob("*.md")))

FENCE = re.compile(r"^(?P<indent> *)(?P<ticks>```+|~~~+) *(?P<language>[^\s`]*)(?P<rest>.*)$")
MARK = re.compile(r"^<!-- (?P<kind>not run|source): (?P<text>.+) -->$")
UNTRUSTED = "# status 3"  # what a command of such a block gives is not to be trusted
FILE = re.compile(r"^`([\w.-]+)`$")
NUMBER = re.compile(r"(?<![\w.])[-+]?\d+(?:\.\d+)?(?:e[-+]?\d+)?")


@dataclass(frozen=True)
class Block:
    """A fenced block; ``kind`` is python, sh, file, output, text, not run or source."""

    page: Path
    line: int  # of its first line of code
    language: str
    kind: str
    note: str  # the file's name, the reason why it is not run, or where it stands
    text: str

    @property
    def where(self) -> str:
        """For messages."""
        return f"{self.page.relative_to(ROOT)}:{self.line}"


def blocks(page: Path) -> list[Block]:
    """The page's fenced blocks; ValueError for one that is nothing of what a page may have."""
    found, before, opened, text = [], "", None, []
    for number, line in enumerate(page.read_text(encoding="utf-8").splitlines(), start=1):
        fence = FENCE.match(line)
        if opened is None and fence:
            opened, start, text = fence, number + 1, []
        elif opened is None:
            before = line.strip() or before
        elif fence and fence["ticks"] == opened["ticks"] and not fence["language"]:
            code = "".join(f"{row[len(opened['indent']) :]}\n" for row in text)
            kind, note = _kind(opened["language"], before, f"{page.name}:{start - 1}")
            found.append(Block(page, start, opened["language"], kind, note, code))
            opened, before = None, ""
        else:
            text.append(line)
    if opened is not None:
        raise ValueError(f"{page.name}:{start - 1}: expected the block to end, found it open")
    return found


def _kind(language: str, before: str, where: str) -> tuple[str, str]:
    """(kind, note) of a block with the line ``before`` above it."""
    if mark := MARK.match(before):
        return mark["kind"], mark["text"]
    if name := FILE.match(before):
        return "file", name[1]
    if language == "text" and not before:  # nothing between it and the block above
        return "output", ""
    if language in ("python", "sh", "text"):
        return language, ""
    raise ValueError(
        f"{where}: expected python, sh, text, a file or <!-- not run: reason -->, found a block of"
        f" {language or 'no language'}"
    )


def commands(text: str) -> Iterator[str]:
    """The command lines of a shell block, continued ones joined, comments dropped."""
    for line in text.replace("\\\n", " ").splitlines():
        words = shlex.split(line, comments=True)
        if words:
            yield shlex.join(words)


def parsed(command: str):
    """(parser, arguments) of a command of the tool or of the papers; None for another."""
    from imuarray.commands.parser import make_parser
    from imuarray_papers.__main__ import papers_parser

    words = shlex.split(command)
    if words[0] == "imuarray":
        return make_parser(), words[1:]
    if words[:3] == ["python", "-m", "imuarray_papers"]:
        return papers_parser(), words[3:]
    return None


def run(page: Path) -> None:
    """Run a page's blocks in the current folder; an error has the page's line."""
    namespace, printed = {"__name__": "__main__"}, None
    for block in blocks(page):
        if block.kind == "file":
            Path(block.note).write_text(block.text, encoding="utf-8")
        elif block.kind in ("python", "sh"):
            output = io.StringIO()
            with contextlib.redirect_stdout(output):
                (_run_python if block.kind == "python" else _run_shell)(block, namespace)
            printed = output.getvalue()
        elif block.kind == "output" and printed is not None:
            compare(block, printed)
        if block.kind not in ("python", "sh"):
            printed = None


def _run_python(block: Block, namespace: dict) -> None:
    code = "\n" * (block.line - 1) + block.text
    exec(compile(code, str(block.page), "exec"), namespace)


def _run_shell(block: Block, namespace: dict) -> None:
    from imuarray.cli import main

    for command in commands(block.text):
        found = parsed(command)
        if found is None:
            raise ValueError(f"{block.where}: expected imuarray commands, found {command}")
        expected = 3 if UNTRUSTED in block.text else 0
        parser, arguments = found
        if (status := main(arguments, parser)) != expected:
            raise ValueError(
                f"{block.where}: expected status {expected}, found {status}: {command}"
            )


def compare(block: Block, printed: str) -> None:
    """What the page shows against what was printed: words as they are, numbers to a fifth."""
    same = [NUMBER.sub("#", text).split() for text in (block.text, printed)]
    numbers = [NUMBER.findall(text) for text in (block.text, printed)]
    close = len(numbers[0]) == len(numbers[1]) and all(map(_close, *numbers))
    if same[0] != same[1] or not close:
        raise ValueError(f"{block.where}: the page shows\n{block.text}and this was\n{printed}")


def _close(shown: str, printed: str) -> bool:
    """Within a fifth, or two of the last digit shown."""
    digits = len(shown.partition("e")[0].partition(".")[2])
    last = 10.0 ** (-digits + int(shown.partition("e")[2] or 0))
    return math.isclose(float(shown), float(printed), rel_tol=0.2, abs_tol=2 * last)


def main() -> None:
    """Run one page in a folder of its own."""
    parser = argparse.ArgumentParser(description=main.__doc__)
    parser.add_argument("page", type=Path)
    parser.add_argument("--figures", type=Path, help="where to keep the page's figures")
    arguments = parser.parse_args()
    page = arguments.page.resolve()
    figures = arguments.figures and arguments.figures.resolve()
    with tempfile.TemporaryDirectory() as name:
        os.chdir(name)
        run(page)
        for drawn in sorted(Path(name).glob("*.png")) if figures else ():
            shutil.copyfile(drawn, figures / drawn.name)
        os.chdir(ROOT)


if __name__ == "__main__":
    main()
