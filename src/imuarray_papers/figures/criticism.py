"""The criticism in one picture: what is wrong, why, the model extended, and what that gains."""

import numpy as np
import pandas as pd

from imuarray.geometry import Array
from imuarray.pictures.style import BLACK, GREY, PAGE, logarithmic
from imuarray_papers.figures.style import columns, drawing, marks, panels, rms

QUANTITIES = {"specific_force": "accelerometers", "angular_rate": "gyroscopes"}
STEPS = {  # of `measured.causes.STEPS`
    "normal": "papers'", "robust": "+ heavy tails", "clocks": "+ clocks",
    "no arms": "+ lag, maps", "common arms": "+ arms, alike",
}  # fmt: skip
DIGITS = 3  # significant: all else differs between recordings, or between processors


def figure_criticism(
    summary: pd.DataFrame, noise: pd.DataFrame, diagnosis: tuple, causes: pd.DataFrame,
    predicted: pd.DataFrame, name: str, group: str,
):  # fmt: skip
    """A measured board: residual, a cause, the residual and the positions model after model.

    ``summary``: `measured.residuals` of the recording ``name``, ``noise`` of its still poses,
    ``diagnosis`` (diagnosis.json, tables), ``causes``: `measured.causes.repeated` of the board
    ``group``, ``predicted``: `measured.left_out.predicted` of the recording left out.
    """
    document, tables = diagnosis
    clock = next(table for key, table in tables.items() if key.endswith("sensor_clock"))
    chosen = causes.set_index("step").loc[list(STEPS)].reset_index()
    gained = chosen[["rms_m", "same_size_rms_m", "covered", "common_size_m"]]
    table = panels(
        wrong=_against_acceleration(summary, noise),
        cause=_first_clock(clock),
        extended=pd.DataFrame({
            "model": STEPS.values(), "smooth": chosen.smooth_ratio, "all": chosen.residual_ratio,
        }),
        gained=gained.assign(model=STEPS.values()),
        left_out=predicted[["model", "over_inflated", "over_inflated_error"]],
        causes=_causes(document),
    )  # fmt: skip
    footer = [
        f"Recording {name} (a, b), {chosen.recordings.max()} recordings of board {group} (c, d)."
        " (a) rms residual over the noise of still poses, bars: range of the IMUs. (b) points:"
        " from the residuals alone, 1 sd, a turn drawn twice; line: the clock that was found; where"
        " it falls a bin mixes both sides. (c) filled: smooth and fast samples; open: all samples,"
        " shocks with them. (d) rms of differences between recordings, and the share of them that"
        " 95 % intervals cover; open: at one size; dashed: an error of the size that all share."
    ]
    return drawing(_draw, footer, PAGE, 2.5), three_digits(table)


def three_digits(table: pd.DataFrame) -> pd.DataFrame:
    """To be published with `DIGITS`."""
    table.attrs["digits"] = dict.fromkeys(table.columns, DIGITS)
    return table


def _against_acceleration(summary: pd.DataFrame, noise: pd.DataFrame) -> pd.DataFrame:
    """x in 10^3 deg/s^2; rms, least and largest over the IMUs, over the noise of still poses."""
    still = noise.groupby("sensor").ratio.apply(rms)
    # the simulation has the noise that was declared
    scale = np.where(summary.source == "measured", summary.quantity.map(still), 1.0)
    x = np.degrees(summary.bin_low + summary.bin_high) / 2e3
    by = summary.assign(size=summary.rms / scale, x=x).groupby(["source", "quantity", "x"])
    return by["size"].agg(y=rms, low="min", high="max").reset_index()


