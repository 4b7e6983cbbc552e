"""What loggers' tables get wrong: one line that names the place, never a shifted column."""

import numpy as np
import pytest
import yaml

from imuarray.errors import InputError
from imuarray.recording import read_recording, write_recording
from tests.recording.cases import HEADER, blank, layout, read, table


@pytest.mark.parametrize("extra", ["7", ""])
@pytest.mark.parametrize("which", [[1], [3], [1, 2, 3, 4]])
def test_a_row_longer_than_the_header_is_refused(tmp_path, extra, which):
    """With a rate there is no time column to betray that all columns moved by one."""
    rows = [row + [extra] * (i in which) for i, row in enumerate(table())]
    with pytest.raises(InputError, match=f"Expected 19 fields in line {which[0] + 1}, saw 20"):
        read(tmp_path, rows, layout() | {"time": {"rate": 100.0}})


def test_a_header_alone_is_no_log(tmp_path):
    with pytest.raises(InputError, match="expected rows of readings below the header, found none"):
        read(tmp_path, table()[:1])


def test_a_short_row_is_named(tmp_path):
    rows = table()
    rows[3] = rows[3][:-2]
    with pytest.raises(
        InputError, match="'gy3': expected numbers, found none or NaN in data row 3"
    ):
        read(tmp_path, rows)


def test_two_columns_of_one_name_are_refused_where_they_are_asked_for(tmp_path):
    rows = table()
    rows[0] = ["gz3" if name == "gx3" else name for name in HEADER]
    columns = layout()
    columns["gyroscopes"]["triads"].pop("3")
    assert read(tmp_path, rows, columns).angular_rate.shape == (4, 2, 3)
    with pytest.raises(InputError, match="expected a column 'gx3', found none; did you mean gz3"):
        read(tmp_path, rows)
    columns = layout()
    columns["gyroscopes"]["triads"]["3"]["columns"] = ["gy3", "ax1", "gz3"]
    with pytest.raises(InputError, match="one column 'gz3', found several"):
        read(tmp_path, rows, columns)


@pytest.mark.parametrize(("stamp", "words"), [("10", "10 after 10"), ("5", "5 after 10")])
def test_a_time_that_does_not_increase_is_named_by_row(tmp_path, stamp, words):
    rows = table()
    rows[3] = [stamp, *rows[3][1:]]
    with pytest.raises(InputError, match=rf"log.csv: column 't'.*{words} in data row 3"):
        read(tmp_path, rows)


def test_nanoseconds_since_1970_and_a_byte_order_mark(tmp_path):
    rows = [[str(1_700_000_000_000_000_000 + 10_000_000 * i), *row[1:]]
            for i, row in enumerate(table()[1:])]  # fmt: skip
    columns = layout() | {"time": {"column": "t", "unit": "ns"}}
    text = "\ufeff" + "\r\n".join(map(",".join, [HEADER, *rows])) + "\r\n"
    found = read(tmp_path, text, columns)
    np.testing.assert_allclose(found.time, [0, 0.01, 0.02, 0.03], atol=1e-6)


@pytest.mark.parametrize("delimiter", [";", "\t", " ", r"\s+"])
def test_delimiters(tmp_path, delimiter):
    between = "  " if delimiter in (" ", r"\s+") else delimiter
    expected = read(tmp_path, table())
    found = read(tmp_path, table(), layout() | {"delimiter": delimiter}, between)
    np.testing.assert_array_equal(found.specific_force, expected.specific_force)
    np.testing.assert_array_equal(found.time, expected.time)


def test_a_rate_that_is_declared_is_known_to_a_thousandth(tmp_path):
    assert np.isnan(read(tmp_path, table()).clock_sd)
    for own, sd in (({"rate": 100.0}, 1e-3), ({"rate": 100.0, "clock_sd": 1e-5}, 1e-5)):
        found = read(tmp_path, table(), layout() | {"time": own})
        write_recording(found, tmp_path / "rec.nc")
        assert read_recording(tmp_path / "rec.nc").clock_sd == sd


def test_scale_is_what_a_count_is_worth(tmp_path):
    columns = layout()
    columns["accelerometers"] |= {"scale": 1 / 2048}
    plain, scaled = read(tmp_path, table()), read(tmp_path, table(), columns)
    np.testing.assert_allclose(scaled.specific_force * 2048, plain.specific_force)
    assert scaled.accelerometer_noise_sd == plain.accelerometer_noise_sd
    assert scaled.accelerometer_range == plain.accelerometer_range
    np.testing.assert_array_equal(scaled.angular_rate, plain.angular_rate)
    columns["accelerometers"]["scale"] = 0
    with pytest.raises(InputError, match="accelerometers: scale: expected a positive number"):
        read(tmp_path, table(), columns)


@pytest.mark.parametrize("key", ["delimiter", "comment"])
@pytest.mark.parametrize("value", ["", "ab", 5, ["a"]])
def test_delimiter_and_comment_are_one_character(tmp_path, key, value):
    with pytest.raises(InputError, match=f"columns.yaml: {key}: expected one character"):
        read(tmp_path, table(), layout() | {key: value})


@pytest.mark.parametrize("value", [10**400, float("inf"), float("nan"), True])
def test_numbers_that_are_none_as_floats(tmp_path, value):
    columns = layout()
    columns["accelerometers"]["noise"] = value
    with pytest.raises(InputError, match="accelerometers: noise: expected a positive number"):
        read(tmp_path, table(), columns)
    columns = layout()
    columns["accelerometers"]["triads"]["2"]["position"] = [0, value, 0]
    with pytest.raises(InputError, match="accelerometers '2': position: expected three numbers"):
        read(tmp_path, table(), columns)


