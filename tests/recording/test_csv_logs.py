"""Tables of IMUs with stamps of their own: one file each, or one file with blank cells."""

import numpy as np
import pytest
import yaml

from imuarray.errors import InputError
from imuarray.recording import rig
from imuarray.recording.record import Recording
from imuarray.recording.table import read_tables
from tests.doc_pages import ROOT, blocks
from tests.recording.cases import HEADER, blank, layout, table
from tests.recording.cases import read as read_board

G, DEGREE = 9.80665, np.pi / 180


def description(**more) -> dict:
    """Three IMUs whose loggers wrote the same columns, in us, g and deg/s."""
    return {
        "time": {"column": "t", "unit": "us"},
        "columns": ["ax", "ay", "az", "gx", "gy", "gz"],
        "position_unit": "mm", "position_prior": 5,
        "accelerometers": {"unit": "g", "scale": 0.5, "noise": 0.004, "range": 16},
        "gyroscopes": {"unit": "deg/s", "noise": 0.06, "range": 2000},
        "imus": {
            "front": {"position": [0, 0, 0]},
            "rear": {"position": [100, 0, 0]},
            "top": {"position": [0, 0, 80], "axes": ["-y", "-x", "-z"]},
        },
    } | more  # fmt: skip


def numbers(seed, samples=5):
    return np.round(np.random.default_rng(seed).normal(0, 1, (samples, 6)), 3)


def put(folder, files: dict, columns=None) -> Recording | rig.Rig:
    """Files by name: header and rows of cells, numbers or text."""
    paths = []
    for name, rows in files.items():
        paths.append(folder / name)
        paths[-1].parent.mkdir(exist_ok=True)
        paths[-1].write_text("\n".join(",".join(map(str, row)) for row in rows) + "\n")
    columns = description() if columns is None else columns
    (folder / "rig.yaml").write_text(yaml.safe_dump(columns, sort_keys=False))
    return read_tables(paths, folder / "rig.yaml")[0]


def log(stamps, values, names="t,ax,ay,az,gx,gy,gz"):
    rows = ([t, *row] for t, row in zip(stamps, np.asarray(values).tolist(), strict=True))
    return [names.split(","), *rows]


def three(start=1_700_000_000_000_000):
    """Stamps in us since 1970, each log from its own beginning at its own rate."""
    stamps = {
        name: start + offset + step * np.arange(5)
        for name, offset, step in (("front", 40, 5000), ("rear", 0, 5000), ("top", 7, 10_000))
    }
    return stamps, {f"{name}.csv": log(t, numbers(i)) for i, (name, t) in enumerate(stamps.items())}


def test_a_log_for_each_imu(tmp_path):
    stamps, files = three()
    found = put(tmp_path, files)
    for i, (log, name) in enumerate(zip(found.logs, stamps, strict=True)):
        assert log.label == name
        expected = (stamps[name] - stamps["rear"][0]) * 1e-6
        np.testing.assert_allclose(log.accelerometer_time, expected, rtol=0, atol=1e-15)
        np.testing.assert_array_equal(log.gyroscope_time, log.accelerometer_time)
        np.testing.assert_allclose(log.specific_force, 0.5 * G * numbers(i)[:, :3], rtol=1e-15)
        np.testing.assert_allclose(log.angular_rate, DEGREE * numbers(i)[:, 3:], rtol=1e-15)
        assert log.accelerometer_noise_sd == pytest.approx(0.004 * G)
        assert log.gyroscope_range == pytest.approx(2000 * DEGREE)
    np.testing.assert_array_equal(found.logs[0].axes, np.eye(3))
    assert found.logs[1].axes is None
    np.testing.assert_array_equal(found.logs[2].axes, [[0, -1, 0], [-1, 0, 0], [0, 0, -1]])
    np.testing.assert_allclose(found.logs[2].position, [0, 0, 0.08])
    assert found.position_prior_sd == 5e-3 and found.lines == []
    assert rig.recording_of(found) is None


