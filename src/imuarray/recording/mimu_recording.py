"""From a MIMU stream and the board's geometry to a recording in the array frame."""

import csv
from pathlib import Path

import numpy as np

from imuarray.errors import expecting, require
from imuarray.geometry.boards import UNDERSIDE_ROTATION
from imuarray.recording.mimu import Account, read_mimu
from imuarray.recording.record import Recording
from imuarray.recording.units import GRAVITY

COUNTS_PER_G = 2048.0
COUNTS_PER_DPS = 16.4
RAIL = 32767
OUTPUT_RATE = 1000.0  # Hz, at which the MPU-9150 makes readings of both kinds


def read_positions(path: str | Path) -> tuple[np.ndarray, tuple[str, ...]]:
    """Nominal positions (A, 3) m and labels; a row an axis, a column an IMU, as published.

    The first row names the IMUs ("IMU 1", ...), the first column the axes x, y, z. InputError
    for anything else.
    """
    where = str(path)
    expected = "a header 'axes, IMU 1, ...' and the rows x, y, z in metres"
    with expecting(where, expected, (OSError, UnicodeDecodeError)):
        text = Path(path).read_text(encoding="utf-8")
    rows = [[cell.strip() for cell in row] for row in csv.reader(text.splitlines()) if row]
    axes = len(rows) == 4 and [row[0] for row in rows[1:]] == ["x", "y", "z"]
    require(axes, where, expected, f"{len(rows)} rows")
    labels = tuple(name.removeprefix("IMU").strip() for name in rows[0][1:])
    even = all(len(row) == len(rows[0]) for row in rows)
    require(even, where, expected, "rows of different lengths")
    with expecting(where, expected, ValueError):
        values = np.array([[float(cell) for cell in row[1:]] for row in rows[1:]]).T
    require(np.isfinite(values).all(), where, expected, "a value that is not finite")
    return values, labels


def turned_labels(labels, text: str | None) -> tuple[str, ...]:
    """Underside IMUs: those listed, separated by commas; None for the even-numbered ones."""
    if text is None:
        return tuple(label for label in labels if label.isdigit() and int(label) % 2 == 0)
    turned = tuple(part.strip() for part in text.split(",") if part.strip())
    for label in turned:
        require(label in labels, "--underside", f"labels of {', '.join(labels)}", label)
    return turned


def read_board(
    path: str | Path, positions: str | Path, underside: str | None = None,
    accelerometer_noise_sd: float = 0.04, gyroscope_noise_sd: float = float(np.radians(0.06)),
    position_prior_sd: float = 3e-3, output_rate: float = OUTPUT_RATE,
) -> tuple[Recording, Account]:  # fmt: skip
    """A file of packets as a recording, and the account of what was dropped.

    Counts become SI units, and the underside's axes are turned into the array frame.
    ``positions`` as `read_positions` has them, ``underside`` as `turned_labels`. InputError where
    the IMUs are not as many as the positions.
    """
    places, labels = read_positions(positions)
    turned = turned_labels(labels, underside)
    stream = read_mimu(path)
    count = stream.counts.shape[1]
    require(count == len(labels), "positions", f"{count} IMUs, as the packets hold", len(labels))
    force = stream.counts[..., :3] * (GRAVITY / COUNTS_PER_G)
    rate = stream.counts[..., 3:] * np.radians(1 / COUNTS_PER_DPS)
    under = np.array([label in turned for label in labels])
    axes = np.where(under[:, None, None], UNDERSIDE_ROTATION, np.eye(3))
    for values in (force, rate):
        values[:, under] = values[:, under] @ UNDERSIDE_ROTATION.T
    recording = Recording(
        time=stream.time, specific_force=force, angular_rate=rate,
        accelerometer_position=places, accelerometer_labels=labels,
        gyroscope_labels=labels, accelerometer_noise_sd=accelerometer_noise_sd,
        gyroscope_noise_sd=gyroscope_noise_sd, position_prior_sd=position_prior_sd,
        accelerometer_range=RAIL / COUNTS_PER_G * GRAVITY,
        gyroscope_range=float(np.radians(RAIL / COUNTS_PER_DPS)), source=Path(path).name,
        accelerometer_axes=axes, output_period=1 / output_rate,
    )  # fmt: skip
    return recording, stream.account
