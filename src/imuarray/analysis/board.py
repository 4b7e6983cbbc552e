"""From logs to an answer on the defaults: first order, calibration, reasons to doubt it."""

from collections.abc import Sequence
from os import PathLike
from pathlib import Path

from imuarray.analysis.logs import open_logs
from imuarray.analysis.model import Notify, silent
from imuarray.analysis.sensors import calibrate_sensors
from imuarray.analysis.settings import SETTINGS
from imuarray.errors import IdentifiabilityError, InputError, require
from imuarray.firstorder.correct import FirstOrder, calibrate_first_order, correct
from imuarray.firstorder.still import still_poses
from imuarray.recording import Recording
from imuarray.recording.units import GRAVITY
from imuarray.recording.validate import check_values
from imuarray.report.board import Board
from imuarray.trust import of_first_order, reasons_of_calibration, reasons_of_poses


def board(
    logs: Sequence[str | PathLike], columns: str | PathLike | None = None,
    gravity: float = GRAVITY, topics: Sequence[str] = (), notify: Notify = silent,
) -> Board:  # fmt: skip
    """All that `imuarray board` finds of some logs, which `write_board` makes a page of.

    ``gravity`` m/s^2; ``topics`` of bags; ``notify`` is called with each remark.
    A log without still poses is calibrated as it is. InputError as of `open_logs`, `first_order`
    and `calibrate`, and for a recording that first order has corrected.
    """
    opened = open_logs(logs, columns, topics)
    recording = opened.recording
    source = ", ".join(Path(path).name for path in logs)
    check_values(recording, source)
    other = "one that is corrected: imuarray calibrate takes that"
    require(recording.correction is None, source, "a log, or a recording as read", other)
    samples, count = len(recording.time), len(recording.accelerometer_labels)
    require(samples >= SETTINGS.fewest, source, f"at least {SETTINGS.fewest} samples", samples)
    notify(f"{samples} samples of {count} IMUs; each sensor from still poses")
    found = _first_order(recording, gravity)
    if isinstance(found, str):
        notify(f"first order left out: {found}")
        corrected = recording
        known = [
            f"first order was left out ({found}): offsets, scales and axes of the sensors are taken"
            " as read, and the sds do not know how far these are off"
        ]
    else:
        corrected, known = correct(recording, found), reasons_of_poses(of_first_order(found))
    notify("positions from the motion")
    calibration = calibrate_sensors([corrected])
    reasons = reasons_of_calibration(corrected, calibration, known)
    return Board(source, opened.lines, recording, found, corrected, calibration, reasons)


def _first_order(recording: Recording, gravity: float) -> FirstOrder | str:
    """First order from still poses and moves, or the reason why there is none."""
    try:
        still_poses(recording)
    except InputError as error:
        return str(error)
    try:
        return calibrate_first_order(recording, gravity)
    except IdentifiabilityError as error:
        return str(error)
