"""Damage to MIMU files: each kind exactly located, and mutated files against what was written.

The oracle knows the packets that were written; it shares no code with the reader.
"""

import numpy as np
import pytest

from imuarray.errors import InputError
from imuarray.recording.mimu import LISTED, read_mimu
from tests.mimu_writer import PERIOD, acknowledgement, packet, packets, readings

SAMPLES, FIRST, START = 200, 65450, 2**32 - 10**8  # number and stamp wrap on the way


def read(folder, content: bytes):
    path = folder / "data.bin"
    path.write_bytes(content)
    return read_mimu(path)


def written(seed, imus=2, **options):
    counts = readings(np.random.default_rng(seed), SAMPLES, imus)
    return counts, packets(counts, **options)


def spoilt(part: bytes) -> bytes:
    """One bit of a reading flipped."""
    return part[:20] + bytes([part[20] ^ 1]) + part[21:]


def test_neighbouring_bad_packets_are_all_counted(tmp_path):
    _, parts = written(0)
    size = len(parts[0])
    parts[50:53] = [spoilt(part) for part in parts[50:53]]
    parts[90] = b"\x01\x02\x03" + spoilt(parts[90])
    account = read(tmp_path, b"".join(parts)).account
    assert account.bad == [50 * size, 51 * size, 52 * size, 90 * size + 3]
    assert account.lost == [(50, 3), (87, 1)]
    assert account.garbage == [(50 * size, 3 * size), (90 * size, size + 3)]


def test_a_packet_out_of_sequence_beside_a_bad_one(tmp_path):
    _, parts = written(1, imus=3)
    size = len(parts[0])
    parts[60:60] = [parts[58], spoilt(parts[59])]
    account = read(tmp_path, b"".join(parts)).account
    assert account.out_of_sequence == [60 * size] and account.bad == [61 * size]
    assert account.garbage == [(60 * size, 2 * size)] and account.lost == []


def test_acknowledgements_amid_garbage(tmp_path):
    counts, parts = written(2)
    size = len(parts[0])
    # the second of two that share a byte is none
    between = b"\x01" + acknowledgement(0x28) + b"\x02\x03" + b"\xa0\x00\x00\xa0\x00\x00\xa0"
    found = read(tmp_path, b"".join(parts[:9]) + between + b"".join(parts[9:]))
    np.testing.assert_array_equal(found.counts, counts)
    assert found.account.acknowledgement_bytes == 8
    assert found.account.garbage == [(9 * size, 1), (9 * size + 5, 2), (9 * size + 11, 3)]


@pytest.mark.parametrize("kept", [[0, 5], [0, 2, 4], [3, 5, 8, 12], list(range(0, 200, 2))])
def test_no_two_neighbours_left(tmp_path, kept):
    """The period then comes from the shortest gaps."""
    counts, parts = written(3)
    found = read(tmp_path, b"".join(parts[i] for i in kept))
    np.testing.assert_array_equal(found.counts, counts[kept])
    np.testing.assert_array_equal(found.ticks, np.array(kept) * PERIOD)
    assert not found.account.out_of_sequence


def test_a_wild_stamp_does_not_spoil_the_period(tmp_path):
    counts, parts = written(4)
    found = read(tmp_path, parts[0] + parts[1] + packet(2, 9 * PERIOD, counts[2]))
    np.testing.assert_array_equal(found.counts, counts[:2])
    assert found.account.out_of_sequence == [2 * len(parts[0])]


def test_a_late_first_stamp_is_kept(tmp_path):
    """The published recordings' first period is 2 % short."""
    jitter = np.zeros(SAMPLES, int)
    jitter[0] = 22_000
    counts, parts = written(5, jitter=jitter)
    found = read(tmp_path, b"".join(parts))
    np.testing.assert_array_equal(found.counts, counts)
    assert found.ticks[1] - found.ticks[0] == PERIOD - 22_000


def test_a_stray_packet_from_the_future_costs_only_itself(tmp_path):
    counts, parts = written(6)
    found = read(tmp_path, b"".join(parts[:50] + [parts[150]] + parts[50:]))
    np.testing.assert_array_equal(found.counts, counts)
    assert found.account.out_of_sequence == [50 * len(parts[0])]


def test_one_packet_alone_in_a_long_file_is_refused(tmp_path):
    _, parts = written(7)
    with pytest.raises(InputError, match="found one alone, at byte 40000 of 400"):
        read(tmp_path, bytes(40_000) + parts[0])


def test_a_gap_of_too_many_packets_is_refused(tmp_path):
    counts, parts = written(8)
    for gap in (33_000, 65_536):
        later = packets(counts, number=SAMPLES + gap, ticks=(SAMPLES + gap) * PERIOD)
        with pytest.raises(InputError, match="expected one recording"):
            read(tmp_path, b"".join(parts + later))


def test_unrelated_recordings_hardly_ever_join(tmp_path):
    """Seed 9. By chance one pair in two thousand fits; with a loose tolerance one in 300."""
    rng = np.random.default_rng(9)
    counts, parts = written(9)
    joined = 0
    for _ in range(1000):
        number, ticks = int(rng.integers(2**16)), int(rng.integers(2**32))
        try:
            read(tmp_path, b"".join(parts[:30] + packets(counts[:30], number, ticks)))
            joined += 1
        except InputError as error:
            assert "byte 1020 " in str(error)
    assert joined <= 2


