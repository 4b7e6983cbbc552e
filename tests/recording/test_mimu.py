"""The MIMU reader: whole files, every kind of damage, the published recordings."""

import hashlib
import lzma
from pathlib import Path

import numpy as np
import pytest

from imuarray.errors import InputError
from imuarray.geometry import mimu4444_corners
from imuarray.recording.mimu import read_mimu
from imuarray.recording.mimu_recording import read_board, read_positions
from tests.mimu_writer import PERIOD, acknowledgement, packet, packets, readings

DATA = Path(__file__).parents[2] / "data" / "mimu4444"
REAL = {1: 37439, 2: 39301, 3: 37541, 4: 38238, 5: 37257}


def stored(tmp_path, content: bytes):
    path = tmp_path / "data.bin"
    path.write_bytes(content)
    return path


def adds_up(account) -> bool:
    parts = account.packet_bytes + account.acknowledgement_bytes + account.garbage_bytes
    return parts == account.file_bytes


@pytest.mark.parametrize("imus", [1, 3, 8, 20])
def test_a_whole_file_reads_back(tmp_path, imus):
    counts = readings(np.random.default_rng(imus), 100, imus)
    # number and time stamp both wrap on the way
    parts = packets(counts, number=65500, ticks=2**32 - 50 * PERIOD)
    content = acknowledgement(0x28) + b"".join(parts) + acknowledgement(0x22)
    found = read_mimu(stored(tmp_path, content))
    np.testing.assert_array_equal(found.counts, counts)
    np.testing.assert_array_equal(found.numbers, 65500 + np.arange(100))
    np.testing.assert_allclose(found.time, np.arange(100) * 0.016, atol=1e-12)
    assert found.account.acknowledgement_bytes == 8 and adds_up(found.account)
    assert not any(found.account.attributes().values())


def test_a_flipped_byte_costs_one_packet(tmp_path):
    counts = readings(np.random.default_rng(0), 50, 8)
    parts = packets(counts)
    damaged = bytearray(parts[20])
    damaged[40] ^= 0x11
    parts[20] = bytes(damaged)
    found = read_mimu(stored(tmp_path, b"".join(parts)))
    np.testing.assert_array_equal(found.counts, np.delete(counts, 20, axis=0))
    assert found.account.bad == [20 * 106] and found.account.lost == [(20, 1)]
    assert found.account.garbage == [(20 * 106, 106)] and adds_up(found.account)
    assert np.diff(found.time).max() == pytest.approx(0.032)


def test_a_gap_longer_than_the_clocks_turn_keeps_the_time(tmp_path):
    counts = readings(np.random.default_rng(3), 10_000, 1)
    parts = packets(counts)
    found = read_mimu(stored(tmp_path, b"".join(parts[:100] + parts[9000:])))
    assert found.account.lost == [(100, 8900)]
    assert found.time[100] == pytest.approx(9000 * 0.016)


def test_a_time_stamp_that_contradicts_its_number_is_dropped(tmp_path):
    counts = readings(np.random.default_rng(5), 300, 2)
    parts = packets(counts)
    parts[77] = packet(77, 500 * PERIOD, counts[77])
    found = read_mimu(stored(tmp_path, b"".join(parts)))
    np.testing.assert_array_equal(found.counts, np.delete(counts, 77, axis=0))
    assert found.account.out_of_sequence == [77 * len(parts[0])]


def test_two_recordings_in_one_file_are_refused(tmp_path):
    parts = packets(readings(np.random.default_rng(6), 100, 2))
    again = packets(readings(np.random.default_rng(7), 60, 2), number=7, ticks=123_456_789)
    with pytest.raises(InputError, match="one recording.*byte 3400"):
        read_mimu(stored(tmp_path, b"".join(parts + again)))


@pytest.mark.parametrize("content", [b"", b"\xaa" * 5000, b"hello, world\n" * 400, b"\x00" * 999])
def test_foreign_files_are_refused(tmp_path, content):
    with pytest.raises(InputError, match="expected MIMU packets"):
        read_mimu(stored(tmp_path, content))


def test_a_missing_file_is_one_line(tmp_path):
    with pytest.raises(InputError, match="found none"):
        read_mimu(tmp_path / "nothing.bin")


def test_units_rails_and_the_underside(tmp_path):
    counts = np.zeros((2, 8, 6), np.int16)
    counts[0, 0] = [2048, 0, -32768, 164, 0, 32767]  # IMU 1, top
    counts[0, 1] = [2048, 4096, 6144, 164, 328, 492]  # IMU 2, turned over
    path = stored(tmp_path, b"".join(packets(counts)))
    found, _ = read_board(path, DATA / "IMU_positions.csv")
    g, dps = 9.80665, np.pi / 180
    np.testing.assert_allclose(found.specific_force[0, 0], [g, 0, -16 * g])
    np.testing.assert_allclose(found.angular_rate[0, 0, 0], 10 * dps)
    np.testing.assert_allclose(found.specific_force[0, 1], [-2 * g, -g, -3 * g])
    np.testing.assert_allclose(found.angular_rate[0, 1], [-20 * dps, -10 * dps, -30 * dps])
    assert found.saturated_accelerometers()[0, 0].tolist() == [False, False, True]
    assert found.saturated_gyroscopes()[0, 0].tolist() == [False, False, True]
    assert found.saturated_gyroscopes().sum() == 1


@pytest.mark.parametrize(
    "text", ["", "a,b\n1,2\n", "axes,IMU 1\nx,1\ny,2\nz,q\n", "axes,IMU 1\nx,1\ny,2\nz,nan\n"]
)
def test_wrong_positions_are_one_line(tmp_path, text):
    path = tmp_path / "positions.csv"
    path.write_text(text)
    with pytest.raises(InputError, match="expected a header"):
        read_positions(path)


def test_a_compressed_file_reads_as_the_plain_one(tmp_path):
    content = b"".join(packets(readings(np.random.default_rng(8), 60, 3)))
    plain, packed = read_mimu(stored(tmp_path, content)), lzma.compress(content)
    found = read_mimu(stored(tmp_path, packed))
    np.testing.assert_array_equal(found.counts, plain.counts)
    assert found.account == plain.account
    with pytest.raises(InputError, match="expected a whole file compressed by xz"):
        read_mimu(stored(tmp_path, packed[: len(packed) // 2]))


@pytest.mark.parametrize("number", REAL)
def test_the_recordings_are_the_published_ones(number):
    """What is inside has the digest that the README gives."""
    content = lzma.decompress((DATA / f"exp_{number}.bin.xz").read_bytes())
    assert hashlib.sha256(content).hexdigest() in (DATA / "README.md").read_text("utf-8")


@pytest.mark.parametrize("number", REAL)
def test_the_published_recordings(number):
    found = read_mimu(DATA / f"exp_{number}.bin.xz")
    assert len(found.counts) == REAL[number] and adds_up(found.account)
    counts = found.account.attributes()
    assert counts["packets_lost"] == counts["packets_bad"] == 0
    assert counts["packets_out_of_sequence"] == 0
    recording, _ = read_board(DATA / f"exp_{number}.bin.xz", DATA / "IMU_positions.csv")
    positions = recording.accelerometer_position
    np.testing.assert_allclose(positions, mimu4444_corners().positions)
    still = np.linalg.norm(recording.specific_force[:600].mean(axis=0), axis=1)
    assert np.all(np.abs(still - 9.8) < 0.6)  # raw offsets reach 0.6 m/s^2
