"""`imuarray` beside mix-cal's equation, on the same simulated boards.

The equation is that of J. Lee, D. Hanley, T. Bretl, Extrinsic calibration of multiple inertial
sensors from arbitrary trajectories (2022), written out here anew: each IMU is paired with a base
IMU, whose gyroscope alone says how the board turns,

    f_k = R_k (f_0 + (omega_dot x + omega x omega x) r_k) + b,    omega_k = R_k omega_0 + c.

`python -m benchmarks.mixcal` prints positions' errors (um, rms) for some seeds a row.
"""

from __future__ import annotations

import argparse
import tempfile
import time
from pathlib import Path

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.optimize import least_squares
from scipy.spatial.transform import Rotation

from benchmarks.board import Board, Options, draw_board, write
from benchmarks.boards import GRADES, LINES, run
from imuarray.recording import Recording, read_recording

IDEAL = {"ideal_accelerometers": True, "ideal_gyroscopes": True}
OFFSETS = {"first-order": LINES["first-order"] + " --gyroscopes offset"}
# What the board is like, which recording the equation is given, other command lines for ours.
ROWS = {
    "mounts 0.3 degrees, else ideal": (Options(**IDEAL), "rec.nc", {}),
    "mounts 2 degrees, else ideal": (Options(mount=2.0, **IDEAL), "rec.nc", {}),
    "two IMUs on 10 cm, at 37 degrees, else ideal": (
        Options(imus=2, turned=37.0, **IDEAL),
        "rec.nc",
        {},
    ),
    "the same, the second 3 ms late": (
        Options(imus=2, turned=37.0, late=0.003, **IDEAL),
        "rec.nc",
        {},
    ),
    "two IMUs, scale errors, corrected": (Options(imus=2, turned=37.0), "corrected.nc", {}),
    "real scale errors, gyroscopes' offsets corrected": (Options(), "corrected.nc", OFFSETS),
    "the same, gyroscopes' maps corrected": (Options(), "corrected.nc", {}),
}


def pair(recording: Recording, other: int) -> np.ndarray:
    """Position (3,) m of an IMU relative to the first, by mix-cal's equation."""
    time, (force, turn) = recording.time, (recording.specific_force, recording.angular_rate)
    spline = CubicSpline(time, turn[:, 0])
    lost = recording.saturated_gyroscopes() | recording.saturated_accelerometers()
    # a derivative needs its neighbours
    used = ~np.convolve(lost.any(axis=(1, 2)), np.ones(9), "same").astype(bool)
    base, rate, change = force[used, 0], turn[used, 0], spline(time[used], 1)
    noise = recording.accelerometer_noise_sd, recording.gyroscope_noise_sd

    def residual(x):
        turned, place, offset, bias, own = Rotation.from_rotvec(x[:3]), *np.split(x[3:], 4)
        omega = rate - bias
        at = base + np.cross(omega, np.cross(omega, place)) + np.cross(change, place)
        forces = force[used, other] - turned.apply(at) - offset
        rates = turn[used, other] - turned.apply(omega) - own
        return np.concatenate([forces.ravel() / noise[0], rates.ravel() / noise[1]]) / np.sqrt(2)

    start = np.zeros(15)
    start[:3] = Rotation.align_vectors(turn[used, other], rate)[0].as_rotvec()
    start[3:6] = recording.relative_positions()[other]
    return least_squares(residual, start, x_scale="jac", method="lm").x[3:6]


def by_equation(recording: Recording, board: Board) -> tuple[float, float]:
    """Error (um, rms) of the positions, CPU s; of the samples in which the board is twisted."""
    begin, started = board.time[-1] - board.options.twisting, time.process_time()
    moving = recording.select(recording.time > begin)
    count = len(board.drawing)
    found = np.array([pair(moving, k) for k in range(1, count)])
    error = found - board.truth.positions[1:]
    return 1e6 * np.sqrt(np.mean(error**2)), time.process_time() - started


def by_commands(folder: Path, board: Board, lines: dict) -> tuple[float, float]:
    """The same by README's commands."""
    started = time.process_time()
    for name in ("convert", "first-order", "calibrate"):
        status, said = run((LINES | lines)[name], folder)
        if status != 0:
            raise SystemExit(f"{name}: status {status}: {said}")
    return GRADES["calibrate"](folder, board)["error_um"], time.process_time() - started


def main() -> None:
    """A line a row: errors of ours and of the equation, seed by seed; median CPU s."""
    asked = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    asked.add_argument("--seeds", type=int, default=3)
    for row, (options, given, lines) in ROWS.items():
        found = []
        for seed in range(1, 1 + asked.parse_args().seeds):
            board = draw_board(seed, options)
            with tempfile.TemporaryDirectory() as folder:
                write(board.table(), board.columns(), Path(folder))
                ours = by_commands(Path(folder), board, lines)
                found.append((*ours, *by_equation(read_recording(Path(folder) / given), board)))
        errors, times = np.array(found)[:, ::2].T, np.median(np.array(found)[:, 1::2], axis=0)
        shown = ["/".join(f"{error:.1f}" for error in part) for part in errors]
        print(f"{row}: ours {shown[0]} um, {times[0]:.0f} s; the equation {shown[1]} um,"
              f" {times[1]:.0f} s", flush=True)  # fmt: skip


if __name__ == "__main__":
    main()