def test_a_summary_says_how_many_places_it_leaves_out(tmp_path):
    _, parts = written(10)
    lines = read(tmp_path, b"".join(part + b"\x00" for part in parts)).account.lines()
    assert len([line for line in lines if "bytes dropped at byte" in line]) == LISTED
    assert lines[-1] == f"  and {SAMPLES - LISTED} more"


def blocks(rng, data, size):
    """Two cuts and a length, aligned to packets half of the time."""
    unit = size if rng.integers(2) else 1
    first, second = sorted(int(x) // unit * unit for x in rng.integers(0, len(data), 2))
    return first, second, int(rng.integers(1, 6)) * unit


def damaged(rng, kind: str, content: bytes, size: int) -> bytes:
    """A file mutated in one way."""
    data = bytearray(content)
    first, second, length = blocks(rng, data, size)
    piece = data[first : first + length]
    if kind == "flips":
        for place in rng.integers(0, len(data), int(rng.choice([1, 2, 10, 100, 1000]))):
            data[place] ^= int(rng.integers(1, 256))
    elif kind == "cut":
        data = data[first:second]
    elif kind == "delete":
        del data[first : first + length]
    elif kind == "insert":
        data[first:first] = rng.bytes(length)
    elif kind == "zero":
        data[first : first + length] = bytes(len(piece))
    elif kind == "random":
        data[first : first + length] = rng.bytes(len(piece))
    elif kind == "headers":
        data[first : first + length] = (content[:4] * length)[: len(piece)]
    elif kind == "repeat":
        data[second:second] = piece
    elif kind == "exchange":
        other = data[second : second + len(piece)]
        data[second : second + len(piece)] = piece[: len(other)]
        data[first : first + len(other)] = other
    elif kind == "foreign":
        data = bytearray(rng.bytes(len(data)) if rng.integers(2) else b"\xaa" * len(data))
    return bytes(data)


KINDS = "flips cut delete insert zero random headers repeat exchange foreign".split()


def places(content: bytes, part: bytes) -> list[int]:
    """All offsets of a packet."""
    found, at = [], content.find(part)
    while at >= 0:
        found.append(at)
        at = content.find(part, at + 1)
    return found


def forged(content: bytes, parts: list[bytes]) -> bool:
    """Whether a stretch passes for a packet that was never written: the checksum is blind."""
    known, size = set(parts), len(parts[0])
    for at in places(content, b"\xaa"):
        piece = content[at : at + size]
        if len(piece) < size or piece[3] != size - 6 or piece in known:
            continue
        if sum(piece[:-2]) % 65536 == int.from_bytes(piece[-2:], "big"):
            return True
    return False


def check(found, content, parts, counts, ticks):
    """Each sample as it was written, each sound packet read or reported, each byte counted."""
    account, size = found.account, len(parts[0])
    index = (found.numbers - FIRST) % 65536
    np.testing.assert_array_equal(found.counts, counts[index])
    np.testing.assert_array_equal(np.diff(found.numbers), np.diff(index))
    np.testing.assert_array_equal(np.diff(found.ticks), np.diff(ticks[index]))
    assert found.ticks[0] == ticks[index[0]] % 2**32
    assert account.lost_packets == index[-1] - index[0] + 1 - len(index)
    rest = account.packet_bytes + account.acknowledgement_bytes + account.garbage_bytes
    assert rest == account.file_bytes == len(content)
    assert account.packet_bytes == len(index) * size
    read_in = set(index.tolist())
    for i, part in enumerate(parts):
        copies = places(content, part)
        out = set(copies) & set(account.out_of_sequence)
        # all copies are reported but the one that is read, where one is
        assert len(copies) - len(out) == (i in read_in)
    for at in account.bad:
        assert content[at] == 0xAA and content[at + 3] == size - 6
        assert content[at : at + size] not in parts


@pytest.mark.parametrize("kind", KINDS)
def test_mutated_files_give_an_error_or_an_exact_account(tmp_path, kind):
    """150 files of each kind, seeded by it; but for those that an additive checksum lets pass."""
    rng = np.random.default_rng([12, KINDS.index(kind)])
    jitter = rng.integers(-20_000, 20_000, SAMPLES)
    counts, parts = written(12, number=FIRST, ticks=START, jitter=jitter)
    ticks = START + np.arange(SAMPLES) * PERIOD + jitter
    content, outcomes = b"".join(parts), {"read": 0, "refused": 0, "forged": 0}
    for _ in range(150):
        mutated = damaged(rng, kind, content, len(parts[0]))
        if forged(mutated, parts):
            outcomes["forged"] += 1
            continue
        try:
            found = read(tmp_path, mutated)
        except InputError as error:
            assert "\n" not in str(error)
            outcomes["refused"] += 1
            continue
        check(found, mutated, parts, counts, ticks)
        outcomes["read"] += 1
    assert outcomes["forged"] <= 20
    assert outcomes["refused"] == 150 if kind == "foreign" else outcomes["read"] > 75
