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

from benchmarks.boards import GRADES, LINES, parser, summary, walks

import numpy as np  # isort: skip
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
from imuarray.alignment import align
from imuarray.errors import InputError
from imuarray.recording import load_dataset, write_recording
from imuarray.recording.log import Log

PAIR = {"imus": 2, "rates": "200,200", "mount": 0.0, "turned": 37.0, "offset": 3e-3,
        "mounted": True}  # fmt: skip
SHAKEN = 4.0, 8.0, 12.0, 16.0, 24.0, 32.0, 48.0  # Hz, bandwidth of the twisting


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
    """Logs and the truth: ``offset`` and ``drift`` (A,) of stamps = offset + (1 + drift) time."""

    options: Loose
    logs: list[Log]
    offset: np.ndarray
    drift: np.ndarray
    twisting: tuple[float, float]
    truth: Truth

    def write(self, folder: Path) -> None:
        """The folder."""
        folder.mkdir(parents=True, exist_ok=True)


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
    logs = []
    for k, rate in enumerate(map(float, options.rates.split(","))):
        # a first reading within the first two, so that none is before the hand's time
        stamps = 0.05 + (rng.uniform() + np.arange(int((hand.duration - 0.1) * rate))) / rate
        instants = (stamps - offset[k]) / (1 + drift[k])
        stamps = stamps + options.jitter * rng.standard_normal(len(stamps))
        stamps = np.maximum.accumulate(np.round(stamps / options.resolution)) * options.resolution
        # rounding may shift all stamps of a log alike
        offset[k] = np.mean(stamps - (1 + drift[k]) * instants)
        logs.append(_log(rng, k, options, hand, chips, instants, stamps, bias, noise, rate))
    start = hand.duration - options.twisting
    truth = in_frame(chips, np.zeros((1, 3)), bias[1])
    return Rig(options, logs, offset, drift, (start, hand.duration), truth)


def _log(rng, k, options, hand, chips, instants, stamps, bias, noise, rate) -> Log:
    one = Chips(*(part[k : k + 1] for part in chips))
    places = np.vstack([chips.places[:1], one.places])
    true = truths(hand, instants, places, np.zeros(2), options.gyroscope_delay)
    walk = options.gyroscope_walk / np.sqrt(rate)
    walk = walk * rng.standard_normal((len(instants), 1, 3)).cumsum(axis=0)
    counts = read_out(
        rng, one, [x[:, 1:] for x in true], (bias[0][k], bias[1][k] + walk), noise
    )  # fmt: skip
    force, turn = (limit / COUNTS * x[:, 0] for limit, x in zip(RANGES, counts, strict=True))
    return Log(
        str(k + 1), stamps, force, stamps, turn, chips.drawing[k], None,
        NOISE[0], RANGES[0], NOISE[1], RANGES[1],
    )  # fmt: skip


def _apart(found, true) -> np.ndarray:
    """Degrees between the rotations nearest to matrices (A, 3, 3)."""
    turns = [Rotation.from_matrix(np.array(x)) for x in (_polar(found), _polar(true))]
    return np.degrees((turns[0] * turns[1].inv()).magnitude())


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
        "clock_within": np.mean(np.abs(errors) < 1.96 * sds), "turn_deg": angles.max(),
    }  # fmt: skip


def _corrected(folder: Path, rig: Rig) -> dict[str, float]:
    """Angles of the chips' axes in the array's, degrees: by accelerometers and by gyroscopes."""
    axes = load_dataset(folder / "corrected.nc").accelerometer_axes.to_numpy()
    turn = load_dataset(folder / "rec.nc", "alignment").rotation.to_numpy()
    maps = load_dataset(folder / "corrected.nc", "first_order").gyroscope_matrix.to_numpy()
    found = np.swapaxes(axes, 1, 2), np.swapaxes(turn, 1, 2) @ maps
    return {
        f"{kind}_deg": _apart(one, true).max()
        for kind, one, true in zip("ag", found, rig.truth[2:4], strict=True)
    }


def _convert(folder: Path, rig: Rig) -> tuple[int, str]:
    """The recording that the logs' alignment makes: exit status, and what is said."""
    try:
        recording, found = align(rig.logs, position_prior_sd=rig.options.position_prior)
    except InputError as error:
        return 2, str(error)
    (folder / "lines.txt").write_text("\n".join(found.lines()), encoding="utf-8")
    write_recording(recording, folder / "rec.nc", groups={"alignment": found.dataset()})
    return 0, ""


RIG_LINES = LINES | {"convert": _convert}
RIG_GRADES = GRADES | {"convert": _aligned, "first-order": _corrected}


def main() -> None:
    """Run what was asked for, and print."""
    given = parser(["walk", "pairs", "shaken"], "rigs", Loose).parse_args()
    options = Loose(**{item.name: getattr(given, item.name) for item in fields(Loose)})
    if given.what == "pairs":
        options = replace(options, **PAIR)
    seeds, commands = range(given.first, given.first + given.rigs), given.commands.split(",")
    keep = None if given.out is None else given.out.resolve()
    cases = {given.what: options}
    if given.what == "shaken":
        cases = {f"{hz:g}Hz": replace(options, bandwidth=hz) for hz in SHAKEN}
    for name, own in cases.items():
        rigs = partial(draw_rig, options=own)
        found = walks(seeds, rigs, commands, keep, name, RIG_LINES, RIG_GRADES)
        print(summary(found).to_string())


if __name__ == "__main__":
    main()
