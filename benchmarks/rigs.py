"""Loose IMUs, each with its own log, clock and orientation, beside the truth.

`python -m benchmarks.rigs walk --rigs 20` draws rigs of four IMUs at 200, 200, 100 and 190 Hz that
are moved by hand as `board`'s are, aligns their logs, and runs first-order and calibrate on what
comes out; `pairs` does so with two IMUs on 10 cm at 37 degrees, `shaken` with faster and faster
motion. From the project's root.
"""

from __future__ import annotations

from dataclasses import dataclass, fields, replace
from functools import partial
from pathlib import Path

from benchmarks.boards import GRADES, LINES, parser, summary, walks  # before numpy's threads

import numpy as np  # isort: skip
import pandas as pd
import yaml
from scipy.spatial.transform import Rotation

from benchmarks.board import (
    COUNTS,
    NOISE,
    RANGES,
    Chips,
    Options,
    Truth,
    draw_biases,
    draw_chips,
    draw_hand,
    in_frame,
    read_out,
    truths,
)
from imuarray.recording import load_dataset

COLUMNS = [kind + axis for kind in "ag" for axis in "xyz"]
PAIR = {"imus": 2, "rates": "200,200", "mount": 0.0, "turned": 37.0, "offset": 3e-3,
        "mounted": True}  # fmt: skip
EXTRA = "clock_us", "clock_worst_us", "turn_deg", "a_deg", "g_deg"  # of which the worst is shown
SHAKEN = 4.0, 8.0, 12.0, 16.0, 20.0, 24.0, 48.0  # Hz, bandwidth of the twisting


@dataclass(frozen=True)
class Loose(Options):
    """A board's options and those of the logs.

    ``rates`` in Hz by each log's own clock. Clocks are up to ``offset`` s and ``drift`` off the
    first one; stamps are ``jitter`` s (sd) wrong and rounded to ``resolution`` s. Each IMU but the
    first is turned at random, without anybody's saying so, or ``mounted`` as a board's are.
    """

    rates: str = "200,200,100,190"
    offset: float = 20e-3
    drift: float = 200e-6
    jitter: float = 0.0
    resolution: float = 1e-6
    mounted: bool = False


@dataclass(frozen=True, eq=False)
class Rig:
    """Logs in counts and the truth: stamps = ``offset`` + (1 + ``drift``) time, (A,) each."""

    options: Loose
    tables: list[pd.DataFrame]
    drawing: np.ndarray
    offset: np.ndarray
    drift: np.ndarray
    twisting: tuple[float, float]
    truth: Truth

    def columns(self) -> dict:
        """The description of the logs, in mm, m/s^2 and deg/s."""
        a, g = (
            ("m/s^2", NOISE[0], RANGES[0]),
            ("deg/s", *np.degrees([NOISE[1], RANGES[1]]).tolist()),
        )
        a, g = (
            {"unit": unit, "scale": limit / COUNTS, "noise": noise, "range": limit}
            for unit, noise, limit in (a, g)
        )
        places = {f"imu{k + 1}": (1e3 * x).tolist() for k, x in enumerate(self.drawing)}
        return {
            "time": {"column": "t", "unit": "s"}, "columns": COLUMNS, "position_unit": "mm",
            "position_prior": 1e3 * self.options.position_prior, "accelerometers": a,
            "gyroscopes": g, "imus": {name: {"position": x} for name, x in places.items()},
        }  # fmt: skip

    def write(self, folder: Path) -> None:
        """imu1.csv and so on, and rig.yaml."""
        folder.mkdir(parents=True, exist_ok=True)
        for k, table in enumerate(self.tables):
            table.to_csv(folder / f"imu{k + 1}.csv", index=False)
        (folder / "rig.yaml").write_text(yaml.safe_dump(self.columns()), encoding="utf-8")


def draw_rig(seed: int, options: Loose = Loose()) -> Rig:
    """A rig and its logs; the same seed and options give the same ones."""
    rng = np.random.default_rng([seed, 25])
    hand, chips = draw_hand(rng, options), draw_chips(rng, options)
    count = options.imus
    if not options.mounted:
        turns = Rotation.random(count, rng).as_matrix()
        turns[0] = np.eye(3)
        chips = chips._replace(accelerometers=chips[0] @ turns, gyroscopes=chips[1] @ turns)
    offset, drift = (size * rng.uniform(-1, 1, count) for size in (options.offset, options.drift))
    offset[0] = drift[0] = 0.0
    bias, noise = draw_biases(rng, count), np.array(NOISE) * rng.uniform(0.9, 1.1, 2)
    tables = []
    for k, rate in enumerate(map(float, options.rates.split(","))):
        # a first reading within the first two, so that none is before the hand's time
        stamps = 0.05 + (rng.uniform() + np.arange(int((hand.duration - 0.1) * rate))) / rate
        instants = (stamps - offset[k]) / (1 + drift[k])
        stamps = stamps + options.jitter * rng.standard_normal(len(stamps))
        stamps = np.maximum.accumulate(np.round(stamps / options.resolution)) * options.resolution
        # rounding may shift all stamps of a log alike
        offset[k] = np.mean(stamps - (1 + drift[k]) * instants)
        counts = _counts(rng, k, options, hand, chips, instants, bias, noise)
        tables.append(pd.DataFrame(counts, columns=COLUMNS))
        tables[-1].insert(0, "t", stamps)
    start = hand.duration - options.twisting
    truth = in_frame(chips, np.zeros((1, 3)), bias[1])
    twisting = start, hand.duration
    return Rig(options, tables, chips.drawing, offset, drift, twisting, truth)


