"""The MIMU boards' binary stream: packets with checksum, number and a wrapping time stamp.

A packet is AA, number (uint16), payload length (uint8, 4 + 12 K), 64 MHz time stamp (uint32),
K times accelerometer and gyroscope x, y, z (int16), and the 16-bit sum of all bytes before it;
big endian. Acknowledgements (A0, a byte, their 16-bit sum) may stand between packets.
"""

import lzma
from bisect import bisect_left
from collections import deque
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from imuarray.errors import InputError, expecting, require
from imuarray.recording.record import pieces

START, ACKNOWLEDGEMENT = 0xAA, 0xA0
XZ = b"\xfd7zXZ\0"  # how a compressed file begins
CLOCK = 64e6  # Hz
WRAP, NUMBERS = 1 << 32, 1 << 16
# Share of packets out of sequence beyond which the file is not one recording.
MOST_OUT_OF_SEQUENCE = 0.01
# Relative error of the estimated period that a long gap may add up (real clocks: 1e-10).
PERIOD_ERROR = 1e-4
# A packet alone in a file this many packets long is likelier chance than a packet.
MOST_AROUND_ONE = 64
LISTED = 5  # places of damage named in a summary


@dataclass(frozen=True)
class Account:
    """Fate of every byte of the file.

    ``bad``, ``garbage`` and ``out_of_sequence`` are lists of byte offsets (of garbage:
    offset and length), ``lost`` of (index of the sample after the gap, packets missing).
    A bad packet is whole, has the right start and length, and the wrong checksum; its bytes
    count as garbage too, as do those of packets out of sequence, and its number as lost.
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
        strangers = self.out_of_sequence
        out = [
            f"lost {self.lost_packets}, bad {len(self.bad)}, out of sequence {len(strangers)},"
            f" garbage {self.garbage_bytes} bytes"
        ]
        out += _listed([f"{count} packet(s) missing before sample {i}" for i, count in self.lost])
        out += _listed([f"{length} bytes dropped at byte {i}" for i, length in self.garbage])
        return out + _listed([f"packet out of sequence dropped at byte {i}" for i in strangers])


def _listed(places: list[str]) -> list[str]:
    rest = len(places) - LISTED
    return [f"  {place}" for place in places[:LISTED]] + [f"  and {rest} more"] * (rest > 0)


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
    """Parse a file, plain or compressed by xz; what is no sound packet in sequence is counted.

    InputError where the file is missing, holds no packets, or is not one recording. The
    checksum cannot see bytes exchanged within a packet, nor one to two in a thousand of the
    packets with several wrong bytes, as those that sum up to the same are not rare.
    """
    path = Path(path)
    require(path.is_file(), str(path), "a file of MIMU packets", "none")
    content = path.read_bytes()
    if content.startswith(XZ):
        with expecting(path, "a whole file compressed by xz", lzma.LZMAError):
            content = lzma.decompress(content)
    data = np.frombuffer(content, np.uint8)
    starts, size = _sound_packets(data, str(path))
    accepted, number, ticks, strangers = _in_sequence(data, starts, str(path))
    several = len(accepted) > 1 or data.size <= MOST_AROUND_ONE * size
    found = f"one alone, at byte {accepted[0]} of {data.size}"
    require(several, str(path), "MIMU packets that follow each other", found)
    account = _account(data, accepted, size, strangers, number)
    packets = data[accepted[:, None] + np.arange(8, size - 2)]
    counts = packets.view(">i2").astype(np.int16).reshape(len(accepted), -1, 6)
    return MimuStream(counts, ticks, number, account)


def _big_endian(data, at, count) -> np.ndarray:
    return data[at[:, None] + np.arange(count)] @ 256 ** np.arange(count)[::-1]


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
    expected = "MIMU packets (AA, number, length, ..., checksum)"
    require(at.size, where, expected, f"none in {data.size} bytes")
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
    period = _period(steps, passed)
    linked = _agree(steps, passed, period)
    kept = np.arange(len(starts))
    if not linked.all():
        kept = _advancing(number, stamp, period, linked)
        # in step with the longest run is not yet in step with the neighbours
        steps, passed = np.diff(number[kept]) % NUMBERS, np.diff(stamp[kept]) % WRAP
        linked = _agree(steps, passed, period)
        kept = kept[_joined(number[kept], stamp[kept], period, linked)]
    out = np.setdiff1d(np.arange(len(starts)), kept)
    if len(out) > max(MOST_OUT_OF_SEQUENCE * len(starts), 3):
        raise InputError(
            f"{where}: expected one recording, found {len(out)} of {len(starts)} packets out of"
            f" sequence, the first at byte {starts[out[0]]} (numbers or time stamps disagree)"
        )
    return starts[kept], *_unwrapped(number[kept], stamp[kept], period), starts[out]


def _unwrapped(number, stamp, period) -> tuple[np.ndarray, np.ndarray]:
    """Numbers and ticks without their wraps, from the first ones on."""
    steps, passed = np.diff(number) % NUMBERS, np.diff(stamp) % WRAP
    # the stamp says the time within a turn of its clock, the number how many turns
    turns = np.round((steps * period - passed) / WRAP).astype(np.int64)
    return tuple(
        np.concatenate([first[:1], first[0] + np.cumsum(step)])
        for first, step in ((number, steps), (stamp, passed + WRAP * turns))
    )


def _period(steps, passed) -> float:
    """Ticks from one packet to the next: the mean over those that are near the median.

    Neighbours decide; where none has survived, the shortest gaps. The mean, as jitter of the
    stamps cancels in it and not in the median.
    """
    near = steps == max(int(steps[steps > 0].min(initial=NUMBERS)), 1)
    if not near.any():
        return 0.0  # no number advances: nothing will agree
    each = np.sort(passed[near] / steps[near])
    # of an even count the lower one: the mean of a good and a wild value is neither
    median = each[(len(each) - 1) // 2]
    return float(each[np.abs(each - median) <= median / 2].mean())


def _agree(steps, passed, period) -> np.ndarray:
    """True where so many packets and so many ticks (modulo the clock's wrap) belong together."""
    off = (passed - np.round(steps * period).astype(np.int64) + WRAP // 2) % WRAP - WRAP // 2
    # a long gap lets the period's own error add up
    allowed = period * (0.5 + PERIOD_ERROR * steps)
    return (steps > 0) & (steps < NUMBERS // 2) & (np.abs(off) < allowed)


def _advancing(number, stamp, period, linked) -> np.ndarray:
    """Indices of the most packets that advance, of those in step with the longest run's middle.

    The most, so that a repeated packet before a gap does not cost the sound ones before it.
    """
    best = max(pieces(~linked), key=lambda piece: piece.stop - piece.start)
    anchor = (best.start + best.stop) // 2
    steps = (np.diff(number) + NUMBERS // 2) % NUMBERS - NUMBERS // 2
    place = np.concatenate([[0], np.cumsum(steps)])
    away = place - place[anchor]
    off = stamp - stamp[anchor] - np.round(away * period).astype(np.int64)
    off = (off + WRAP // 2) % WRAP - WRAP // 2
    fit = np.flatnonzero(np.abs(off) < period * (1 + PERIOD_ERROR * np.abs(away)))
    return fit[_increasing(place[fit].tolist())] if fit.size else np.array([anchor])


def _increasing(values: list[int]) -> list[int]:
    """Indices of the longest strictly increasing subsequence; of equal values the first."""
    tails, ends, before = [], [], []  # by length: its least last value, and where that is
    for i, value in enumerate(values):
        at = bisect_left(tails, value)
        before.append(ends[at - 1] if at else -1)
        if at < len(tails) and tails[at] == value:
            continue
        tails[at : at + 1], ends[at : at + 1] = [value], [i]
    chain = [ends[-1]]
    while before[chain[-1]] >= 0:
        chain.append(before[chain[-1]])
    return chain[::-1]


def _joined(number, stamp, period, linked) -> np.ndarray:
    """Indices of the longest run of linked packets, with all that fit before and after it."""
    best = max(pieces(~linked), key=lambda piece: piece.stop - piece.start)

    def fits(one, other):
        step, ticks = (number[other] - number[one]) % NUMBERS, (stamp[other] - stamp[one]) % WRAP
        return bool(_agree(step, ticks, period))

    kept = deque(range(best.start, best.stop))
    for i in range(best.stop, len(number)):
        if fits(kept[-1], i):
            kept.append(i)
    for i in range(best.start - 1, -1, -1):
        if fits(i, kept[0]):
            kept.appendleft(i)
    return np.array(kept)


def _account(data, accepted, size, strangers, number) -> Account:
    """Classify the bytes between the accepted packets."""
    ends = np.concatenate([[0], accepted + size])
    begins = np.concatenate([accepted, [data.size]])
    known, dropped = _acknowledgements(data), set(strangers.tolist())
    acknowledged, garbage, bad = 0, [], []
    for gap in np.flatnonzero(begins > ends):
        first, last = int(ends[gap]), int(begins[gap])
        for at in known[slice(*np.searchsorted(known, [first, last - 3]))].tolist():
            if at < first:
                continue  # begins with the last byte of the one before
            if at > first:
                garbage.append((first, at - first))
            acknowledged, first = acknowledged + 4, at + 4
        if last > first:
            garbage.append((first, last - first))
    for offset, length in garbage:
        bad += _bad_packets(data[offset : offset + length], offset, size, dropped)
    steps = np.diff(number)
    lost = [(int(i) + 1, int(steps[i]) - 1) for i in np.flatnonzero(steps > 1)]
    return Account(
        data.size, len(accepted) * size, acknowledged, garbage, bad, strangers.tolist(), lost
    )


def _acknowledgements(data) -> np.ndarray:
    """Offsets of A0, a byte and their 16-bit sum."""
    at = np.flatnonzero(data[: max(data.size - 3, 0)] == ACKNOWLEDGEMENT)
    sums = _big_endian(data, at, 1) + _big_endian(data, at + 1, 1)
    return at[sums == _big_endian(data, at + 2, 2)]


def _bad_packets(piece, offset, size, strangers) -> list[int]:
    """Whole packets in a piece of garbage that are not those out of sequence."""
    begin = piece[: max(len(piece) - size + 1, 0)]
    starts = np.flatnonzero((begin == START) & (piece[3 : 3 + len(begin)] == size - 6))
    found = offset + _apart(starts, size)
    return [at for at in found.tolist() if at not in strangers]