def test_the_documented_rigs(tmp_path):
    page = {b.note: b.text for b in blocks(ROOT / "docs" / "convert.md") if b.kind == "file"}
    columns = yaml.safe_load(page["rig.yaml"])
    files = {f"{name}.csv": log(np.arange(3), numbers(0, 3)) for name in ("front", "rear")}
    names = [imu.label for imu in put(tmp_path, files | {"logger3/imu.csv": log(
        np.arange(3), numbers(1, 3))}, columns).logs]  # fmt: skip
    assert names == ["front", "rear", "mast"]
    phone, boards = (
        yaml.safe_load(b.text)["imus"] for b in blocks(ROOT / "docs" / "convert.md")
        if b.text.startswith("imus:")
    )  # fmt: skip
    both = {f"{name}.csv": log(np.arange(3), numbers(0, 3)[:, :3], "t,x,y,z")
            for name in ("Accelerometer", "Gyroscope")}  # fmt: skip
    assert put(tmp_path, both, columns | {"imus": phone}).logs[0].label == "phone"
    head = "t,ax1,ay1,az1,gx1,gy1,gz1,ax2,ay2,az2,gx2,gy2,gz2,t_gyro2"
    wide = log(np.arange(3), np.hstack([numbers(0, 3), numbers(1, 3), [[1], [2], [2.5]]]), head)
    found = put(tmp_path, {"log.csv": wide}, columns | {"imus": boards}).logs[1]
    np.testing.assert_allclose(found.gyroscope_time, [1e-6, 2e-6, 2.5e-6])


def test_files_are_found_by_the_end_of_their_path(tmp_path):
    _, files = three()
    a, b, c = files.values()
    columns = description()
    for name, path in (("front", "left/imu.csv"), ("rear", "right/imu.csv"), ("top", "c")):
        columns["imus"][name]["log"] = path
    found = put(tmp_path, {"right/imu.csv": b, "c.csv": c, "left/imu.csv": a}, columns)
    np.testing.assert_allclose(found.logs[0].angular_rate, DEGREE * numbers(0)[:, 3:])
    np.testing.assert_allclose(found.logs[1].angular_rate, DEGREE * numbers(1)[:, 3:])
    columns["imus"]["front"]["log"] = "imu"
    with pytest.raises(InputError, match="'front': expected one of .* to be imu, found 2: 'log'"):
        put(tmp_path, {"right/imu.csv": b, "c.csv": c, "left/imu.csv": a}, columns)
    with pytest.raises(InputError, match="'top': expected one of .* to be top, found 0: 'log'"):
        put(tmp_path, {"front.csv": a, "rear.csv": b, "third.csv": c})
    with pytest.raises(InputError, match="third.csv: expected an IMU of .*rig.yaml to be in it"):
        put(tmp_path, {**files, "third.csv": c})


def test_a_file_and_a_clock_for_each_kind(tmp_path):
    """As phones log: accelerometer and gyroscope apart, with the same names, units of their own."""
    columns = description(imus={"phone": {
        "position": [0, 0, 0], "log": ["Acc.csv", "Gyro.csv"], "columns": list("xyzxyz"),
        "time": [{"column": "time", "unit": "ns"}, {"column": "seconds", "unit": "s"}],
    }, "2": {"position": [1, 0, 0], "log": "Acc.csv", "columns": list("xyzzyx"),
             "time": {"rate": 50.0}}})  # fmt: skip
    force, rate = numbers(0, 4)[:, :3], numbers(1, 7)[:, 3:]
    stamps = 1_700_000_000_000_000_001 + 20_000_000 * np.arange(4), 1_700_000_000 + np.arange(7) / 8
    files = {
        "Acc.csv": log(stamps[0], force, "time,x,y,z"),
        "Gyro.csv": log(stamps[1], rate, "seconds,x,y,z"),
    }
    (phone, other), _, lines, *_ = put(tmp_path, files, columns)
    assert phone.angular_rate.shape == (7, 3)
    np.testing.assert_allclose(np.diff(phone.accelerometer_time), 0.02, rtol=1e-12)
    np.testing.assert_allclose(np.diff(phone.gyroscope_time), 0.125, rtol=1e-6)
    np.testing.assert_allclose(other.gyroscope_time, np.arange(4) / 50)  # no time of day
    assert lines == ["2: its stamps are at no time those of phone: both are taken to begin at once"]
    np.testing.assert_allclose(other.angular_rate[:, 0], DEGREE * force[:, 2])


