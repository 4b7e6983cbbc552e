"""Readers of tables, recordings and configurations against a thousand damaged files each.

An InputError of one line, or what was written: no other exception, no hang, no wrong number.
MIMU files: `test_mimu_fuzz.py`.
"""

import csv
import io
import time
import warnings

import h5py
import numpy as np
import pytest
import yaml

from imuarray.cli import main
from imuarray.errors import InputError
from imuarray.provenance import is_damaged
from imuarray.recording import channels, read_recording, write_recording
from tests.recording.cases import HEADER, layout, make, table
from tests.recording.cases import read as read_csv

FILES = 1000
SLOW = 5.0  # s of processor time (machines are shared): nothing should take a tenth of that
WORDS = [
    "nan", "inf", "-inf", "1e400", "-1e-400", "", " ", "NA", "None", "true", "0x10", "1_0", "1,5",
    "٣", "\x00", '"', "'", "#", ";", "\t", "\n", "\r", "\ufeff", "9" * 400, "1e5000", "- 1",
    "*a", "&a [*a]", "!!python/object/apply:os.system ['true']", "!!binary x", "{", "[", "%", "|",
    "2001-01-01", "12:30:45", ".nan", "-.inf", "~", "<<: *x", "? x", "\U0001f600",
]  # fmt: skip


def damaged(rng, content: bytes) -> bytes:
    """Bytes changed, cut, repeated, exchanged, or a word put in place of another."""
    data = bytearray(content)
    for _ in range(int(rng.choice([1, 1, 1, 2, 5, 20]))):
        first, second = sorted(int(x) for x in rng.integers(0, len(data) + 1, 2))
        end = min(len(data), first + int(rng.integers(1, 40)))
        kind = rng.integers(7)
        if kind == 0 and first < len(data):
            data[first] ^= int(rng.integers(1, 256))
        elif kind == 1:
            del data[first:end]
        elif kind == 2:
            data[second:second] = data[first:end]
        elif kind == 3:
            data[first:first] = rng.bytes(int(rng.integers(1, 9)))
        elif kind == 4 and rng.integers(5) == 0:
            del data[first:]
        else:
            word = str(rng.choice(WORDS)).encode()
            data[first : first + int(rng.integers(0, 6))] = word
        if not data:
            return b""
    return bytes(data)


def outcome(function):
    """What it gives, or None where it refuses in one line; anything else is a failure."""
    start = time.process_time()
    try:
        with warnings.catch_warnings():  # a refusal is one line
            warnings.simplefilter("error", RuntimeWarning)
            return function()
    except InputError as error:
        assert str(error) and "\n" not in str(error)
        return None
    finally:
        assert time.process_time() - start < SLOW


def plain_numbers(text: str) -> np.ndarray:
    """The table as the csv module and float() read it: an oracle with no line of the reader's."""
    rows = [row for row in csv.reader(io.StringIO(text, newline="")) if row]
    if text[-1] not in "\r\n" and (len(rows[-1]) < len(rows[0]) or rows[-1][-1] in ("", "-")):
        rows.pop()  # cut off
    place = {name: rows[0].index(name) for name in HEADER}
    return np.array([[float(row[place[name]]) for name in HEADER] for row in rows[1:]])


