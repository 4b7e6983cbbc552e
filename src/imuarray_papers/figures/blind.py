"""The blind study: how small an effect is found, what it is taken for, and what that gains."""

from functools import partial

import numpy as np
import pandas as pd
from matplotlib.ticker import NullFormatter

from imuarray.pictures.style import BLACK, BLUE, PAGE, SKY, VERMILLION, new_figure, shade, styled
from imuarray_papers.blind import summary
from imuarray_papers.blind.criteria import criteria
from imuarray_papers.blind.inject import CATALOGUE
from imuarray_papers.blind.summary import ALL, CRASH, NOTHING, UNEXPLAINED
from imuarray_papers.figures.style import Column, panels, scale_line

COLUMNS = 6  # panels in a row
TICKS = 3  # at most, of an axis
FOUND, WRONG = {"color": BLUE, "marker": "o"}, {"color": VERMILLION, "marker": "s"}
# Amplitudes without a unit, said instead of "1".
MEANING = {
    "accelerometer_scale": "share", "accelerometer_misalignment": "share",
    "gyroscope_scale": "share", "gyroscope_misalignment": "share",
    "accelerometer_noise": "ln of noise / declared", "gyroscope_noise": "ln of noise / declared",
    "heavy_tails": "factor − 1", "coloured_noise": "coefficient", "saturation": "share cut off",
    "stale_samples": "share", "axis_swap": "no amplitude",
    "bias_drift": "0.1 m/s² or 0.3 deg/s", "warm_up": "0.05 m/s² and 0.1 deg/s",
}  # fmt: skip
UNITS = {"m s-2": "m/s²", "rad s-1": "rad/s", "s2 m-1": "s²/m", "s rad-1": "s/rad",
         "rad s m-1": "rad/s per m/s²"}  # fmt: skip
GROUPS = {
    "one": "one effect,\n8 σ or more", "clean": "", "gauge": "gauges",
    "outside": "outside the\ncatalogue", "struck": "",
}  # fmt: skip
STRUCK = "struck effects, all"
TEXT = 5.0  # pt, in cells

CRITERIA = (
    Column("bar", "set and what is counted", "set and what is counted"),
    Column("aim", "bar", "bar"),
    Column("recordings", "recordings", "n"),
    Column("share", "measured (%)", r"measured (\%)", "{:.1f}", 100.0),
    Column("low", "95 % limits: from", "from", "{:.1f}", 100.0),
    Column("high", "to", "to", "{:.1f}", 100.0),
    Column("verdict", "verdict", "verdict"),
    Column("sure", "certain at 95 %", "sure"),
    Column("all_recordings", "all settings: recordings", "n, all"),
    Column("all_share", "all settings: measured (%)", r"all (\%)", "{:.1f}", 100.0),
)

GAIN = (
    Column("kind", "set", "set"),
    Column("effect", "effect", "effect"),
    Column("recordings", "recordings", "n"),
    Column("gain", "held-out gain (nats per sample)", "gain", "{:.3g}"),
    Column("gain_se", "its standard error", "se", "{:.2g}"),
    Column("gain_median", "median", "median", "{:.3g}"),
    Column("gain_over_inflated", "gain over the base model with larger noise", "over", "{:.3g}"),
    Column("gain_over_inflated_se", "its standard error", "se", "{:.2g}"),
    Column("base_position_rmse_m", "position RMSE, base (µm)", r"base ($\mu$m)", "{:.3g}", 1e6),
    Column("inflated_position_rmse_m", "base, larger noise (µm)", "larger noise", "{:.3g}", 1e6),
    Column(
        "extended_position_rmse_m", "extended (µm)", r"extended ($\mu$m)", "{:.3g}", 1e6
    ),
    Column("base_coverage", "95 % intervals cover, base (%)", r"base (\%)", "{:.1f}", 100.0),
    Column(
        "inflated_coverage", "base, larger noise (%)", r"larger noise (\%)", "{:.1f}", 100.0
    ),
    Column("extended_coverage", "extended (%)", r"extended (\%)", "{:.1f}", 100.0),
)  # fmt: skip


def words(name: str) -> str:
    """An effect's id to be read: 'accel. scale', without what the group says."""
    for prefix in ("gauge_", "outside_"):
        name = name.removeprefix(prefix)
    return name.replace("accelerometer", "accel.").replace("gyroscope", "gyro.").replace("_", " ")


def figure_blind_detection(rows: dict, against: str, settings: dict):
    """Share found over size, a panel for each effect; ticks are single recordings.

    ``rows``: graded recordings; ``against``: "sigma", or "amplitude" in each effect's own unit.
    """
    effects = summary.effects(rows["rows"])
    bins = summary.detection(effects, against)
    footer = [scale_line(settings, f"{(effects.kind == 'one').sum()} recordings of one effect")]
    effects = effects.loc[effects.kind == "one", ["effect", against, "found"]]
    table = panels(bins=bins, recordings=effects)
    return partial(_draw_detection, against=against, footer=footer), table


