"""Any logger's files as one recording of the array, and an account of what that took."""

from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from os import PathLike
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from imuarray.analysis.garbage import without_garbage, without_garbage_of
from imuarray.analysis.settings import SETTINGS
from imuarray.errors import InputError, require
from imuarray.firstorder.rails import rails_shown
from imuarray.motion.state import lever
from imuarray.recording import Recording, read_recording
from imuarray.recording.channels import repeated
from imuarray.recording.layout import read_layout, rotation
from imuarray.recording.record import KINDS, RAIL
from imuarray.recording.rig import Log, Rig, recording_of
from imuarray.recording.units import GRAVITY
from imuarray.trust import ends

RECORDINGS = (".nc", ".nc4", ".h5")
PACKETS = (".bin", ".bin.xz")
UNKNOWNS = 15  # of a triad that nobody has drawn: arm, map of the first triad's force, offset


class Opened(NamedTuple):
    """A recording, and lines that say what became of the logs."""

    recording: Recording
    lines: list[str]


def open_logs(
    paths: str | PathLike | Sequence[str | PathLike],
    columns: str | PathLike | None = None,
    topics: Sequence[str] = (),
) -> Opened:
    """Logs of one rig as one recording: tables, ROS bags, a MIMU board's packets, a recording.

    ``columns`` is the YAML of docs/convert.md, for packets (.bin, .bin.xz) the CSV of positions,
    for a recording (.nc) none; ``topics`` those of bags to use, the reference first. IMUs that
    share their stamps, with known axes, become samples as they are; others are aligned
    (`alignment`), which the lines say and the recording keeps. InputError says what does not fit.
    """
    found = _opened(paths, columns, topics)
    _require_paired(found.recording)
    return _placed(found)


def _placed(opened: Opened) -> Opened:
    """With positions to begin with, where no drawing gave any."""
    found = opened.recording
    if not np.isnan(found.accelerometer_position).any():
        return opened
    places, sd = _rough_positions(found)
    line = (
        f"no positions given: they begin from the motion, to {1e3 * sd:.2g} mm; no drawing was"
        " compared with the answer"
    )
    found = replace(found, accelerometer_position=places, position_prior_sd=sd)
    return Opened(found, [*opened.lines, line])


def _rough_positions(recording: Recording) -> tuple[np.ndarray, float]:
    """(positions (A, 3) m relative to the first triad, sd m) from readings as logged.

    Each triad's force is a map of the first one's, an offset, and what rate and angular
    acceleration make of its lever arm: linear least squares, axes nearly parallel. InputError where
    the motion does not determine the arms.
    """
    count = recording.specific_force.shape[1]
    design, right = _equations(recording)
    scale = np.maximum(np.linalg.norm(design, axis=0), 1e-300)
    found, _, rank, _ = np.linalg.lstsq(design / scale, right, rcond=None)
    positions, sd = np.zeros((count, 3)), np.inf
    if rank == UNKNOWNS:
        positions[1:] = (found / scale[:, None])[:3].T
        left = np.mean((right - design @ (found / scale[:, None])) ** 2, axis=0).max()
        spread = np.diag(np.linalg.inv((design / scale).T @ (design / scale)))[:3]
        sd = float(np.sqrt(left * np.max(spread / scale[:3] ** 2)))
    size = float(np.ptp(positions, axis=0).max())
    require(
        sd < SETTINGS.rough_sure * size, "positions",
        "those of a drawing, or motion from which they follow",
        "motion that leaves them open: twist the board faster, about all axes, or measure them with"
        " a ruler, from any point",
    )  # fmt: skip
    return positions, float(np.hypot(sd, SETTINGS.rough_sd * size))


