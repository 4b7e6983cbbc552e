"""The blind study: what an effect is taken for, and what was asked of the diagnosis."""

import numpy as np
import pandas as pd

from imuarray.pictures.style import BLACK, BLUE, PAGE, VERMILLION, shade
from imuarray_papers.blind import summary
from imuarray_papers.blind.inject import CATALOGUE
from imuarray_papers.blind.summary import CRASH, NOTHING, UNEXPLAINED
from imuarray_papers.figures.style import drawing, scale_line

GROUPS = {
    "one": "one effect,\n8 σ or more", "clean": "", "gauge": "gauges",
    "outside": "outside the\ncatalogue", "struck": "",
}  # fmt: skip
STRUCK = "struck effects, all"
TEXT = 5.0  # pt, in cells


def words(name: str) -> str:
    """An effect's id to be read: 'accel. scale', without what the group says."""
    for prefix in ("gauge_", "outside_"):
        name = name.removeprefix(prefix)
    return name.replace("accelerometer", "accel.").replace("gyroscope", "gyro.").replace("_", " ")


def confusion_rows(table: pd.DataFrame) -> pd.DataFrame:
    """The figure's lines: those of `blind.summary.confusion`, struck effects added up."""
    struck = table.kind == "struck"
    if not struck.any():
        return table
    number = table[struck].drop_duplicates("truth").recordings.sum()
    added = table[struck].groupby("named", sort=False)[["right", "wrong"]].sum().reset_index()
    added = added.assign(
        kind="struck", truth=STRUCK, recordings=number,
        right_share=added.right / number, wrong_share=added.wrong / number,
    )  # fmt: skip
    return pd.concat([table[~struck], added], ignore_index=True)


def names_of(table: pd.DataFrame) -> list[str]:
    """The matrix' columns: the catalogue, what else is named, then what is no effect."""
    last = [NOTHING, UNEXPLAINED, *([CRASH] if CRASH in set(table.named) else [])]
    others = [name for name in dict.fromkeys(table.named) if name not in (*CATALOGUE, *last)]
    return [*CATALOGUE, *others, *last]


def figure_blind_confusion(rows: dict, settings: dict):
    """Truth by name, percent of recordings; blue where the name is right, vermillion where not.

    ``rows``: graded recordings.
    """
    found = summary.confusion(rows["rows"])
    footer = scale_line(
        settings,
        "percent of the recordings (their number behind the effect) in which a name is given."
        " Blue: right by class; vermillion and bold: wrong, in all or some of them. A recording"
        " with several names is in several columns; unexplained: the flag, whatever is named.",
    )
    lines = confusion_rows(found)[["kind", "truth"]].drop_duplicates()
    return drawing(_draw_confusion, [footer], PAGE, 1.3 + 0.165 * len(lines)), found


def _draw_confusion(figure, found):
    table, axes = confusion_rows(found), figure.subplots()
    columns = names_of(table)
    lines = list(dict.fromkeys(zip(table.kind, table.truth, strict=True)))
    counts = table.drop_duplicates(["kind", "truth"]).recordings
    place = {line: number for number, line in enumerate(lines)}
    for row in table.itertuples():
        _cell(axes, columns.index(row.named), place[row.kind, row.truth], row)
    labels = [f"{words(truth)} ({n})" for (_, truth), n in zip(lines, counts, strict=True)]
    axes.set_yticks(range(len(lines)), labels, size=6)
    axes.set_xticks(range(len(columns)), map(words, columns), size=6, rotation=90)
    axes.xaxis.tick_top()
    axes.set(xlim=(-0.5, len(columns) - 0.5), ylim=(len(lines) - 0.5, -0.5))
    _separate(axes, lines, columns)


def _cell(axes, column: int, line: int, row) -> None:
    """One cell: coloured by the larger part, the number in bold where any of it is wrong."""
    right = row.right_share >= row.wrong_share
    share = row.right_share + row.wrong_share
    # a small share is seen, too
    color = shade(BLUE if right else VERMILLION, 0.12 + 0.88 * share) if share > 0 else "white"
    axes.fill_between([column - 0.5, column + 0.5], line - 0.5, line + 0.5, color=color, lw=0)
    dark = share > (0.55 if right else 0.8)
    axes.text(
        column, line, f"{100 * share:.0f}", size=TEXT, ha="center", va="center_baseline",
        color="white" if dark else BLACK, weight="bold" if row.wrong else "normal",
    )  # fmt: skip


def _separate(axes, lines, columns) -> None:
    """Thin lines between cells, thick ones between groups, and the groups' names."""
    axes.grid(False)
    axes.tick_params(length=0)
    for names, line in ((lines, axes.axhline), (columns, axes.axvline)):
        for edge in np.arange(len(names) + 1) - 0.5:
            line(edge, color="0.9", linewidth=0.3, zorder=3)
    effects = next(i for i, name in enumerate(columns) if name == NOTHING)
    axes.axvline(effects - 0.5, color=BLACK, linewidth=0.8, zorder=4)
    kinds = [kind for kind, _ in lines]
    for kind, text in GROUPS.items():
        if kind in kinds:
            first, last = kinds.index(kind), len(kinds) - 1 - kinds[::-1].index(kind)
            axes.axhline(last + 0.5, color=BLACK, linewidth=0.8, zorder=4)
            axes.annotate(text, (1.005, 1 - ((first + last) / 2 + 0.5) / len(lines)),
                          xycoords="axes fraction", size=6, rotation=-90, va="center")  # fmt: skip


def table_blind_bars(rows: dict, settings: dict):
    """Bars of the diagnosis beside what was measured; ``rows``: graded recordings."""
    found = summary.recordings(rows["rows"])
    table = summary.criteria(found)
    # empty where there is no verdict to be sure of
    table["sure"] = table.sure.map({True: "yes", False: "no"}).fillna("")
    crashed = int(found.crash.sum())
    return table, {"scale": scale_line(settings), "recordings": len(found), "crashed": crashed}