@styled
def _draw_detection(table, against, footer):
    bins, effects = table[table.panel == "bins"], table[table.panel == "recordings"]
    names = list(dict.fromkeys(bins.effect))
    lines = -(-(len(names) + 1) // COLUMNS)
    figure = new_figure(footer, PAGE, 0.1 + 1.25 * lines)
    grid = figure.subplots(lines, COLUMNS, sharey=True, sharex=against == "sigma", squeeze=False)
    cells = grid.ravel()
    for axes, name in zip(cells, names, strict=False):
        part = effects if name == ALL else effects[effects.effect == name]
        _detection_panel(axes, bins[bins.effect == name], part, against, name)
    # last: shared limits grow with each panel
    for axes in cells[: len(names)]:
        _ticks(axes)
    for axes in cells[len(names) :]:
        axes.axis("off")
    _detection_legend(cells[len(names)])
    for axes in grid[:, 0]:
        axes.set_ylabel("recordings (%)", size=6, labelpad=1)
    if against == "sigma":
        # the lowest panel of each column: below some of them there is none
        for axes in cells[max(len(names) - COLUMNS, 0) : len(names)]:
            axes.tick_params(labelbottom=True)
            axes.set_xlabel("size (σ)", size=6, labelpad=1)
    return figure


def _detection_panel(axes, bins, effects, against, name):
    error = 100 * np.array([bins.share - bins.low, bins.high - bins.share])
    axes.errorbar(bins.centre, 100 * bins.share, error, linestyle="-", linewidth=0.9,
                  markersize=3, elinewidth=0.6, ecolor=SKY, **FOUND)  # fmt: skip
    axes.plot(bins.centre, 100 * bins.wrong_share, linestyle=(0, (2, 1)), linewidth=0.8,
              markersize=2, **WRONG)  # fmt: skip
    for found, height in ((True, 108), (False, -8)):
        seen = effects[effects.found == found]
        axes.plot(seen[against], np.full(len(seen), height), "|", color=BLACK, markersize=3,
                  markeredgewidth=0.4)  # fmt: skip
    axes.set(xscale="log", ylim=(-16, 116))
    axes.set_yticks([0, 50, 100])
    axes.tick_params(labelsize=5.5)
    axes.set_title(name if name == ALL else words(name), size=6, pad=2)
    if against != "sigma":
        unit = bins.unit.iloc[0]
        axes.set_xlabel(MEANING.get(name, UNITS.get(unit, unit)), size=5.5, labelpad=1)


def _ticks(axes) -> None:
    """Few labels, at powers of ten where there are two of them, written out."""
    low, high = axes.get_xlim()
    if high < 3 * low:
        low, high = low / 3, high * 3
    decades = range(int(np.floor(np.log10(low))), int(np.ceil(np.log10(high))) + 1)
    places = [m * 10.0**e for e in decades for m in (1, 2, 5) if low <= m * 10.0**e <= high]
    tens = [place for place in places if np.isclose(np.log10(place) % 1, [0, 1]).any()]
    places = tens if len(tens) > 1 else places
    places = places[:: -(-len(places) // TICKS) or 1]
    axes.set_xticks(places, [f"{place:g}" for place in places])
    axes.xaxis.set_minor_formatter(NullFormatter())
    axes.set_xlim(low, high)


def _detection_legend(axes) -> None:
    axes.plot([], [], linestyle="-", label="right class", **FOUND)
    axes.plot([], [], linestyle=(0, (2, 1)), markersize=3, label="a wrong name", **WRONG)
    axes.plot([], [], "|", color=BLACK, label="a recording: found\n(top) or not (bottom)")
    axes.legend(loc="center", fontsize=5.5, frameon=False)


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
    return partial(_draw_confusion, footer=footer), found


@styled
def _draw_confusion(found, footer):
    table = confusion_rows(found)
    columns = names_of(table)
    lines = list(dict.fromkeys(zip(table.kind, table.truth, strict=True)))
    figure = new_figure([footer], PAGE, 1.3 + 0.165 * len(lines))
    axes = figure.subplots()
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
    return figure


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
    table = criteria(found)
    # empty where there is no verdict to be sure of
    table["sure"] = table.sure.map({True: "yes", False: "no"}).fillna("")
    notes = [
        f"{scale_line(settings)}; {len(found)} recordings, {int(found.crash.sum())} without an"
        " answer. Measured: on 8 IMUs, 125 Hz, 24 s, for which the bars are set; all settings"
        " beside it. Limits: Clopper and Pearson's; of the coverage, from the spread between"
        " recordings.",
        "Right class: the effect is named, or among those that the named one is said to be"
        " indistinguishable from. A wrong name: in its class there is nothing of the truth. A"
        " crash counts as a miss where a bar is a least share, and has a bar of its own. In a"
        " gauge the array is not determined, and no intervals around one answer can cover.",
    ]
    caption = "Blind study: what was asked of the diagnosis, and what was measured."
    return table, CRITERIA, caption, notes


def table_blind_gain(rows: dict, settings: dict):
    """Gain, position error and coverage before and after, by effect; ``rows``: as graded."""
    table = summary.gain_table(summary.recordings(rows["rows"]))
    note = (
        f"{scale_line(settings)}. Gains over the base model (and over the same with its noise"
        " enlarged to what its residual shows) are means over recordings, their errors those of"
        " the recordings' own. RMSE: pooled over recordings and coordinates. Coverage: mean share"
        " of the intervals of all coordinates; errors between recordings, medians and the rest are"
        " in the CSV file. In a gauge, the array is not determined: no model can cover."
    )
    return table, GAIN, "Blind study: what the extended model gains.", [note]
