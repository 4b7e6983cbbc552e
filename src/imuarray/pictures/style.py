"""House style of figures: sizes, colours, looks of series, files of the same bytes each time."""

import functools
import io
import textwrap
from pathlib import Path

import matplotlib.style
from matplotlib.colors import LinearSegmentedColormap
from matplotlib.figure import Figure

STYLE = Path(__file__).with_name("imuarray.mplstyle")
COLUMN, PAGE = 3.5, 7.16  # inches: one column, both columns
FOOTER_SIZE = 6.0  # pt
# Okabe and Ito's palette without its yellow, which white paper swallows.
VERMILLION, GREEN, BLUE, SKY = "#D55E00", "#009E73", "#0072B2", "#56B4E9"
PURPLE, ORANGE, BLACK, GREY = "#CC79A7", "#E69F00", "#000000", "#7F7F7F"
# Colour, marker and dashes of the first, second, ... series: none differs by colour alone.
LOOKS = (
    {"color": VERMILLION, "marker": "o", "linestyle": (0, (4, 1.2))},
    {"color": GREEN, "marker": "s", "linestyle": (0, (3, 1, 1, 1))},
    {"color": BLUE, "marker": "^", "linestyle": "-"},
    {"color": PURPLE, "marker": "D", "linestyle": (0, (2, 1))},
    {"color": ORANGE, "marker": "v", "linestyle": (0, (8, 2))},
    {"color": SKY, "marker": "P", "linestyle": (0, (1, 1))},
)
MARKERS = "os^DvPX*<>hp"


def look(index: int, *without: str) -> dict:
    """Line properties of series ``index``, but for those named in ``without``."""
    chosen = LOOKS[index % len(LOOKS)]
    return {key: value for key, value in chosen.items() if key not in without}


def styled(function):
    """Run a drawing function under `imuarray.mplstyle` and matplotlib's defaults only."""

    @functools.wraps(function)
    def wrapper(*args, **kwargs):
        with matplotlib.style.context(["default", str(STYLE)]):
            return function(*args, **kwargs)

    return wrapper


def new_figure(footer=(), width: float = COLUMN, height: float = 2.8) -> Figure:
    """An empty figure (inches) with small ``footer`` lines; ``height`` is without them."""
    # 0.54 em: the mean advance of the font's letters and digits, and some reserve
    characters = int((width - 0.12) * 72 / (0.54 * FOOTER_SIZE))
    lines = [
        part
        for line in footer
        for part in textwrap.wrap(line, characters, subsequent_indent="    ")
    ]
    space = (len(lines) * 1.45 * FOOTER_SIZE + 4) / 72 if lines else 0.0
    figure = Figure(figsize=(width, height + space), layout="constrained")
    share = space / (height + space)
    figure.get_layout_engine().set(rect=(0, share, 1, 1 - share), w_pad=0.03, h_pad=0.03)
    figure.text(
        0.06 / width, 0.02 / (height + space), "\n".join(lines), size=FOOTER_SIZE, color="0.35",
        va="bottom", linespacing=1.25,
    )  # fmt: skip
    return figure


def logarithmic(axes, x: str, y: str, **options) -> None:
    """Both axes logarithmic, with their labels."""
    axes.set(xscale="log", yscale="log", xlabel=x, ylabel=y, **options)


def shade(color: str, share: float):
    """White (0) to ``color`` (1)."""
    return LinearSegmentedColormap.from_list("shades", ["white", color])(share)


@styled
def saved(figure: Figure, suffix: str = "png") -> bytes:
    """A figure as a file, the same bytes each time."""
    buffer = io.BytesIO()
    metadata = {"pdf": {"CreationDate": None}, "png": {"Software": None}}[suffix]
    figure.savefig(buffer, format=suffix, metadata=metadata)
    figure.set_layout_engine(None)  # laid out once
    return buffer.getvalue()