def test_one_file_in_which_each_kind_has_its_clock(tmp_path):
    """Blank or NaN where a sensor read nothing; a reading that was held is written again."""
    names = "ta,ax,ay,az,tg,gx,gy,gz"
    rows = [
        [0, 1, 2, 3, 1, 4, 5, 6],
        ["", "", "", "", 3, 7, 8, 9],
        [4, 1, 2, 4, 3, 7, 8, 9],
        ["nan", "nan", "nan", "nan", 5, 7, 8, 10],
        [8, 1, "", 5, 7, 7, 8, 11],
    ]
    columns = description(imus={"1": {"position": [0, 0, 0], "time": [
        {"column": "ta", "unit": "ms"}, {"column": "tg", "unit": "ms"},
    ]}})  # fmt: skip
    found = put(tmp_path, {"log.csv": [names.split(","), *rows]}, columns)
    (imu,) = found.logs
    np.testing.assert_allclose(imu.accelerometer_time, [0, 0.004])
    np.testing.assert_allclose(imu.specific_force[:, 2], np.array([3, 4]) * 0.5 * G)
    np.testing.assert_allclose(imu.gyroscope_time, [0.001, 0.003, 0.005, 0.007])
    np.testing.assert_allclose(imu.angular_rate[:, 2], DEGREE * np.array([6, 9, 10, 11]))
    assert found.lines == [
        "1: accelerometer: no reading in 3 of 5", "1: gyroscope: the last one again in 1 of 5",
    ]  # fmt: skip


@pytest.mark.filterwarnings("error")  # a refusal is one line
@pytest.mark.parametrize(
    ("row", "cells", "words"),
    [
        (3, {0: 5}, "rear.csv: gx|rear.csv: ax, ay, az: .* increase, found 5 after .* reading 3 "),
        (3, {0: 1_700_000_000_005_000}, "found 1700000000005000 after 1700000000005000 in read"),
        (5, {0: 2e15}, r"stamps of one day \(was .*, found 20{15}.0 after 17.* in reading 5 "),
        (2, {1: "x"}, "rear.csv: column 'ax': expected numbers, found 'x' in data row 2"),
        (2, {5: "inf"}, "rear.csv: column 'gy': expected numbers, found inf in data row 2"),
        (2, {5: "1e40"}, "rear.csv: gx, gy, gz: expected finite numbers, found .* reading 2"),
        (2, {1: "1e308"}, "rear.csv: ax, ay, az: expected finite numbers, found .*inf.* reading 2"),
    ],
)
def test_cells_that_cannot_be_used(tmp_path, row, cells, words):
    _, files = three()
    for column, cell in cells.items():
        files["rear.csv"][row][column] = cell
    with pytest.raises(InputError, match=words):
        put(tmp_path, files)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"columns": ["ax"]}, "'front': expected six columns"),
        ({"columns": ["ax", "ay", "ay", "gx", "gy", "gz"]}, "'front': expected three columns"),
        ({"columns": ["t", "ay", "az", "gx", "gy", "no"]}, "front.csv: expected a column 'no'"),
        ({"time": None}, "time: expected 'column' and 'unit', or 'rate' in Hz, found None"),
        ({"incomplete_rows": "leave out"}, "unknown key 'incomplete_rows'"),
        ({"imus": {"front": {"position": [0, 0, 0]}}}, "rear.csv: expected an IMU of"),
    ],
)
def test_a_description_that_does_not_fit(tmp_path, change, words):
    with pytest.raises(InputError, match=words):
        put(tmp_path, three()[1], description(**change))


def test_loggers_of_another_make(tmp_path):
    """Their own units, noise and ranges; what is not said is as for all."""
    columns = description()
    columns["imus"]["top"] |= {
        "accelerometers": {"unit": "m/s^2", "scale": 2, "noise": 0.01},
        "gyroscopes": {"unit": "rad/s", "range": 40},
    }
    front, _, top = put(tmp_path, three()[1], columns).logs
    np.testing.assert_allclose(top.specific_force, 2 * numbers(2)[:, :3])
    np.testing.assert_allclose(top.angular_rate, numbers(2)[:, 3:])
    assert (top.accelerometer_noise_sd, top.accelerometer_range) == (0.01, 16)
    assert (top.gyroscope_noise_sd, top.gyroscope_range) == (0.06, 40)
    assert front.accelerometer_noise_sd == pytest.approx(0.004 * G)
    columns["imus"]["top"]["gyroscopes"] = {"units": "rad/s"}
    with pytest.raises(InputError, match="'top': gyroscopes: .* unknown key 'units'"):
        put(tmp_path, three()[1], columns)


