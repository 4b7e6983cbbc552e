"""Output of a command: text for a person, or one JSON object for a program."""

import json
import sys
import time
from collections.abc import Sequence
from typing import Any, NamedTuple

from imuarray.errors import one_line, printable
from imuarray.provenance import finite


class Answer(NamedTuple):
    """A command's text for a person, its numbers (SI units, named in the keys), and its doubts.

    ``reasons``: sentences why it is not to be trusted (`imuarray.provenance.trust` puts them into
    the file); with any, `imuarray.cli.main` prints them as its last line and returns 3.
    """

    text: str
    document: dict[str, Any]
    reasons: Sequence[str] = ()


class Output:
    """Text on standard output, unless ``--quiet``; with ``--json`` one object at the end instead.

    Progress goes to standard error, and only ``--quiet`` stops it.
    """

    def __init__(self, arguments):
        self._start, self._out = time.monotonic(), str(arguments.out)
        self.json = bool(getattr(arguments, "json", False))
        self.progress = not arguments.quiet
        self.text = self.progress and not self.json

    def notify(self, text: str) -> None:
        """One remark, at once."""
        if self.text:
            print(printable(text), flush=True)

    def step(self, text: str) -> None:
        """Prints the next step, with the seconds so far, on standard error."""
        if self.progress:
            seconds = time.monotonic() - self._start
            print(f"{seconds:6.1f} s  {printable(text)}", file=sys.stderr, flush=True)

    def done(self, answer: Answer) -> list[str]:
        """The reasons, each in a line; prints the text, or the output's path and the numbers."""
        self.notify(answer.text)
        reasons = [one_line(reason) for reason in answer.reasons]
        if self.json:
            document = {"out": self._out} | finite(answer.document)
            verdict = {"trusted": not reasons, "reasons": reasons}
            print(json.dumps(document | verdict, allow_nan=False), flush=True)
        return reasons
