"""What the pages are made of: drawings as they embed them, and the templates filled in."""

from __future__ import annotations

import base64
import io
from typing import NamedTuple

import pandas as pd
from jinja2 import Environment, PackageLoader, StrictUndefined
from matplotlib.figure import Figure

import imuarray
from imuarray.diagnosis.quantities import (
    fixed,
    number,
    plus_minus,
    probability,
    quantity,
    symbols,
    unit_shown,
)
from imuarray.diagnosis.words import part_in_words, split_name, whose, words
from imuarray.figures.style import styled

# What the templates' tables call.
IN_TABLES = (fixed, number, part_in_words, plus_minus, probability, quantity, split_name, symbols,
             unit_shown, whose, words)  # fmt: skip


class Drawing(NamedTuple):
    """A figure's name, texts and files by suffix."""

    name: str
    title: str
    caption: str
    files: dict[str, bytes]

    @property
    def base64(self) -> str:
        """The PNG as a page embeds it."""
        return base64.b64encode(self.files["png"]).decode("ascii")


@styled
def saved(figure: Figure, suffix: str = "png") -> bytes:
    """A figure as a file, the same bytes each time."""
    buffer = io.BytesIO()
    metadata = {"pdf": {"CreationDate": None}, "png": {"Software": None}}[suffix]
    figure.savefig(buffer, format=suffix, metadata=metadata)
    figure.set_layout_engine("none")  # laid out once
    return buffer.getvalue()


def files(figure: Figure, table: pd.DataFrame) -> dict[str, bytes]:
    """A figure as PDF and PNG, and its numbers as CSV."""
    table_bytes = table.to_csv(index=False, lineterminator="\n").encode()
    return {"csv": table_bytes} | {suffix: saved(figure, suffix) for suffix in ("pdf", "png")}


def rendered(template: str, **given) -> str:
    """A page, every text in it escaped."""
    environment = Environment(
        loader=PackageLoader("imuarray.report", "."), undefined=StrictUndefined, autoescape=True
    )
    environment.globals |= {function.__name__: function for function in IN_TABLES}
    return environment.get_template(template).render(version=imuarray.__version__, **given)