def test_one_column_named_thrice(tmp_path):
    columns = layout()
    columns["accelerometers"]["triads"]["1"]["columns"] = ["ax1", "ay1", "ax1"]
    with pytest.raises(InputError, match="accelerometers '1': expected three columns"):
        read(tmp_path, table(), columns)


@pytest.mark.parametrize(
    ("extra", "words"),
    [
        ("x: 2001-99-99\n", "month must be in"),
        ("x: " + "[" * 3000 + "]" * 3000 + "\n", "expected YAML"),
        ("position_unit: m\n", "the key 'position_unit' twice"),
        ("x: {1: [0], '1': [1]}\n", "the key '1' twice"),
    ],
)
def test_yaml_that_a_loader_stumbles_over(tmp_path, extra, words):
    """A triad copied and its label forgotten would silently replace the first one."""
    with pytest.raises(InputError, match=words) as caught:
        read(tmp_path, table(), yaml.safe_dump(layout()) + extra)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("label", ["010", "yes", "1e3", "~", "2001-01-01", "0x10"])
def test_labels_and_columns_are_text_as_it_stands(tmp_path, label):
    """YAML reads 010 as 8 and yes as true."""
    rows = table()
    rows[0] = [label if name == "az2" else name for name in HEADER]
    text = yaml.safe_dump(layout()).replace("- az2", f"- {label}").replace("'2':", f"{label}:")
    found = read(tmp_path, rows, text)
    assert found.accelerometer_labels == found.gyroscope_labels == ("1", label, "3")
    np.testing.assert_array_equal(found.specific_force, read(tmp_path, table()).specific_force)


@pytest.mark.parametrize("time", [{"rate": 100.0}, {"column": "t", "unit": "ms"}])
def test_a_sensor_slower_than_the_log(tmp_path, time):
    slow = [f"a{axis}2" for axis in "xyz"]
    rows = blank(table(8), slow, (2, 4, 6, 8))
    columns = layout() | {"time": time}
    with pytest.raises(InputError, match="NaN in data row 2 .*`incomplete_rows: leave out`"):
        read(tmp_path, rows, columns)
    found = read(tmp_path, rows, columns | {"incomplete_rows": "leave out"})
    whole = read(tmp_path, table(8), columns)
    np.testing.assert_array_equal(found.time, whole.time[::2])
    np.testing.assert_array_equal(found.specific_force, whole.specific_force[::2])
    assert (found.selected, whole.selected) == ("4 of 8 samples", "")
    rows[7][1] = "x"  # in the fourth of the rows that are left
    with pytest.raises(InputError, match="'ax1': expected numbers, found 'x' in data row 7"):
        read(tmp_path, rows, columns | {"incomplete_rows": "leave out"})


def test_rows_without_a_stamp_are_left_out_and_rows_keep_their_numbers(tmp_path):
    rows, columns = blank(table(8), ["t"], (3,)), layout() | {"incomplete_rows": "leave out"}
    assert read(tmp_path, rows, columns).selected == "7 of 8 samples"
    rows[6][HEADER.index("t")] = rows[5][HEADER.index("t")]
    with pytest.raises(InputError, match="a time that increases, found .* in data row 6"):
        read(tmp_path, rows, columns)


@pytest.mark.parametrize("rule", ["keep", True, None, []])
def test_what_may_be_done_with_incomplete_rows(tmp_path, rule):
    with pytest.raises(InputError, match="incomplete_rows: expected 'leave out', found"):
        read(tmp_path, table(), layout() | {"incomplete_rows": rule})


def test_a_forgotten_unit_of_positions(tmp_path):
    columns = layout()
    columns.pop("position_unit")
    with pytest.raises(InputError, match="within 2 m .*, found 10: name the position_unit"):
        read(tmp_path, table(), columns)
    found = read(tmp_path, table(), columns | {"position_unit": "m"})  # a vehicle
    assert found.accelerometer_position.max() == 10


@pytest.mark.parametrize(
    ("kind", "unit", "known"),
    [("accelerometers", "m s-2", "m/s^2"), ("gyroscopes", "deg s-1", "deg/s")],
)
def test_units_are_spelled_as_in_recordings(tmp_path, kind, unit, known):
    columns = layout()
    columns[kind]["unit"] = known
    expected = read(tmp_path, table(), columns)
    columns[kind]["unit"] = unit
    found = read(tmp_path, table(), columns)
    np.testing.assert_array_equal(found.specific_force, expected.specific_force)
    np.testing.assert_array_equal(found.angular_rate, expected.angular_rate)


@pytest.mark.parametrize(
    ("factor", "unit", "words"),
    [
        (1, "s", "found 0.1 over 290 s; are they in ms, declared s"),
        (1e-3, "ms", "found 1e.05 over 0.00029 s; are they in s, declared ms"),
        (1e3, "ms", "are they in us, declared ms"),
    ],
)
def test_stamps_of_another_unit_are_one_line(tmp_path, factor, unit, words):
    rows = table(30)
    for row in rows[1:]:
        row[0] = repr(factor * float(row[0]))
    columns = layout()
    columns["time"]["unit"] = unit
    with pytest.raises(InputError, match=f"log.csv: column 't': .* {words}"):
        read(tmp_path, rows, columns)


def test_a_misspelt_key_names_its_neighbour(tmp_path):
    columns = layout() | {"postion_prior": 1.5}
    with pytest.raises(InputError, match="the keys time, .* optionally .*; did you mean position_"):
        read(tmp_path, table(), columns)
