"""Tables as loggers and spreadsheets write them: read, and said; or the reason in one line."""

import bz2
import gzip
import lzma

import numpy as np
import pytest
import yaml

from imuarray.errors import InputError
from imuarray.recording.table import load, read_tables
from tests.recording.cases import HEADER, layout, table

ROWS = 200
PERIOD = 10  # ms
IN_SECONDS = {"column": "t", "unit": "s"}


def read(folder, content, columns=None):
    """(recording, lines)."""
    content = content if isinstance(content, bytes) else content.encode()
    (folder / "log.csv").write_bytes(content)
    (folder / "columns.yaml").write_text(yaml.safe_dump(columns or layout()))
    return read_tables([folder / "log.csv"], folder / "columns.yaml")


def text(rows, delimiter=","):
    return "\n".join(delimiter.join(row) for row in rows) + "\n"


@pytest.fixture
def plain(tmp_path):
    return read(tmp_path, text(table(ROWS)))[0]


def stamped(stamps):
    return [HEADER, *([str(s), *row[1:]] for s, row in zip(stamps, table(ROWS)[1:], strict=True))]


@pytest.mark.parametrize(
    ("content", "words"),
    [
        (text(table(ROWS), ";").replace(".", ","), "columns parted by ';', decimal commas"),
        (text(table(ROWS), "\t"), "columns parted by '\\t'"),
        (text(table(ROWS), "   "), "columns parted by blanks"),
        (text([*table(ROWS), table(ROWS)[-1][:4]])[:-1], "the last row is cut off: left out"),
        (text(table(ROWS)).encode("utf-16"), "encoding utf-16"),
        ("Logger 2.1\nSN 42, rev b\nRate;200 Hz\n" + text(table(ROWS)), "3 lines before"),
        (b"# \xb5g\n" + text(table(ROWS)).encode(), "encoding cp1252"),
    ],
)
def test_a_table_s_form_is_found_and_said(tmp_path, plain, content, words):
    found, lines = read(tmp_path, content)
    np.testing.assert_array_equal(found.specific_force, plain.specific_force)
    np.testing.assert_array_equal(found.time, plain.time)
    assert len(lines) == 1 and words in lines[0]


@pytest.mark.parametrize("module", [gzip, lzma, bz2])
def test_packed_tables_are_unpacked_and_damaged_ones_refused(tmp_path, plain, module):
    suffix = {gzip: "gz", lzma: "xz", bz2: "bz2"}[module]
    path, columns = tmp_path / f"log.csv.{suffix}", tmp_path / "columns.yaml"
    whole = module.compress(text(table(ROWS)).encode())
    path.write_bytes(whole)
    found, lines = read_tables([path], columns)
    np.testing.assert_array_equal(found.specific_force, plain.specific_force)
    assert lines == []
    for content in (whole[:-40], whole[:60] + b"x" * 40 + whole[100:], b"t,ax\n1,2\n"):
        path.write_bytes(content)
        with pytest.raises(InputError, match="expected"):
            read_tables([path], columns)
    (tmp_path / "log.csv").write_bytes(b"PK\3\4 and more")
    with pytest.raises(InputError, match="a spreadsheet, or an archive: save it as CSV"):
        read_tables([tmp_path / "log.csv"], columns)


def test_a_delimiter_may_end_each_line(tmp_path, plain):
    """Also that of the last one, which no line break follows: nothing is cut off."""
    found, lines = read(tmp_path, ",\n".join(",".join(row) for row in table(ROWS)) + ",")
    np.testing.assert_array_equal(found.specific_force, plain.specific_force)
    assert lines == []


def test_a_header_again_and_remarks_among_the_rows_are_left_out(tmp_path, plain):
    """A logger that was started twice, and says how full its battery is."""
    rows = table(ROWS)
    content = text([*rows[:50], HEADER, *rows[50:90]]) + "# battery 3.71 V\n" + text(rows[90:])
    found, lines = read(tmp_path, content)
    np.testing.assert_array_equal(found.specific_force, plain.specific_force)
    np.testing.assert_array_equal(found.time, plain.time)
    drafted, _ = load(tmp_path / "log.csv", {}, "columns.yaml")
    assert all(kind.kind in "if" for kind in drafted.dtypes)
    left = ["log.csv: header again: 1, left out", "log.csv: remarks: 1, left out"]
    assert lines == left


