"""The numbers behind a cause's figure: an added-variable plot, and panels of its own physics.

A cause's signal is its derivative times its parameters, with the motion and all other parameters
refitted: what would be back in the residual without it. It is an added-variable plot's abscissa;
residual and signal together are its ordinate, so that points on the line are explained.
"""

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
import pandas as pd

from imuarray.diagnosis.document import Diagnosis
from imuarray.diagnosis.fit import Fit, delay_score
from imuarray.engine.clocks import age_of
from imuarray.engine.heldout import blocks_of
from imuarray.engine.parameters import POSITION
from imuarray.linear import scaled_inverse
from imuarray.model.array_model import component
from imuarray.model.effects import EFFECTS, KINDS
from imuarray.model.timing import clock_turns
from imuarray.recording.record import AXES

BINS = 14


class Signal(NamedTuple):
    """A cause as a fit sees it; arrays are (T, N, 6) in units of the noise sd."""

    made: Fit
    effect: str
    imus: tuple[int, ...]
    mask: np.ndarray  # (N, m) bool, its free parameters
    sure: np.ndarray  # (N, m) sds by which these are off zero, 0 of others
    explained: np.ndarray  # what it explains that nothing else could
    total: np.ndarray  # the same and the residual, NaN where readings are left out
    width: np.ndarray  # (N, 6) sd of a residual


def signal_of(diagnosis: Diagnosis, cause) -> Signal:
    """The `Signal` of an adopted cause (effect, imus) in the extended model."""
    made, sds = diagnosis.extended.fit, diagnosis.extended.sds
    columns, flat = made.columns, made.columns.flat(made.state)
    mask = columns.mask([cause.effect], cause.imus) & made.active
    sure = np.where(mask, np.abs(flat) / np.where(sds > 0, sds, np.inf), 0.0)
    left = made.less_motion(made.along(np.where(mask, flat, 0.0)))
    others = made.active & ~mask
    information, _ = made.normal(others)
    score = np.array(
        [np.sum(made.whitened[:, k, :, m] * left[:, k]) for k, m in np.argwhere(others)]
    )
    ridge = 1.0 / np.broadcast_to(columns.prior_sd, others.shape)[others] ** 2
    step = np.zeros(mask.shape)
    step[others] = scaled_inverse(information + np.diag(ridge)) @ score
    explained = left - made.less_motion(made.along(step))
    total = np.where(made.readings.keep, made.residual + explained, np.nan)
    # correlated neighbours are fewer independent ones
    rho = np.clip(diagnosis.found.search.noise.correlation, 0.0, 0.99)
    inflated = np.repeat(np.sqrt((1 + rho) / (1 - rho)), 3, axis=1)
    width = np.sqrt(np.maximum(1.0 - made.leverage, 1e-6)).mean(axis=0) * inflated
    return Signal(made, cause.effect, tuple(cause.imus), mask, sure, explained, total, width)


def binned(x, total, explained, width) -> pd.DataFrame:
    """Means over bins of x: x, y, se, model; NaN in total left out.

    Bins share the sum of the distances from the median, and so reach where a slope is determined.
    """
    kept = np.isfinite(total) & np.isfinite(x)
    x, total, explained = x[kept], total[kept], explained[kept]
    width = np.broadcast_to(width, kept.shape)[kept]
    if not len(x) or np.ptp(x) == 0:
        return pd.DataFrame(columns=["x", "y", "se", "model"], dtype=float)
    order = np.argsort(x)
    far = np.abs(x[order] - np.median(x))
    shares = np.cumsum(far + far.mean())
    edges = x[order][np.searchsorted(shares, shares[-1] * np.linspace(0, 1, BINS + 1)[1:-1])]
    edges = np.unique([x[order[0]], *edges, x[order[-1]]])
    place = np.clip(np.searchsorted(edges, x, side="right") - 1, 0, len(edges) - 2)
    counts = np.bincount(place, minlength=len(edges) - 1)
    some = counts > 0
    means = [
        np.bincount(place, value, len(counts))[some] / counts[some]
        for value in (x, total, explained, width**2)
    ]
    return pd.DataFrame(
        {"x": means[0], "y": means[1], "se": np.sqrt(means[3] / counts[some]), "model": means[2]}
    )


PANELS = 3  # special drawings of a cause
VAGUE = 12.0  # times the best block's sd, from which a block determines no position
BLOCKS = 12  # of time, in which a position is estimated again
# From SI to what the figures show, and its unit; the smaller unit for small signals.
FORCE = ((1.0, "m/s²"), (1e3, "mm/s²"))
RATE = ((np.degrees(1.0), "deg/s"), (1e3 * np.degrees(1.0), "10⁻³ deg/s"))
LENGTH = ((1e3, "mm"), (1e6, "µm"))