def _equations(recording: Recording) -> tuple[np.ndarray, np.ndarray]:
    """Coefficients (n, `UNKNOWNS`) and forces (n, A - 1) of fast samples off the rails."""
    from scipy.signal import savgol_filter  # slow to import, and every log comes by here

    lost = recording.at_rail("gyroscope") | recording.at_rail("accelerometer")
    expected = "readings off their rails, from which they follow"
    found = f"none of {len(lost)}: is a range, a unit or a scale wrong?"
    require(not lost.all(), "positions", expected, found)
    rate = recording.angular_rate.mean(axis=1)
    if len(rate) < SETTINGS.slope_window:
        return np.zeros((1, UNKNOWNS)), np.zeros((1, recording.specific_force.shape[1] - 1))
    step = np.median(np.diff(recording.time))
    smooth = partial(
        savgol_filter, window_length=SETTINGS.slope_window, polyorder=SETTINGS.slope_order,
        delta=step, axis=0,
    )  # fmt: skip
    rate = rate - np.median(rate, axis=0)
    force, rate, turning = smooth(recording.specific_force), smooth(rate), smooth(rate, deriv=1)
    speed = np.linalg.norm(rate, axis=1)
    used = (speed > SETTINGS.rough_fast * np.sqrt(np.mean(speed**2))) & ~lost
    arms = lever(rate[used, None], turning[used, None], np.eye(3)).swapaxes(1, 2)
    maps = np.einsum("ij,tk->tijk", np.eye(3), force[used, 0]).reshape(-1, 3, 9)
    offsets = np.broadcast_to(np.eye(3), arms.shape)
    design = np.concatenate([arms, maps, offsets], axis=2).reshape(-1, UNKNOWNS)
    return design, force[used, 1:].swapaxes(1, 2).reshape(-1, force.shape[1] - 1)


def _with_rails(recording: Recording, layout=None) -> Recording:
    """Where sensors' axes are not the array's, what a rail in their own axes shows in these."""
    forces = recording.accelerometer_axes
    if forces is None:
        return recording
    rates, changed = forces, dict[str, Any]()
    if layout is not None:
        triads = layout["gyroscopes"]["triads"].values()
        rates = np.array([rotation(one.get("axes", list("xyz")), "gyroscopes") for one in triads])
    for (kind, name), turns in zip(KINDS.items(), (forces, rates), strict=True):
        if (np.isclose(turns, 0) | np.isclose(np.abs(turns), 1)).all():
            continue
        own = np.einsum("kji,tkj->tki", turns, getattr(recording, name))
        rails = np.abs(own) >= RAIL * getattr(recording, f"{kind}_range")
        changed[f"{name}_saturated"] = rails_shown(turns, rails)
    return replace(recording, **changed)


def _require_paired(recording: Recording) -> None:
    """InputError where a gyroscope stands at the place of another IMU's accelerometer."""
    labels = recording.accelerometer_labels
    for place, label in enumerate(recording.gyroscope_labels):
        own = labels.index(label) if label in labels else place
        expected = "them in the accelerometers' order, IMUs without one last"
        found = f"{label!r} as number {place + 1}, whose accelerometer is number {own + 1}"
        require(own == place, "gyroscopes", expected, found)


def _opened(paths, columns, topics) -> Opened:
    from imuarray.recording import bags
    from imuarray.recording.mimu_recording import read_board
    from imuarray.recording.table import read_tables

    logs = [Path(path) for path in ([paths] if isinstance(paths, str | PathLike) else paths)]
    if len(logs) == 1 and logs[0].suffix in RECORDINGS:
        return Opened(read_recording(logs[0]), [])
    if not logs or any(log.suffix in RECORDINGS for log in logs):
        raise InputError(f"logs: expected one recording, or what loggers wrote, found {len(logs)}")
    if all(log.is_dir() or log.suffix.lower() in bags.ENDINGS for log in logs):
        return _together(bags.read_bags(logs, columns, topics), [])
    none = "none: name it by --columns (imuarray columns drafts one)"
    require(columns is not None, str(logs[0]), "a YAML that describes it", none)
    if len(logs) == 1 and logs[0].name.endswith(PACKETS):
        recording, account = read_board(logs[0], Path(columns))
        return Opened(recording, account.lines())
    found, lines = read_tables(logs, columns)
    if isinstance(found, Rig):
        return _together(found, lines)
    return _sampled(_with_rails(found, read_layout(columns)), lines)


def _together(found: Rig, lines: list[str]) -> Opened:
    """Samples as they are, or brought to common instants and axes, which is kept."""
    for log in found.logs:
        _require_units(log)
    recording, lines, logs = recording_of(found), [*lines, *found.lines], []
    if recording is not None:
        return _sampled(_with_rails(recording), lines)
    from imuarray.alignment import align

    for log in found.logs:
        log, cleaned = without_garbage_of(log)
        _require_own(log)
        log, railed = _railed(log)
        logs.append(log)
        lines += cleaned + railed
    recording, alignment = align(
        logs, position_prior_sd=found.position_prior_sd, source=found.source
    )
    return Opened(recording, [*lines, *alignment.lines()])


