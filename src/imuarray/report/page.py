"""Parts of the pages: drawings as they embed them, and the templates filled in."""

import base64
import html
import re
from functools import partial
from typing import NamedTuple

import pandas as pd
import xarray as xr
from jinja2 import Environment, PackageLoader, StrictUndefined
from matplotlib.figure import Figure

import imuarray
from imuarray import words
from imuarray.errors import numbered
from imuarray.model.effects import KINDS
from imuarray.pictures import board as pictures
from imuarray.pictures.style import PAGE, new_figure, saved, styled
from imuarray.recording import Recording

# Pictures of a calibration: height, one drawing each panel, the variables shown, title, caption.
PICTURES = {
    "board": (
        3.1, [partial(pictures.board, plane=plane) for plane in ("xy", "xz")],
        ["nominal_position", "position"],
        "The board, drawn and found",
        "Crosses: where the drawing has each IMU. Arrows: to where it was found. Ellipses: 95 %."
        " Both are enlarged as the titles say, or they could not be seen.",
    ),
    "timeline": (
        2.6, [pictures.timeline], ["shaken"],
        "The recording",
        "Still poses calibrate each sensor, fast motion tells where it is. Samples at a rail are"
        " left out of the positions; shocks are samples in which several IMUs are far off at once.",
    ),
    "sphere": (
        3.4, [pictures.sphere], ["angular_rate"],
        "Excitation",
        "Directions in the board's frame, from +z (left) and from −z. Poses ought to be all over"
        " the sphere, axes of rotation too.",
    ),
    "length": (
        2.5, [pictures.length], ["position_sd_by_length"],
        "Standard deviation against recorded time",
        "Claimed standard deviation, had the motion ended earlier. Where it falls faster than"
        " 1/√length, the motion is getting better; where as fast, four times as long a motion"
        " halves the error; where it is level, noise is not what limits it.",
    ),
    "course": (
        2.4, [partial(pictures.residual_course, kind=kind) for kind in KINDS],
        [f"{kind}_residual" for kind in KINDS],
        "Residual against time",
        "Of each IMU, in sds of the declared noise (after first order, of the still poses'): 1 is"
        " noise. The three largest are named. A rise that lasts is something that moved, warmed up"
        " or came loose.",
    ),
}  # fmt: skip
OF_RECORDING = ("timeline", "sphere")  # which are of the recording, too
SUFFIXES = ("pdf", "png", "csv")


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
def pictured(
    recording: Recording, calibration: xr.Dataset, names, footer=(), suffixes=SUFFIXES
) -> list[Drawing]:
    """Pictures of a calibration and the recording that it is from."""
    found = []
    for name in names:
        height, parts, shown, title, caption = PICTURES[name]
        given = (recording, calibration) if name in OF_RECORDING else (calibration,)
        if name == "sphere":
            caption = f"{caption} {pictures.shown(recording, calibration)}"
        figure = new_figure(footer, PAGE, height)
        panels = figure.subplots(1, len(parts), squeeze=False)[0]
        for part, axes in zip(parts, panels, strict=True):
            part(*given, axes=axes)
        table = pd.concat([calibration[each].to_dataframe() for each in shown], axis=1)
        drawn = files(figure, table.reset_index(), suffixes)
        found.append(Drawing(name, title, caption, drawn))
    return found


def files(figure: Figure, table: pd.DataFrame, suffixes=SUFFIXES) -> dict[str, bytes]:
    """A figure as PDF and PNG, and its numbers as CSV."""
    numbers = table.to_csv(index=False, lineterminator="\n").encode()
    return {one: numbers if one == "csv" else saved(figure, one) for one in suffixes}


def marked(text: str) -> str:
    """Text as HTML, `commands` as code."""
    return re.sub(r"`([^`]+)`", r"<code>\1</code>", html.escape(text))


def rendered(template: str, **given) -> str:
    """A page, every text in it escaped."""
    environment = Environment(
        loader=PackageLoader("imuarray.report", "."), undefined=StrictUndefined, autoescape=True
    )
    environment.filters |= {"numbered": numbered, "marked": marked}
    environment.globals |= vars(words)  # which the tables call
    return environment.get_template(template).render(version=imuarray.__version__, **given)