def cause_table(diagnosis: Diagnosis, cause) -> pd.DataFrame:
    """All marks of a cause's figure: ``panel``, its texts, ``series``, x, y, se and ``model``.

    The first panel is the added-variable plot (in noise sds, every reading that the cause
    touches), the others show the cause beside what it depends on.
    """
    signal = signal_of(diagnosis, cause)
    frames = [added_variable(signal), *panels_of(cause.effect)[0](signal)]
    frames = [frame for frame in frames if len(frame)]
    for number, frame in enumerate(frames):
        frame.insert(0, "panel", number)
    return pd.concat(frames, ignore_index=True)


def added_variable(signal: Signal) -> pd.DataFrame:
    """Residual and signal against the signal, each kind of sensor for itself, in noise sds."""
    frames = []
    for kind, name in enumerate(("accelerometers", "gyroscopes")):
        part = (slice(None), list(signal.imus), slice(3 * kind, 3 * kind + 3))
        own = np.any(signal.made.whitened[part][..., signal.mask.any(axis=0)] != 0, axis=-1)
        if not own.any():
            continue
        total, explained = np.where(own, signal.total[part], np.nan), signal.explained[part]
        width = np.broadcast_to(signal.width[part[1:]], explained.shape)
        frames.append(
            binned(*(v.ravel() for v in (explained, total, explained, width))).assign(series=name)
        )
    return pd.concat(frames, ignore_index=True).assign(
        title="all readings it touches", x_label="predicted (noise sds)",
        y_label="seen without it (noise sds)",
    )  # fmt: skip


def panel(frame, title, x_label, y_label, units, scale=1.0, least=0.1) -> pd.DataFrame:
    """The marks x, y, se, model of one panel, all but x in a legible unit, with its texts.

    ``scale`` makes them SI; the second of ``units`` is for those all below ``least`` of the first.
    """
    size = np.max(np.abs(scale * frame[["y", "model"]].to_numpy()), initial=0.0)
    factor, unit = units[0] if size * units[0][0] >= least else units[1]
    frame = frame.assign(series="", title=title, x_label=x_label, y_label=f"{y_label} ({unit})")
    frame[["y", "se", "model"]] *= factor * scale
    return frame