def test_logs_without_stamps_share_none(tmp_path):
    """Whoever logs by a rate of its own, and as many rows, began at another time."""
    columns = description(time={"rate": 100.0})
    for imu in columns["imus"].values():
        imu["axes"] = ["x", "y", "z"]
    files = three()[1]
    assert rig.recording_of(put(tmp_path, files, columns)) is None
    same = {name: log(range(5), numbers(i)) for i, name in enumerate(files)}
    found = put(tmp_path, same, columns | {"time": {"column": "t", "unit": "ms"}})
    assert rig.recording_of(found).specific_force.shape == (5, 3, 3)


def test_shared_stamps_and_known_axes_are_samples_as_they_are(tmp_path):
    """Of one table that the YAML describes as a board, or as IMUs."""
    expected = read_board(tmp_path, table())
    columns = layout()
    columns["columns"] = None
    columns["imus"] = {
        label: {
            "position": triad["position"], "axes": ["x", "y", "z"],
            "columns": triad["columns"] + columns["gyroscopes"]["triads"][label]["columns"],
        }
        for label, triad in columns["accelerometers"].pop("triads").items()
    }  # fmt: skip
    del columns["gyroscopes"]["triads"]
    found = rig.recording_of(put(tmp_path, {"log.csv": table()}, columns))
    for name in ("time", "specific_force", "angular_rate", "accelerometer_position"):
        np.testing.assert_array_equal(getattr(found, name), getattr(expected, name))
    assert found.accelerometer_labels == expected.gyroscope_labels
    assert found.position_prior_sd == expected.position_prior_sd
    columns["imus"]["2"]["gyroscopes"] = {"range": 500}
    assert rig.recording_of(put(tmp_path, {"log.csv": table()}, columns)) is None


def test_a_board_with_sensors_slower_than_its_log(tmp_path):
    """Triads of one label are an IMU; the others keep their rows."""
    columns = layout()
    for kind in ("accelerometers", "gyroscopes"):
        columns[kind]["triads"]["3"]["axes"] = ["y", "-x", "z"]
    rows = blank(table(8), [f"a{axis}2" for axis in "xyz"], (2, 4, 6, 8))
    found = put(tmp_path, {"log.csv": rows}, columns)
    assert [len(x.accelerometer_time) for x in found.logs] == [8, 4, 8]
    assert [len(x.gyroscope_time) for x in found.logs] == [8, 8, 8]
    assert found.lines == ["2: accelerometer: no reading in 4 of 8"]
    whole = read_board(tmp_path, table(8), columns)
    for i, imu in enumerate(found.logs):
        kept = slice(None, None, 2 if i == 1 else 1)
        np.testing.assert_array_equal(imu.accelerometer_time, whole.time[kept])
        np.testing.assert_array_equal(
            imu.specific_force @ imu.axes.T, whole.specific_force[kept, i]
        )
        np.testing.assert_array_equal(imu.angular_rate @ imu.axes.T, whole.angular_rate[:, i])
    without = layout()
    for triad in without["accelerometers"]["triads"].values():
        del triad["position"]
    assert np.isnan([imu.position for imu in put(tmp_path, {"log.csv": rows}, without).logs]).all()
    wrong = layout()
    wrong["accelerometers"]["triads"]["1"]["columns"] = 5
    with pytest.raises(InputError, match="'1': expected three columns, found '5'"):
        put(tmp_path, {"log.csv": rows}, wrong)
    del columns["gyroscopes"]["triads"]["3"]
    with pytest.raises(InputError, match="blank, an accelerometer and a gyroscope of each label"):
        put(tmp_path, {"log.csv": rows}, columns)
    found = put(tmp_path, {"log.csv": rows}, columns | {"incomplete_rows": "leave out"})
    assert found.selected == "4 of 8 samples"


def test_a_cell_that_is_blank_by_chance_is_refused(tmp_path):
    rows = blank(table(40), ["gy3"], (7,))
    with pytest.raises(InputError, match="NaN in data row 7 .*; `incomplete_rows: leave out`"):
        put(tmp_path, {"log.csv": rows}, layout())


def test_several_tables_need_imus(tmp_path):
    with pytest.raises(InputError, match="expected 'imus', one for each log, found triads"):
        put(tmp_path, {"a.csv": table(), "b.csv": table()}, layout())
    assert HEADER[0] == "t"
