"""A small board by hand: held still in a dozen directions, then twisted, as real sensors show it.

One attitude is integrated through poses, moves and twisting, so gravity is where the true rates put
it. The formulae are written out here once more, on purpose: of the package only the recording's
format and the sums of sinusoids are used, nothing of its measurement model.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pandas as pd
import yaml
from scipy.linalg import rq
from scipy.spatial.transform import Rotation

from imuarray.motion import hand_twisting
from imuarray.recording import Recording

GRAVITY = 9.81  # m/s^2
SUBSTEPS = 5  # of the attitude's integration, to a sample
COUNTS = 32767
RANGES = 16 * 9.80665, np.radians(2000.0)  # m/s^2, rad/s
NOISE = 0.04, np.radians(0.06)  # of one reading, as the datasheet says
PLACES = {  # m, as drawn; of other numbers of IMUs the first ones
    4: [[0, 0, 0], [20e-3, 0, 0], [0, 20e-3, 3e-3], [20e-3, 20e-3, -2e-3],
        [10e-3, 0, 2e-3], [0, 10e-3, -3e-3], [20e-3, 10e-3, 1e-3], [10e-3, 20e-3, 0],
        *([x * 1e-2, y * 1e-2, (x + y) % 3 * 2e-3] for x in range(3, 9) for y in range(4))],
    2: [[0, 0, 0], [100e-3, 0, 0]],
}  # fmt: skip


@dataclass(frozen=True)
class Options:
    """What a board is like; angles in degrees, the rest in SI units.

    ``turned`` is how far the last IMU is turned without anybody's saying so, ``late`` by how much
    it is read late; ``gyroscope_delay`` is that of all gyroscopes against the accelerometers.
    ``shock`` (rad/s) is the ringing where the board touches down; ``flipped`` an axis of the second
    gyroscope whose sign is wrong, or None.
    """

    imus: int = 4
    sampling_rate: float = 200.0
    poses: int = 12
    still: float = 10.0
    move: float = 2.0
    twisting: float = 22.0
    twist_dps: float = 850.0
    bandwidth: float = 4.0
    mount: float = 0.3
    turned: float = 0.0
    late: float = 0.0
    gyroscope_delay: float = 0.0
    shock: float = 0.0
    flipped: int | None = None
    ideal_accelerometers: bool = False
    ideal_gyroscopes: bool = False
    drawing_error: float = 5e-4
    position_prior: float = 7e-4
    gyroscope_walk: float = 2e-5  # rad/s per root second
    accelerometer_walk: float = 0.0  # m/s^2 per root second


def _products(q: np.ndarray) -> np.ndarray:
    """Cumulative products of unit quaternions (N, 4; scalar last), by doubling."""
    q, width = q.copy(), 1
    while width < len(q):
        left, right = q[:-width], q[width:]
        vector = left[:, 3:] * right[:, :3] + right[:, 3:] * left[:, :3]
        vector += np.cross(left[:, :3], right[:, :3])
        scalar = left[:, 3] * right[:, 3] - np.sum(left[:, :3] * right[:, :3], axis=1)
        q[width:] = np.column_stack([vector, scalar])
        width *= 2
    return q / np.linalg.norm(q, axis=1, keepdims=True)


def _window(x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """1 - cos, of mean 1 on (0, 1) and zero outside, and its slope."""
    inside = (x > 0) & (x < 1)
    turn = 2 * np.pi * x
    return np.where(inside, 1 - np.cos(turn), 0.0), 2 * np.pi * np.where(inside, np.sin(turn), 0.0)


def _ramps(t: np.ndarray, length: float) -> tuple[np.ndarray, np.ndarray]:
    """Rises in the first second of ``length`` and falls in the last; and its slope."""
    inside, near = (t > 0) & (t < length), np.minimum(t, length - t)
    rising = near < 1
    value = np.where(rising, (1 - np.cos(np.pi * near)) / 2, 1.0)
    slope = np.where(rising, np.pi / 2 * np.sin(np.pi * near), 0.0) * np.sign(length / 2 - t)
    return inside * value, inside * slope


@dataclass(frozen=True, eq=False)
class _Stretch:
    """A move between two poses or the twisting: rate and acceleration of the hand, from ``start``.

    A move turns by ``angle`` (3,) rad in its mean rate; ``ring`` (rad/s) sounds from its end on.
    """

    start: float
    length: float
    waves: object
    angle: np.ndarray | None = None
    ring: np.ndarray = field(default_factory=lambda: np.zeros(3))

    def _envelope(self, time):
        if self.angle is None:
            return _ramps(time - self.start, self.length)
        value, slope = _window((time - self.start) / self.length)
        return value, slope / self.length

    def rates(self, time: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Angular rate and acceleration at ``time`` (T,), each (T, 3)."""
        value, slope = (x[:, None] for x in self._envelope(time))
        wave, change = (self.waves.rotation.derivative(time, order) for order in (0, 1))
        if self.angle is not None:
            wave = wave + self.angle / self.length
        rate, turn = value * wave, slope * wave + value * change
        ring, ringing = _ring(time - self.start - self.length)
        return rate + ring[:, None] * self.ring, turn + ringing[:, None] * self.ring

    def hand(self, time: np.ndarray) -> np.ndarray:
        """Acceleration in the room, (T, 3) m/s^2."""
        return self._envelope(time)[0][:, None] * self.waves.force.derivative(time)