@pytest.mark.parametrize("form", [
    "2026-03-01T12:00:{:09.6f}Z", "2026-03-01 12:00:{:06.3f}", "12:00:{:06.3f}", "59:{:06.3f}",
    "12:59:{:06.3f} AM", "3/13/2026 12:59:{:06.3f} PM", "13.03.2026 12:59:{:06.3f}",
])  # fmt: skip
def test_stamps_may_be_dates(tmp_path, plain, form):
    rows = stamped(form.format(0.001 * PERIOD * k) for k in range(ROWS))
    np.testing.assert_allclose(read(tmp_path, text(rows))[0].time, plain.time, atol=1e-9)


@pytest.mark.parametrize("mark", [".", ":", ","])
def test_times_of_day_go_on_past_midnight(tmp_path, plain, mark):
    """Milliseconds may follow a colon or a comma."""
    stamps = ((86400000 - 990 + PERIOD * k) % 86400000 for k in range(ROWS))
    parts = ((s // 3600000, s // 60000 % 60, s // 1000 % 60, mark, s % 1000) for s in stamps)
    rows = text(stamped("{:02d}:{:02d}:{:02d}{}{:03d}".format(*part) for part in parts), ";")
    np.testing.assert_allclose(read(tmp_path, rows)[0].time, plain.time, atol=1e-9)


def test_a_plain_table_needs_no_words(tmp_path):
    assert read(tmp_path, text(table(ROWS)))[1] == []


def test_rows_out_of_order_are_sorted(tmp_path, plain):
    rows = table(ROWS)
    rows[20], rows[21] = rows[21], rows[20]
    found, lines = read(tmp_path, text(rows))
    np.testing.assert_array_equal(found.specific_force, plain.specific_force)
    assert "1 rows out of order" in lines[0]


def test_a_clock_that_was_set_back_is_no_disorder(tmp_path):
    stamps = PERIOD * np.arange(ROWS)
    stamps[100:] -= 37
    with pytest.raises(InputError, match="a time that increases, found 963 after 990"):
        read(tmp_path, text(stamped(stamps)))


def test_a_stamp_given_twice_is_put_midway_and_a_copied_row_left_out(tmp_path, plain):
    stamps = PERIOD * np.arange(ROWS)
    stamps[50] = stamps[49]
    found, lines = read(tmp_path, text(stamped(stamps)))
    np.testing.assert_allclose(found.time, plain.time)
    assert "1 rows with the stamp of the row before" in lines[0]
    seconds = read(tmp_path, text(stamped(stamps / 1e3)), layout() | {"time": IN_SECONDS})[0]
    np.testing.assert_allclose(seconds.time, plain.time, atol=1e-9)
    rows = table(ROWS)
    found, lines = read(tmp_path, text([*rows[:60], rows[59], *rows[60:]]))
    np.testing.assert_array_equal(found.specific_force, plain.specific_force)
    assert "1 rows are there twice" in lines[0]


@pytest.mark.parametrize("size, step, words", [
    (2**16, PERIOD, "16 bits"), (2**32, PERIOD, "32 bits"),
    (10**9, 1_000_000 * PERIOD, "a second's nanoseconds"),
])  # fmt: skip
def test_a_counter_that_begins_anew_is_carried_on(tmp_path, plain, size, step, words):
    stamps = (size - 99 * step + step * np.arange(ROWS)) % size
    unit = {"time": {"column": "t", "unit": "ms" if step == PERIOD else "ns"}}
    found, lines = read(tmp_path, text(stamped(stamps)), layout() | unit)
    np.testing.assert_allclose(found.time, plain.time)
    assert f"a counter of {words} began anew" in lines[0]


@pytest.mark.parametrize("every", [4, 10])
def test_bursts_and_ticks_are_named(tmp_path, every):
    stamps = PERIOD * every * (np.arange(ROWS) // every)
    with pytest.raises(InputError, match="with the same stamp: bursts of packets, or ticks"):
        read(tmp_path, text(stamped(stamps)))


def test_one_row_for_each_sensor_is_named(tmp_path):
    rows = [[str(PERIOD * (k // 3)), str(k % 3), *row[1:]] for k, row in enumerate(table(ROWS)[1:])]
    with pytest.raises(InputError, match="column 'sensor' that numbers the sensors: one row for"):
        read(tmp_path, text([["t", "sensor", *HEADER[1:]], *rows]))