def _counts(rng, k, options, hand, chips, instants, bias, noise) -> np.ndarray:
    """What IMU k reads at ``instants`` (T,), (T, 6)."""
    one = Chips(*(part[k : k + 1] for part in chips))
    places = np.vstack([chips.places[:1], one.places])
    true = truths(hand, instants, places, np.zeros(2), options.gyroscope_delay)
    steps = options.gyroscope_walk * np.sqrt(np.diff(instants, prepend=instants[0]))
    walk = (steps[:, None, None] * rng.standard_normal((len(instants), 1, 3))).cumsum(axis=0)
    counts = read_out(rng, one, [x[:, 1:] for x in true], (bias[0][k], bias[1][k] + walk), noise)
    return np.concatenate([x[:, 0] for x in counts], axis=1)


def _apart(found, true) -> np.ndarray:
    """Degrees between the rotations nearest to matrices (A, 3, 3)."""
    turns = [Rotation.from_matrix(np.array(x)) for x in (_polar(found), _polar(true))]
    return np.degrees((turns[0] * turns[1].inv()).magnitude())


def _rms(x) -> float:
    return float(np.sqrt(np.mean(np.square(x))))


def _polar(matrix) -> np.ndarray:
    left, _, right = np.linalg.svd(matrix)
    return left @ right


def _aligned(folder: Path, rig: Rig) -> dict[str, float]:
    """Clocks while the rig is twisted (us), turns of the gyroscopes against the first (degrees)."""
    found = load_dataset(folder / "rec.nc", "alignment")
    times = np.linspace(*rig.twisting, 100)
    errors, sds = [], []
    for k in range(1, rig.options.imus):
        part = found.isel(imu=k)
        stamps = rig.offset[k] + (1 + rig.drift[k]) * times
        late = stamps - float(part.clock_middle)
        instants = stamps - float(part.clock_offset) - float(part.clock_drift) * late
        errors.append(instants - times - rig.offset[0])
        sds.append(np.hypot(float(part.clock_offset_sd), float(part.clock_drift_sd) * late))
    g = rig.truth.gyroscopes
    seen = np.swapaxes(found.rotation.to_numpy(), 1, 2) @ found.rotation.to_numpy()[0]
    angles = _apart(seen, g @ np.linalg.inv(g[0]))[1:]
    errors, sds = 1e6 * np.array(errors), 1e6 * np.array(sds)
    return {
        "clock_us": np.sqrt(np.mean(errors**2)), "clock_worst_us": np.abs(errors).max(),
        "clock_within": np.mean(np.abs(errors) < 1.96 * sds), "turn_deg": _rms(angles),
    }  # fmt: skip


def _corrected(folder: Path, rig: Rig) -> dict[str, float]:
    """Angles of the chips' axes in the array's, degrees: by accelerometers and by gyroscopes."""
    axes = load_dataset(folder / "corrected.nc").accelerometer_axes.to_numpy()
    turn = load_dataset(folder / "rec.nc", "alignment").rotation.to_numpy()
    maps = load_dataset(folder / "corrected.nc", "first_order").gyroscope_matrix.to_numpy()
    found = np.swapaxes(axes, 1, 2), np.swapaxes(turn, 1, 2) @ maps
    return {
        f"{kind}_deg": _rms(_apart(one, true))
        for kind, one, true in zip("ag", found, rig.truth[2:4], strict=True)
    }


RIG_GRADES = GRADES | {"convert": _aligned, "first-order": _corrected}


def main() -> None:
    """Run what was asked for, and print."""
    given = parser(["walk", "pairs", "shaken"], "rigs", Loose).parse_args()
    options = Loose(**{item.name: getattr(given, item.name) for item in fields(Loose)})
    if given.what == "pairs":
        options = replace(options, **PAIR)
    seeds, commands = range(given.first, given.first + given.rigs), given.commands.split(",")
    keep = None if given.out is None else given.out.resolve()
    logs = " ".join(f"imu{k + 1}.csv" for k in range(options.imus))
    lines = LINES | {"convert": f"convert csv {logs} --columns rig.yaml --out rec.nc"}
    cases = {given.what: options}
    if given.what == "shaken":
        cases = {f"{hz:g}Hz": replace(options, bandwidth=hz) for hz in SHAKEN}
    for name, own in cases.items():
        rigs = partial(draw_rig, options=own)
        found = walks(seeds, rigs, commands, keep, name, lines, RIG_GRADES)
        print(summary(found).dropna(axis=1, how="all").to_string())
        extra = [name for name in EXTRA if name in found]
        print(found.groupby("command", sort=False)[extra].max().dropna(how="all").to_string())


if __name__ == "__main__":
    main()