def _ring(t, frequency=2 * np.pi * 60.0, decay=0.015):
    """A decaying oscillation from 0 on, and its slope."""
    fall = np.where(t > 0, np.exp(-np.maximum(t, 0) / decay), 0.0)
    sine, cosine = np.sin(frequency * t), np.cos(frequency * t)
    return fall * sine, fall * (frequency * cosine - sine / decay)


@dataclass(frozen=True, eq=False)
class Hand:
    """The motion of the reference triad: everything at any instant, the attitude by integration."""

    stretches: tuple[_Stretch, ...]
    duration: float
    step: float

    def rates(self, time: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Angular rate and acceleration in the body's frame at ``time`` (T,), each (T, 3)."""
        rate, turn = np.zeros((2, len(time), 3))
        for part in self.stretches:
            near = (time > part.start) & (time < part.start + part.length + 0.5)
            if near.any():
                found = part.rates(time[near])
                rate[near] += found[0]
                turn[near] += found[1]
        return rate, turn

    def _turns(self, start: np.ndarray, step) -> Rotation:
        """Rotation of the body within ``step`` from ``start`` (T,), to fourth order (Magnus)."""
        node = np.sqrt(3) / 6
        first, second = (self.rates(start + (0.5 + s) * step)[0] for s in (-node, node))
        step = np.reshape(step, (-1, 1))
        vector = step / 2 * (first + second) + step**2 * node / 2 * np.cross(first, second)
        return Rotation.from_rotvec(vector)

    @cached_property
    def _grid(self) -> np.ndarray:
        """Attitudes at multiples of the step, as quaternions."""
        starts = self.step * np.arange(round(self.duration / self.step) + 1)
        turned = _products(self._turns(starts, self.step).as_quat())
        return np.vstack([[0.0, 0.0, 0.0, 1.0], turned])

    def attitude(self, time: np.ndarray) -> Rotation:
        """From the body to the room at ``time`` (T,)."""
        index = np.clip((time / self.step).astype(int), 0, len(self._grid) - 1)
        return Rotation.from_quat(self._grid[index]) * self._turns(
            index * self.step, time - index * self.step
        )

    def force(self, time: np.ndarray) -> np.ndarray:
        """Specific force of the reference triad in the body's frame, (T, 3) m/s^2."""
        room = np.array([0.0, 0.0, GRAVITY]) + sum(part.hand(time) for part in self.stretches)
        return self.attitude(time).apply(room, inverse=True)


def draw_hand(rng, options: Options) -> Hand:
    """Poses all over the sphere, the moves between them, twisting."""
    step = 1 / options.sampling_rate / SUBSTEPS
    stretches, time = [], 0.0
    ups = _spread(options.poses)[rng.permutation(options.poses)]
    attitude = Rotation.identity()
    for up in ups[1:]:
        time += options.still
        now = attitude.inv().apply([0.0, 0.0, 1.0])
        angle = Rotation.align_vectors(now[None], up[None])[0].as_rotvec()
        spin = rng.uniform(-1.5, 1.5) * now
        sizes = np.radians(40.0), 2.0
        ring = options.shock * rng.standard_normal(3)
        part = _Stretch(time, options.move, hand_twisting(rng, *sizes, 3.0, 12), angle + spin, ring)
        time += options.move
        own = Hand((part,), time + 0.5, step)
        attitude = attitude * own.attitude(np.array([time + 0.5]))[0]
        stretches.append(part)
    time += options.still
    # as a rotation vector's rms, not an axis'
    sizes = np.radians(options.twist_dps) / np.sqrt(3), 4.0
    waves = hand_twisting(rng, *sizes, options.bandwidth)
    stretches.append(_Stretch(time, options.twisting, waves))
    return Hand(tuple(stretches), time + options.twisting, step)


def _spread(count: int) -> np.ndarray:
    """Directions spread over the sphere by the golden angle, (count, 3)."""
    z = 1 - (2 * np.arange(count) + 1) / count
    angle = np.pi * (3 - np.sqrt(5)) * np.arange(count)
    flat = np.sqrt(1 - z**2)
    return np.stack([flat * np.cos(angle), flat * np.sin(angle), z], axis=1)


class Truth(NamedTuple):
    """In the frame of the first-order calibration: the axes of IMU 1's accelerometer.

    Positions (A, 3) m relative to IMU 1; rate (T, 3) rad/s; matrices (A, 3, 3) of accelerometers
    and of gyroscopes, reading = matrix @ truth + offset; offsets (A, 3).
    """

    positions: np.ndarray
    rate: np.ndarray
    accelerometers: np.ndarray
    gyroscopes: np.ndarray
    gyroscope_offset: np.ndarray


@dataclass(frozen=True, eq=False)
class Board:
    """A recording as counts, (T, A, 3) integers each, with the drawing and the truth."""

    options: Options
    time: np.ndarray
    force: np.ndarray
    rate: np.ndarray
    drawing: np.ndarray
    truth: Truth

    @property
    def labels(self) -> list[str]:
        """Of the IMUs."""
        return [str(k + 1) for k in range(len(self.drawing))]

    def recording(self) -> Recording:
        """As `imuarray convert csv` reads what `write` has written."""
        labels = tuple(self.labels)
        return Recording(
            self.time, RANGES[0] / COUNTS * self.force, RANGES[1] / COUNTS * self.rate,
            self.drawing, labels, labels, *NOISE, *RANGES, self.options.position_prior,
        )  # fmt: skip

    def columns(self) -> dict:
        """The description of the table, in mm, m/s^2 and deg/s."""
        triads = {
            kind: {label: {"columns": [f"{kind}{axis}{label}" for axis in "xyz"]}
                   for label in self.labels} for kind in "ag"
        }  # fmt: skip
        for label, place in zip(self.labels, self.drawing, strict=True):
            triads["a"][label]["position"] = (1e3 * place).tolist()
        kinds = {"a": ("m/s^2", NOISE[0], RANGES[0])}
        kinds["g"] = ("deg/s", *np.degrees([NOISE[1], RANGES[1]]).tolist())
        a, g = (
            {"unit": unit, "scale": limit / COUNTS, "noise": noise, "range": limit,
             "triads": triads[kind]}
            for kind, (unit, noise, limit) in kinds.items()
        )  # fmt: skip
        return {
            "time": {"column": "t", "unit": "s"}, "position_unit": "mm",
            "position_prior": 1e3 * self.options.position_prior, "accelerometers": a,
            "gyroscopes": g,
        }  # fmt: skip

    def write(self, folder: Path) -> None:
        """log.csv and columns.yaml."""
        write(self.table(), self.columns(), folder)

    def table(self) -> pd.DataFrame:
        """Counts by column, with the time in s."""
        table = pd.DataFrame({"t": np.round(self.time, 6)})
        for kind, counts in (("a", self.force), ("g", self.rate)):
            for k, label in enumerate(self.labels):
                for i, axis in enumerate("xyz"):
                    table[f"{kind}{axis}{label}"] = counts[:, k, i]
        return table


def write(table: pd.DataFrame, columns: dict, folder: Path) -> None:
    """log.csv and columns.yaml."""
    folder.mkdir(parents=True, exist_ok=True)
    table.to_csv(folder / "log.csv", index=False)
    (folder / "columns.yaml").write_text(yaml.safe_dump(columns, sort_keys=False), encoding="utf-8")


def _matrices(rng, options: Options, scale: float, skew: float, ideal: bool) -> np.ndarray:
    errors = skew * rng.standard_normal((options.imus, 3, 3))
    errors[:, range(3), range(3)] = scale * rng.standard_normal((options.imus, 3))
    return np.eye(3) + (0.0 if ideal else 1.0) * errors


class Chips(NamedTuple):
    """How IMUs read and where they sit: matrices (A, 3, 3), drawing and places (A, 3) m."""

    accelerometers: np.ndarray
    gyroscopes: np.ndarray
    drawing: np.ndarray
    places: np.ndarray


def draw_chips(rng, options: Options) -> Chips:
    """Scales, skews and mounts of each IMU, and how far the drawing is off."""
    count = options.imus
    axes = rng.standard_normal((count, 3))
    axes /= np.linalg.norm(axes, axis=1, keepdims=True)
    angles = np.full(count, options.mount)
    angles[-1] += options.turned
    mounts = Rotation.from_rotvec(np.radians(angles)[:, None] * axes).as_matrix()
    a = _matrices(rng, options, 8e-3, 6e-3, options.ideal_accelerometers) @ mounts
    g = _matrices(rng, options, 5e-3, 3e-3, options.ideal_gyroscopes) @ mounts
    if options.flipped is not None:
        g[1, options.flipped] *= -1
    drawing = np.array(PLACES[2 if count == 2 else 4][:count])
    error = options.drawing_error * rng.standard_normal((count, 3))
    return Chips(a, g, drawing, drawing + error - error[0])


def draw_biases(rng, count: int) -> tuple[np.ndarray, np.ndarray]:
    """Offsets (A, 3) of accelerometers, m/s^2, and of gyroscopes, rad/s."""
    return (
        0.05 * GRAVITY * rng.standard_normal((count, 3)),
        np.radians(0.8 * rng.standard_normal((count, 3))),
    )


def read_out(rng, chips: Chips, true, offsets, noise) -> list[np.ndarray]:
    """Counts (T, A, 3) of both kinds from what there is to be read, (T, A, 3) each."""
    readings = (
        np.einsum("kij,tkj->tki", m, x) + b + sd * rng.standard_normal(x.shape)
        for m, x, b, sd in zip(chips[:2], true, offsets, noise, strict=True)
    )
    return [
        np.clip(np.round(x / limit * COUNTS), -COUNTS, COUNTS).astype(int)
        for x, limit in zip(readings, RANGES, strict=True)
    ]


def draw_board(seed: int, options: Options = Options()) -> Board:
    """A board and its recording; the same seed and options give the same one."""
    rng = np.random.default_rng([seed, 23])
    hand, count = draw_hand(rng, options), options.imus
    time = np.arange(round(hand.duration * options.sampling_rate)) / options.sampling_rate
    chips = draw_chips(rng, options)
    late = np.zeros(count)
    late[-1] = options.late
    true = truths(hand, time, chips.places, late, options.gyroscope_delay)
    bias = draw_biases(rng, count)
    walk = rng.standard_normal((len(time), count, 3)).cumsum(axis=0)
    walk *= options.gyroscope_walk / np.sqrt(options.sampling_rate)
    walked = np.random.default_rng([seed, 24]).standard_normal(walk.shape).cumsum(axis=0)
    walked *= options.accelerometer_walk / np.sqrt(options.sampling_rate)
    noise = np.array(NOISE) * rng.uniform(0.9, 1.1, 2)
    counts = read_out(rng, chips, true, (bias[0] + walked, bias[1] + walk), noise)
    truth = in_frame(chips, hand.rates(time)[0], bias[1])
    return Board(options, time, *counts, chips.drawing, truth)


def truths(hand: Hand, time, places, late, delay):
    """Specific force and rate (T, A, 3) at each sensor's own instants."""
    force, turn, done = [], [], {}
    for place, age in zip(places - places[0], late, strict=True):
        if age not in done:
            own = time - age
            done[age] = hand.force(own), *hand.rates(own), hand.rates(own - delay)[0]
        base, rate, change, seen = done[age]
        inner = np.cross(rate, place)
        force.append(base + np.cross(rate, inner) + np.cross(change, place))
        turn.append(seen)
    return np.stack(force, axis=1), np.stack(turn, axis=1)


def in_frame(chips: Chips, rate, offset) -> Truth:
    """Turned so that the matrix of IMU 1's accelerometer is upper triangular."""
    a, g, places = chips.accelerometers, chips.gyroscopes, chips.places
    upper, rotation = rq(a[0])
    rotation = np.sign(np.diag(upper))[:, None] * rotation
    turned = (places - places[0]) @ rotation.T, rate @ rotation.T, a @ rotation.T, g @ rotation.T
    return Truth(*turned, offset)