def _first_clock(clock: pd.DataFrame) -> pd.DataFrame:
    """Age of the readings of the IMU drawn first (ms) over the turns of its clock."""
    first = clock[clock.title.str.startswith("IMU")]
    first = first[first.title == first.title.iloc[0]]
    turn = first.x.iloc[len(first) // 2] - first.x.iloc[0]
    named = first.rename(columns={"model": "predicted"})
    return named[["y", "se", "predicted", "title"]].assign(x=first.x / turn)


def _causes(document: dict) -> pd.DataFrame:
    """A row a cause: sensors, mean, rms and median sd of the parameters that have one, its gain."""
    rows = []
    for cause in document["causes"]:
        row = {
            "effect": cause["effect"], "sensors": " ".join(cause["sensors"]),
            "nats": cause["heldout_gain_nats"], "nats_error": cause["heldout_gain_se"],
        }  # fmt: skip
        values, sds, units = estimated(cause)
        if len(units) == 1:
            alike = abs(values.mean()) > 0.5 * rms(values)
            row |= {"unit": units.pop(), "mean": values.mean() if alike else np.nan,
                    "rms": rms(values), "sd": np.median(sds)}  # fmt: skip
        rows.append(row)
    return pd.DataFrame(rows)


def estimated(cause: dict) -> tuple[np.ndarray, np.ndarray, set[str]]:
    """Values and sds of the parameters of a cause that have an sd, and their units."""
    items = [item for item in cause["parameters"].values() if item["sd"]]
    values, sds = (np.array([item[key] for item in items]) for key in ("value", "sd"))
    return values, sds, {item["unit"] for item in items}


def _draw(figure, table):
    axes = figure.subplots(1, 4, width_ratios=(1.1, 1.1, 1, 1))
    part = dict(list(table.groupby("panel")))
    _draw_wrong(axes[0], part["wrong"])
    _draw_clock(axes[1], part["cause"], part["causes"])
    _draw_extended(axes[2], part["extended"])
    _draw_between(axes[3], part["gained"], part["left_out"].set_index("model"))
    letter(axes)


def letter(axes) -> None:
    """(a), (b), ... before the panels' titles."""
    for name, one in zip("abcd", axes, strict=True):
        said = one.get_title()
        one.set_title("")
        one.set_title(f"({name}) {said}", size=7, loc="right")


def _draw_wrong(axes, rows) -> None:
    for number, (quantity, label) in enumerate(QUANTITIES.items()):
        for source, fill in (("measured", {}), ("simulated", {"markerfacecolor": "none"})):
            some = rows[(rows.quantity == quantity) & (rows.source == source)]
            bars = some.y - some.low, some.high - some.y
            axes.errorbar(some.x, some.y, bars, label=label if source == "measured" else None,
                          elinewidth=0.7, **marks(number, markersize=4), **fill)  # fmt: skip
    axes.plot([], [], "o", color=GREY, markerfacecolor="none", label="the model's simulation")
    axes.axhline(1, color=BLACK, linewidth=0.6)
    title = f"Wrong: up to {rows[rows.source == 'measured'].y.max():.0f} × noise"
    logarithmic(axes, "angular acceleration (10³ deg/s²)", "residual / noise", title=title)
    axes.xaxis.set_major_formatter("{x:g}")
    axes.xaxis.set_minor_formatter("")
    axes.legend(fontsize=6, loc="lower center", bbox_to_anchor=(0.5, 0.15))


def _draw_clock(axes, rows, causes) -> None:
    axes.errorbar(rows.x, rows.y, rows.se, **marks(0, markersize=3))
    for turn in (0, 1):  # the sawtooth falls between them
        some = rows[(rows.x >= turn) & (rows.x < turn + 1)]
        axes.plot(some.x, some.predicted, color=BLACK, linewidth=0.8)
    imu = rows.title.iloc[0].split(",")[0]
    axes.set(
        xlabel=f"turns of {imu}'s clock", ylabel="age of a reading (ms)",
        ylim=(1.7 * rows.predicted.min(), 1.15 * rows.predicted.max()),
        title="A cause: a clock in each chip",
    )  # fmt: skip
    lag = causes[causes.effect == "gyroscope_delay"]
    if len(lag):
        value, sd = 1e3 * lag["mean"].iloc[0], 1e3 * lag.sd.iloc[0]
        way = "ahead" if value > 0 else "behind"
        said = f"gyroscopes\n{abs(value):.2f} ± {sd:.2f} ms {way}"
        axes.text(0.04, 0.03, said, size=6, transform=axes.transAxes)


def _over_models(axes, names, ylabel: str, title: str) -> None:
    """Models along the abscissa; a logarithmic ordinate with its numbers written out."""
    axes.set(yscale="log", ylabel=ylabel, title=title)
    axes.yaxis.set_major_formatter("{x:g}")
    axes.set_xticks(range(len(names)), names, rotation=35, ha="right", size=6.5)
    axes.set_xlim(-0.5, len(names) - 0.5)


def _draw_extended(axes, rows) -> None:
    style = marks(2, markersize=5)
    axes.plot(range(len(rows)), rows.smooth, **style, label="smooth")
    axes.plot(range(len(rows)), rows["all"], **style, markerfacecolor="none", label="all")
    axes.axhline(1, color=BLACK, linewidth=0.6)
    title = f"Extended: {rows.smooth.iloc[0]:.0f} to {rows.smooth.iloc[-1]:.2g} × noise"
    _over_models(axes, rows.model, "residual / noise", title)
    axes.legend(fontsize=6)


def draw_gained(axes, rows, said: str, ylabel: str) -> None:
    """rms (µm) and cover of the 95 % intervals, model after model."""
    axes.plot(range(len(rows)), 1e6 * rows.rms_m, **marks(3, markersize=5))
    for place, row in enumerate(rows.itertuples()):
        axes.annotate(f"{100 * row.covered:.0f} %", (place, 1e6 * row.rms_m), (0, 5), size=6,
                      ha="center", textcoords="offset points")  # fmt: skip
    first, last = (1e6 * rows.rms_m.iloc[place] for place in (0, -1))
    _over_models(axes, rows.model, ylabel, f"Gained: {first:.0f} to {last:.2g} µm")
    axes.margins(y=0.3)
    axes.text(0.04, 0.04, said, size=6, transform=axes.transAxes)


def _draw_between(axes, rows, left_out) -> None:
    """Differences between recordings, at one size too, and the size's error that all share."""
    gain, error = left_out.loc["board", ["over_inflated", "over_inflated_error"]]
    said = f"left out: +{gain:.1f} ± {error:.1f} nats"
    hollow = marks(3, markersize=5, markerfacecolor="none")
    axes.plot(range(len(rows)), 1e6 * rows.same_size_rms_m, **hollow)
    common = 1e6 * rows.common_size_m.iloc[-1]
    axes.axhline(common, color=GREY, linestyle=(0, (4, 2)), linewidth=0.8)
    axes.annotate("size, shared", (0.03, common), (0, -8), xycoords=("axes fraction", "data"),
                  textcoords="offset points", size=6, color="0.3")  # fmt: skip
    draw_gained(axes, rows, said, "between recordings (µm)")


def table_criticism(
    summary: pd.DataFrame, noise: pd.DataFrame, diagnosis: tuple, causes: pd.DataFrame,
    predicted: pd.DataFrame, recordings: Array, name: str, group: str,
):  # fmt: skip
    """The four steps and what is left, a row each; arguments of `figure_criticism`.

    ``recordings``: the array as the recording declares it.
    """
    wrong = _against_acceleration(summary, noise)
    force, rate = (wrong[(wrong.source == "measured") & (wrong.quantity == q)] for q in QUANTITIES)
    found = _causes(diagnosis[0]).set_index("effect")
    lag, clock = found.loc["gyroscope_delay"], found.loc["sensor_clock"]
    clocks = next(c for c in diagnosis[0]["causes"] if c["effect"] == "sensor_clock")["parameters"]
    period = np.median([item["value"] for name, item in clocks.items() if "period" in name])
    last, first = (causes.set_index("step").loc[key] for key in ("common arms", "normal"))
    board = predicted.set_index("model").loc["board"]
    turned = 1e6 * np.radians(0.1) * np.linalg.norm(recordings.relative, axis=1).max()
    several = f"{first.recordings:.0f} recordings of {group}"
    rows = (
        ("What is wrong? Residual over noise, fastest eighth of the samples",
         f"accelerometers {force.y.iloc[-1]:.0f}, gyroscopes {rate.y.iloc[-1]:.0f}", "",
         f"IMUs: {force.low.iloc[-1]:.0f} to {force.high.iloc[-1]:.0f},"
         f" {rate.low.iloc[-1]:.0f} to {rate.high.iloc[-1]:.0f}", name),
        ("Why? Each chip reads on its own clock, gyroscopes run ahead",
         "one instant for all readings",
         f"clocks of {1e3 * period:.3g} ms; {1e3 * lag['mean']:.2f} ms ahead",
         f"± {1e3 * lag.sd:.2f} ms; clocks +{clock.nats:.0f} nats", name),
        ("Extended: residual over noise, smooth and fast samples", f"{first.smooth_ratio:.1f}",
         f"{last.smooth_ratio:.2f}", "median", several),
        ("Gained: difference between recordings; nats a sample on a recording left out",
         f"{1e6 * first.rms_m:.0f} µm", f"{1e6 * last.rms_m:.1f} µm; +{board.over_inflated:.1f}",
         f"95 % intervals cover {100 * last.covered:.0f} %; ± {board.over_inflated_error:.1f} nats",
         f"{several}; {name} left out"),
        ("Left over: all samples, shocks with them; and what no agreement shows",
         f"{first.residual_ratio:.0f} × the noise", f"{last.residual_ratio:.0f} × the noise",
         f"size, common to all: {1e6 * last.common_size_m:.0f} µm rms; frame: up to"
         f" {turned:.0f} µm for 0.1 degree", several),
    )  # fmt: skip
    table = pd.DataFrame(rows, columns=[column.name for column in columns("criticism")])
    return table, {}