def axis_panel(signal: Signal, imu, axis, x, title, x_label) -> pd.DataFrame:
    """One reading axis of an IMU, in physical units, binned over x (T,)."""
    part, readings = (slice(None), imu, axis), signal.made.readings
    found = binned(x, signal.total[part], signal.explained[part], signal.width[imu, axis])
    kind, units = ("gyroscope", RATE) if axis >= 3 else ("accelerometer", FORCE)
    title = f"{kind} {readings.labels[imu]}, {AXES[axis % 3]}{title}"
    return panel(found, title, x_label, "deviation", units, readings.sd[imu, axis // 3])


def largest(values) -> list[tuple[int, int]]:
    """(row, column) of the few largest of a matrix's values above zero, in the matrix's order."""
    best = np.sort(np.argsort(values, axis=None)[::-1][:PANELS])
    return [
        tuple(map(int, np.unravel_index(place, values.shape)))
        for place in best if values.ravel()[place] > 0
    ]  # fmt: skip


def time_panels(signal: Signal) -> list[pd.DataFrame]:
    """An offset or a drift: the deviation of the axes with the largest signal against time."""
    power = np.where(np.isfinite(signal.total), signal.explained, 0.0) ** 2
    power = power.sum(axis=0)
    power[np.setdiff1d(np.arange(len(power)), signal.imus)] = 0.0
    if EFFECTS[signal.effect].sensors in KINDS:
        kind = KINDS.index(EFFECTS[signal.effect].sensors)
        power[:, 3 - 3 * kind : 6 - 3 * kind] = 0.0
    time = signal.made.readings.time
    return [axis_panel(signal, *place, time, "", "time (s)") for place in largest(power)]


def parameter_panels(signal: Signal) -> Iterator[pd.DataFrame]:
    """The most certain parameters, each axis's deviation against what the parameter multiplies."""
    made = signal.made
    for imu, column in largest(signal.sure):
        derivative = made.whitened[:, imu, :, column]
        axis = int(np.argmax(np.sum(derivative**2, axis=0)))
        x = derivative[:, axis] * made.readings.sd[imu, axis // 3]
        name = component(signal.effect, made.columns.places[column])
        factor, label, root = abscissa(signal.effect, name)
        # a curved response bends the reading itself
        x = factor * (made.readings.values[:, imu, axis] if root else x)
        yield axis_panel(signal, imu, axis, x, f" ({name})" * (len(name) > 1), label)


# What a parameter multiplies: from SI to what is drawn.
ABSCISSAE = {
    "specific force": (1.0, "m/s²"), "angular rate": (np.degrees(1.0), "deg/s"),
    "lever arm": (1e-3, "m/s² per mm"),
}  # fmt: skip


def abscissa(effect: str, name: str) -> tuple[float, str, bool]:
    """(factor, label, whether it is the reading itself) of what a parameter multiplies."""
    item = EFFECTS[effect]
    if item.against not in (*ABSCISSAE, "reading"):
        return 1.0, "reading per unit parameter", False
    own = "specific force" if item.sensors == "accelerometer" else "angular rate"
    quantity = own if item.against == "reading" else item.against
    factor, unit = ABSCISSAE[quantity]
    return factor, f"{quantity} {name[-1]} ({unit})", item.against == "reading"


def delay_panels(signal: Signal) -> Iterator[pd.DataFrame]:
    """Delays: the gyroscope's deviation along domega/dt against its size."""
    readings, turn = signal.made.readings, signal.made.state.motion[:, 3:6]
    size = np.linalg.norm(turn, axis=1)
    way = turn / np.maximum(size, 1e-12)[:, None]
    for imu, _ in largest(signal.sure):
        if readings.exists[imu, 1]:
            parts = (np.sum(v[:, imu, 3:] * way, axis=1) for v in (signal.total, signal.explained))
            found = binned(size, *parts, signal.width[imu, 3:].mean())
            title = f"gyroscope {readings.labels[imu]}, along dω/dt"
            sd = readings.sd[imu, 1]
            yield panel(found, title, "|dω/dt| (rad/s²)", "deviation", RATE, sd)


def clock_panels(signal: Signal) -> Iterator[pd.DataFrame]:
    """Clocks: the readings' age, from each sample alone, against the place in the sawtooth."""
    made = signal.made
    clocks = made.columns.model.split(np.asarray(made.state.parameters))[signal.effect]
    score, information = delay_score(made)
    for imu in sorted(signal.imus, key=lambda k: -abs(clocks[k][0]))[:PANELS]:
        frequency = float(clocks[imu][1])
        turns = clock_turns(clocks[imu], made.readings.time, made.readings.span)
        part = turns - np.floor(turns)
        part = part if frequency > 0 else 1 - part
        age = age_of(clocks[imu], turns)
        place = np.clip((part * 2 * BINS).astype(int), 0, 2 * BINS - 1)
        weight = np.bincount(place, information[:, imu], 2 * BINS)
        some = weight > 1e-100
        means = [
            np.bincount(place, information[:, imu] * v, 2 * BINS)[some] / weight[some]
            for v in (part, age - score[:, imu] / information[:, imu], age)
        ]
        frame = pd.DataFrame({
            "x": 1e3 * means[0] / abs(frequency), "y": 1e3 * means[1],
            "se": 1e3 / np.sqrt(weight[some]), "model": 1e3 * means[2], "series": "",
            "title": f"IMU {made.readings.labels[imu]}, {abs(frequency):.4g} Hz",
            "x_label": "time mod 1/f, twice (ms)", "y_label": "age of a reading (ms)",
        })  # fmt: skip
        yield pd.concat([frame, frame.assign(x=frame.x + 1e3 / abs(frequency))])


def shift_panels(signal: Signal) -> Iterator[pd.DataFrame]:
    """A triad that moved: its position in blocks of time, from the residual without the step."""
    made, imu = signal.made, signal.imus[0]
    chosen = made.columns.of(POSITION)
    every, found = made.projected(chosen)[:, imu], []
    for part in blocks_of(len(made.residual), BLOCKS):
        own = made.whitened[part, imu][..., chosen].reshape(-1, 3)
        projected = every[part].reshape(-1, 3)
        inverse = scaled_inverse(own.T @ own - projected.T @ projected)
        seen, step = (
            inverse @ (own.T @ np.nan_to_num(values[part, imu]).ravel())
            for values in (signal.total, signal.explained)
        )
        time = np.full(3, made.readings.time[part].mean())
        found.append([time, seen, np.sqrt(np.diag(inverse)), step])
    for rows, axis in zip(np.moveaxis(found, -1, 0), AXES, strict=True):
        frame = pd.DataFrame(rows, columns=["x", "y", "se", "model"])
        frame = frame[frame.se < VAGUE * frame.se.min()]
        title = f"IMU {made.readings.labels[imu]}, position {axis}"
        yield panel(frame, title, "time (s)", "from the mean", LENGTH, least=1.0)


AGAINST = {  # by what an effect is drawn against: its panels, and what they show
    "age": (
        clock_panels,
        "the age of the readings from each sample alone, against the time within a turn of the"
        " sawtooth, drawn twice",
    ),
    "place": (shift_panels, "the triad's position in blocks of time"),
    "time": (time_panels, "the axes that it changes most, against time"),
    "angular acceleration": (
        delay_panels,
        "the gyroscope along dω/dt against its size; the slope is the delay",
    ),
}
PARAMETERS = parameter_panels, "the most certain parameters, against what each multiplies"


def panels_of(effect: str):
    """(function of a `Signal`, caption) of the panels of an effect's own physics."""
    return AGAINST.get(EFFECTS[effect].against, PARAMETERS)