@pytest.mark.parametrize("seed", range(4))
def test_tables(tmp_path, seed):
    rng, read = np.random.default_rng([1, seed]), 0
    content = "\n".join(",".join(row) for row in table(6)).encode() + b"\n"
    for _ in range(FILES // 4):
        mutated = damaged(rng, content)
        try:
            text = mutated.decode()
        except UnicodeDecodeError:
            text = mutated.decode("latin-1")
        found = outcome(lambda text=text: read_csv(tmp_path, text))
        if found is None:
            continue
        read += 1
        numbers = plain_numbers((tmp_path / "log.csv").read_text())
        np.testing.assert_allclose(found.time, numbers[:, 0] / 1e3, rtol=1e-12, atol=1e-12)
        ours = [
            found.specific_force / 9.80665, np.degrees(found.angular_rate),
        ]  # fmt: skip
        theirs = numbers[:, 1:].reshape(len(numbers), 3, 2, 3)
        np.testing.assert_allclose(ours[0], theirs[:, :, 0], rtol=1e-9, atol=1e-12)
        np.testing.assert_allclose(ours[1], theirs[:, :, 1], rtol=1e-9, atol=1e-12)
    assert 0 < read < FILES // 4


def test_layouts_of_tables(tmp_path):
    rng, read = np.random.default_rng(2), 0
    content = yaml.safe_dump(layout()).encode()
    whole = read_csv(tmp_path, table(6))
    for _ in range(FILES):
        text = damaged(rng, content).decode("utf-8", "replace")
        found = outcome(lambda text=text: read_csv(tmp_path, table(6), text))
        if found is not None:
            read += 1
            assert found.specific_force.shape[0] == 6 and np.all(np.isfinite(found.angular_rate))
            assert found.specific_force.shape[1:] <= whole.specific_force.shape[1:]
    assert read < FILES // 2


def test_recordings(tmp_path):
    """Refused, or every value is the one that was written: recordings are sealed."""
    rng, path, refused = np.random.default_rng(4), tmp_path / "rec.nc", 0
    recording = make()
    write_recording(recording, path)
    content = path.read_bytes()
    for _ in range(FILES):
        data = bytearray(content)
        for place in rng.integers(0, len(data), int(rng.choice([1, 2, 8, 64]))):
            data[place] ^= int(rng.integers(1, 256))
        if rng.integers(8) == 0:
            data = data[: int(rng.integers(0, len(data)))]
        path.write_bytes(data)
        found = outcome(lambda: read_recording(path))
        refused += found is None
        assert found is None or np.array_equal(found.specific_force, recording.specific_force)
    assert refused > 0.99 * FILES


def test_a_damaged_seal_is_no_seal(tmp_path):
    path = tmp_path / "rec.nc"
    write_recording(make(), path)
    assert not is_damaged(path)
    data = bytearray(path.read_bytes())
    data[-40] ^= 1
    path.write_bytes(data)
    assert not is_damaged(path)
    assert np.array_equal(read_recording(path).angular_rate, make().angular_rate)


def test_a_recording_changed_by_hand_has_no_seal(tmp_path):
    path = tmp_path / "rec.nc"
    write_recording(make(), path)
    with h5py.File(path, "r+") as file:
        file["angular_rate"][0] = 0.0
    assert not np.any(read_recording(path).angular_rate[0])


def test_what_hangs_or_ends_hdf5_is_refused(tmp_path, monkeypatch):
    """In a process of its own: here one that sleeps, or kills itself, stands for HDF5."""
    path = tmp_path / "rec.nc"
    make().to_dataset().to_netcdf(path, engine="h5netcdf")
    channels.require_readable(path)
    monkeypatch.setattr(channels, "LOOK", "import time; time.sleep(60)")
    with pytest.raises(InputError, match="not through with after 1 s"):
        channels.require_readable(path, 1.0)
    monkeypatch.setattr(channels, "LOOK", "import os; os.kill(os.getpid(), 11)")
    with pytest.raises(InputError, match="crashes"):
        channels.require_readable(path)
    write_recording(make(), path)  # sealed: not looked at
    channels.require_readable(path)


def test_damaged_files_of_other_programs_end_in_a_line(tmp_path):
    """Without a seal, by the command: no traceback, no hang."""
    rng, path = np.random.default_rng(5), tmp_path / "rec.nc"
    make().to_dataset().to_netcdf(path, engine="h5netcdf")
    content = path.read_bytes()
    for _ in range(25):
        data = bytearray(content)
        for place in rng.integers(0, len(data), 64):
            data[place] ^= int(rng.integers(1, 256))
        path.write_bytes(data)
        assert main(["select", str(path), "--out", str(tmp_path / "out.nc"), "--quiet"]) in (0, 2)