def _sampled(recording: Recording, lines: list[str]) -> Opened:
    """Samples as they are: even instants where stamps jitter, and the rails that show."""
    from imuarray.alignment.align import steadied
    from imuarray.alignment.settings import SETTINGS as ALIGNMENT

    recording, cleaned = without_garbage(recording)
    recording, railed = _railed(recording)
    lines = [*lines, *cleaned, *railed]
    if len(recording.time) < ALIGNMENT.shortest:
        return Opened(recording, lines)
    time, off = steadied(recording.time, recording.angular_rate.mean(axis=1), SETTINGS.sure)
    if off > ALIGNMENT.jitter:
        recording = replace(recording, time=time)
        lines.append(
            f"stamps {1e3 * off:.2g} ms off even readings, which the rates fit better: taken as"
            " even"
        )
    return Opened(recording, lines)


def _require_own(log: Log) -> None:
    """InputError for readings that are frozen, held or another's: interpolated, none shows it."""
    kinds = [(getattr(log, f"{kind}_time"), getattr(log, name)) for kind, name in KINDS.items()]
    for (time, _), (other, _) in (kinds, kinds[::-1]):
        both = time[(time >= other[0]) & (time <= other[-1])]
        force, rate = (
            np.stack([np.interp(both, own, axis) for axis in values.T], axis=1)[:, None]
            for own, values in kinds
        )
        alone = Recording(
            both, force, rate, np.zeros((1, 3)), (log.label,), (log.label,),
            log.accelerometer_noise_sd, log.gyroscope_noise_sd, log.accelerometer_range,
            log.gyroscope_range, 1.0,
        )  # fmt: skip
        if said := repeated(alone):
            raise InputError(f"{log.label}: expected each reading once, found: {said[0]}")


def _require_units(log: Log) -> None:
    """InputError for forces in g or mg that are declared m/s^2: most logs lie still for a while.

    And for rates far beyond the declared range, which they are in deg/s.
    """
    usual = np.median(np.linalg.norm(log.specific_force, axis=1))
    for unit, gravity in (("g", 1.0), ("mg", 1000.0)):
        other = f"are they in {unit}, and the rates in deg/s? State each unit in the YAML"
        require(
            not abs(usual / gravity - 1) < SETTINGS.gravity_within, f"accelerometer {log.label!r}",
            f"some {GRAVITY:.2g} m/s^2 of gravity", f"{usual:.3g}: {other}",
        )  # fmt: skip
    fast, most = np.quantile(np.abs(log.angular_rate), SETTINGS.fast), log.gyroscope_range
    require(
        not 1.5 * most < fast < most / np.radians(1.0), f"gyroscope {log.label!r}",
        f"rates within its range of {most:.3g} rad/s",
        f"{fast:.3g}: are they in deg/s? State each unit in the YAML",
    )  # fmt: skip


def _railed(found: Any) -> tuple[Any, list[str]]:
    """A recording, or a log, with the rails that its readings show within the declared ranges.

    And lines that say so. A recording's triads have each a rail of their own.
    """
    changed: dict[str, Any] = {}
    lines, board = [], isinstance(found, Recording)
    for kind, name in KINDS.items():
        limit, values = getattr(found, f"{kind}_range"), getattr(found, name)
        rails = _rails(values.reshape(len(values), -1, 3), limit)
        if (rails == limit).all():
            continue
        changed[f"{kind}_range"] = rails.max()
        labels = np.array(getattr(found, f"{kind}_labels") if board else [found.label])
        if board:
            known = getattr(found, f"saturated_{kind}s")()
            changed[f"{name}_saturated"] = known | (np.abs(values) >= RAIL * rails[:, None])
        for rail in np.unique(rails[rails < limit]):
            alike = ", ".join(labels[rails == rail])
            whose = f"{kind} {alike}" if board else f"{alike}: {kind}"
            unit = "m/s^2" if kind == "accelerometer" else f"rad/s ({np.degrees(rail):.4g} deg/s)"
            lines.append(
                f"{whose}: clipped at {rail:.4g} {unit}, within its declared range of {limit:.4g}:"
                " that is taken for its range"
            )
    return replace(found, **changed), lines


def _rails(values, limit: float) -> np.ndarray:
    """Ranges (K,) that readings (T, K, 3) of triads show, or that declared; rests are no rails."""
    least = SETTINGS.large * np.abs(values).max(initial=0.0)
    found = [[abs(end) for axis in own.T for end in ends(axis)] for own in values.swapaxes(0, 1)]
    return np.array(
        [min((end for end in own if least < end < RAIL * limit), default=limit) for own in found]
    )
