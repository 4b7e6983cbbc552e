"""The MIMU boards' binary stream: packets with checksum, number and a wrapping time stamp.

A packet is AA, number (uint16), payload length (uint8, 4 + 12 K), 64 MHz time stamp (uint32),
K times accelerometer and gyroscope x, y, z (int16), and the 16-bit sum of all bytes before it;
big endian. Acknowledgements (A0, a byte, their 16-bit sum) may stand between packets.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from imuarray.errors import InputError

START, ACKNOWLEDGEMENT = 0xAA, 0xA0
CLOCK = 64e6  # Hz
WRAP, NUMBERS = 1 << 32, 1 << 16
# Share of packets out of sequence beyond which the file is not one recording.
MOST_OUT_OF_SEQUENCE = 0.01
LISTED = 5  # places of damage named in a summary


@dataclass(frozen=True)
class Account:
    """What became of every byte of the file.

    ``bad``, ``garbage`` and ``out_of_sequence`` are lists of byte offsets (of garbage:
    offset and length), ``lost`` of (index of the sample after the gap, packets missing).
    A bad packet has the right start and length where one was due, and the wrong checksum;
    its bytes count as garbage too, and its number as lost.
    """

    file_bytes: int
    packet_bytes: int
    acknowledgement_bytes: int
    garbage: list[tuple[int, int]] = field(default_factory=list)
    bad: list[int] = field(default_factory=list)
    out_of_sequence: list[int] = field(default_factory=list)
    lost: list[tuple[int, int]] = field(default_factory=list)

    @property
    def garbage_bytes(self) -> int:
        """Bytes that belong to no accepted packet and to no acknowledgement."""
        return sum(length for _, length in self.garbage)

    @property
    def lost_packets(self) -> int:
        """Packets missing by their numbers, between the first and the last accepted one."""
        return sum(count for _, count in self.lost)

    def attributes(self) -> dict[str, int]:
        """The counts, for the recording's file."""
        return {
            "packets_lost": self.lost_packets, "packets_bad": len(self.bad),
            "packets_out_of_sequence": len(self.out_of_sequence),
            "garbage_bytes": self.garbage_bytes,
        }  # fmt: skip

    def lines(self) -> list[str]:
        """A summary for people; damage with its place."""
        counts = self.attributes()
        out = [
            f"lost {counts['packets_lost']}, bad {counts['packets_bad']}, out of sequence"
            f" {counts['packets_out_of_sequence']}, garbage {counts['garbage_bytes']} bytes"
        ]
        for index, count in self.lost[:LISTED]:
            out.append(f"  {count} packet(s) missing before sample {index}")
        for offset, length in self.garbage[:LISTED]:
            out.append(f"  {length} bytes dropped at byte {offset}")
        for offset in self.out_of_sequence[:LISTED]:
            out.append(f"  packet out of sequence dropped at byte {offset}")
        return out


@dataclass(frozen=True)
class MimuStream:
    """Readings of K IMUs: ``counts`` (T, K, 6) int16, accelerometer then gyroscope x, y, z.

    ``ticks`` (T,) of the 64 MHz clock and ``numbers`` (T,) of the packets, both unwrapped and
    starting as in the file.
    """

    counts: np.ndarray
    ticks: np.ndarray
    numbers: np.ndarray
    account: Account

    @property
    def time(self) -> np.ndarray:
        """Seconds from the first packet, (T,)."""
        return (self.ticks - self.ticks[0]) / CLOCK


def read_mimu(path: str | Path) -> MimuStream:
    """Parse a file; everything that is not a sound packet in sequence is dropped and counted.

    InputError where the file is missing, holds no packets, or is not one recording. An
    additive checksum cannot see bytes of one packet exchanged with each other.
    """
    path = Path(path)
    if not path.is_file():
        raise InputError(f"{path}: expected a file of MIMU packets, found none")
    data = np.fromfile(path, np.uint8)
    starts, size = _sound_packets(data, str(path))
    accepted, number, ticks, strangers = _in_sequence(data, starts, str(path))
    account = _account(data, accepted, size, strangers, number)
    packets = data[accepted[:, None] + np.arange(8, size - 2)]
    counts = packets.view(">i2").astype(np.int16).reshape(len(accepted), -1, 6)
    return MimuStream(counts, ticks, number, account)


def _big_endian(data, at, count) -> np.ndarray:
    value = np.zeros(len(at), np.int64)
    for i in range(count):
        value = value * 256 + data[at + i]
    return value


def _sound_packets(data, where) -> tuple[np.ndarray, int]:
    """Offsets of non-overlapping packets with the right checksum, and their size in bytes."""
    at = np.flatnonzero(data == START)
    at = at[at + 3 < data.size]
    length = data[at + 3].astype(np.int64)
    at, length = (x[(length >= 16) & ((length - 4) % 12 == 0)] for x in (at, length))
    whole = at + length + 6 <= data.size
    at, length = at[whole], length[whole]
    sums = np.concatenate([[0], np.cumsum(data, dtype=np.int64)])
    stored = _big_endian(data, at + length + 4, 2)
    good = (sums[at + length + 4] - sums[at]) % NUMBERS == stored
    at, length = at[good], length[good]
    if not at.size:
        raise InputError(
            f"{where}: expected MIMU packets (AA, number, length, ..., checksum), found none in"
            f" {data.size} bytes"
        )
    sizes, counts = np.unique(length, return_counts=True)
    usual = int(sizes[counts.argmax()])
    at = at[length == usual]
    return _apart(at, usual + 6), usual + 6


def _apart(at, size) -> np.ndarray:
    """The packets that do not overlap one accepted before."""
    if (np.diff(at) >= size).all():
        return at
    kept, end = [], -1
    for offset in at.tolist():
        if offset >= end:
            kept.append(offset)
            end = offset + size
    return np.array(kept)


def _in_sequence(data, starts, where):
    """Packets whose numbers advance and whose time stamps agree with them.

    Returns (offsets, unwrapped numbers, unwrapped ticks, offsets dropped).
    """
    number, stamp = _big_endian(data, starts + 1, 2), _big_endian(data, starts + 4, 4)
    if len(starts) < 2:
        return starts, number, stamp, starts[:0]
    steps, passed = np.diff(number) % NUMBERS, np.diff(stamp) % WRAP
    period = float(np.median(passed[steps == 1])) if (steps == 1).any() else float(passed[0])
    linked = _agree(steps, passed, period)
    if linked.all():
        kept = np.arange(len(starts))
    else:
        kept = _longest(number, stamp, period, linked)
    out = np.setdiff1d(np.arange(len(starts)), kept)
    if len(out) > max(MOST_OUT_OF_SEQUENCE * len(starts), 3):
        raise InputError(
            f"{where}: expected one recording, found {len(out)} of {len(starts)} packets out of"
            f" sequence, the first at byte {starts[out[0]]} (numbers or time stamps disagree)"
        )
    steps = np.diff(number[kept]) % NUMBERS
    expected = np.round(steps * period).astype(np.int64)
    passed = np.diff(stamp[kept]) % WRAP
    # the stamp says the time within a turn of its clock, the number how many turns
    passed += WRAP * np.round((expected - passed) / WRAP).astype(np.int64)
    unwrapped = [
        np.concatenate([first[kept[:1]], first[kept[0]] + np.cumsum(step)])
        for first, step in ((number, steps), (stamp, passed))
    ]
    return starts[kept], *unwrapped, starts[out]


def _agree(steps, passed, period) -> np.ndarray:
    """Whether so many packets and so many ticks (modulo the clock's wrap) belong together."""
    off = (passed - np.round(steps * period).astype(np.int64) + WRAP // 2) % WRAP - WRAP // 2
    # a long gap lets the period's own error add up
    return (steps > 0) & (steps < NUMBERS // 2) & (np.abs(off) < period * (0.5 + 1e-3 * steps))


def _longest(number, stamp, period, linked) -> np.ndarray:
    """Indices of the longest run of linked packets, with all that fit before and after it."""
    edges = np.concatenate([[0], np.flatnonzero(~linked) + 1, [len(number)]])
    best = int(np.diff(edges).argmax())

    def fits(one, other):
        step, ticks = (number[other] - number[one]) % NUMBERS, (stamp[other] - stamp[one]) % WRAP
        return bool(_agree(step, ticks, period))

    kept = list(range(edges[best], edges[best + 1]))
    for i in range(edges[best + 1], len(number)):
        if fits(kept[-1], i):
            kept.append(i)
    before = []
    for i in range(edges[best] - 1, -1, -1):
        if fits(i, before[-1] if before else kept[0]):
            before.append(i)
    return np.array(before[::-1] + kept)


def _account(data, accepted, size, strangers, number) -> Account:
    """Classify the bytes between the accepted packets."""
    ends = np.concatenate([[0], accepted + size])
    begins = np.concatenate([accepted, [data.size]])
    acknowledged, garbage, bad = 0, [], []
    for gap in np.flatnonzero(begins > ends):
        first, last = int(ends[gap]), int(begins[gap])
        while first < last:
            if _is_acknowledgement(data, first, last):
                acknowledged, first = acknowledged + 4, first + 4
                continue
            end = first + 1
            while end < last and not _is_acknowledgement(data, end, last):
                end += 1
            garbage.append((first, end - first))
            first = end
    for offset, length in garbage:
        # a whole one: the rest of a packet that the file's end cuts off is no bad packet
        sound = data[offset] == START and length >= size and data[offset + 3] == size - 6
        if sound and offset not in strangers:
            bad.append(offset)
    steps = np.diff(number)
    gaps = np.flatnonzero(steps > 1)
    lost = [(int(i) + 1, int(steps[i]) - 1) for i in gaps]
    return Account(
        data.size, len(accepted) * size, acknowledged, garbage, bad, strangers.tolist(), lost
    )


def _is_acknowledgement(data, at, last) -> bool:
    if at + 4 > last or data[at] != ACKNOWLEDGEMENT:
        return False
    return int(data[at]) + int(data[at + 1]) == 256 * int(data[at + 2]) + int(data[at + 3])
