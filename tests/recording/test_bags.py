"""ROS bags against what their library's writers wrote, and against the same numbers as a table."""

import re
import sys

import numpy as np
import pytest
import yaml

import imuarray
from imuarray.analysis.logs import open_logs
from imuarray.cli import main
from imuarray.errors import InputError
from imuarray.recording.bags import read_bags
from imuarray.recording.record import MATRICES, NUMBERS, QUANTITIES
from imuarray.recording.units import GRAVITY
from tests.bag_writer import KINDS, write
from tests.doc_pages import ROOT, blocks
from tests.recording.cases import read_csv

TOPICS = "/imu0", "/imu1", "/imu2", "/imu3"
PLACES = [[0, 0, 0], [100, 0, 0], [0, 80, 0], [0, 0, 55.5]]
AXES = [["x", "y", "z"], ["-y", "-x", "-z"], ["y", "z", "x"], ["x", "y", "z"]]
START = 1_700_000_000_123_456_789


def rig(labels=TOPICS, **more) -> dict:
    return {
        "position_unit": "mm",
        "accelerometers": {"noise": 0.02, "range": 156.9},
        "gyroscopes": {"noise": 0.001, "range": 34.9},
        "imus": {
            label: {"position": place, "axes": axes}
            for label, place, axes in zip(labels, PLACES, AXES, strict=False)
        },
    } | more  # fmt: skip


def readings(samples=40, start=START):
    """Topics on common stamps at uneven steps, readings of few digits, as loggers write them."""
    rng = np.random.default_rng(0)
    stamps = start + np.cumsum(rng.integers(4_000_000, 6_000_000, samples))
    return {
        topic: (stamps, *np.round(rng.normal(0, [[[9]], [[2]]], (2, samples, 3)), 4))
        for topic in TOPICS
    }  # fmt: skip


def put(folder, layout) -> str:
    (folder / "rig.yaml").write_text(yaml.safe_dump(layout, sort_keys=False))
    return str(folder / "rig.yaml")


def as_table(folder, topics):
    """The same as one synchronous table, read by the route for boards."""
    stamps = topics[TOPICS[0]][0]
    head = ["t", *(f"{topic}{kind}{axis}" for topic in TOPICS for kind in "ag" for axis in "xyz")]
    cells = np.concatenate([np.hstack(topics[topic][1:]) for topic in TOPICS], axis=1)
    rows = [
        ",".join([str(int(t - stamps[0])), *map(repr, row)])
        for t, row in zip(stamps, cells.tolist(), strict=True)
    ]
    (folder / "log.csv").write_text("\n".join([",".join(head), *rows]) + "\n")
    layout = rig() | {"time": {"column": "t", "unit": "ns"}}
    imus = layout.pop("imus")
    for section, kind, unit in (("accelerometers", "a", "m/s^2"), ("gyroscopes", "g", "rad/s")):
        layout[section] |= {"unit": unit, "triads": {
            topic: {"columns": [f"{topic}{kind}{axis}" for axis in "xyz"], "axes": imu["axes"]}
            | ({"position": imu["position"]} if kind == "a" else {})
            for topic, imu in imus.items()
        }}  # fmt: skip
    (folder / "board.yaml").write_text(yaml.safe_dump(layout, sort_keys=False))
    return read_csv(folder / "log.csv", folder / "board.yaml")


@pytest.mark.parametrize("kind", KINDS)
def test_a_bag_is_the_table_bit_for_bit(tmp_path, kind):
    """By the command, in the files that are written; one topic carries one kind each."""
    topics = readings()
    expected = as_table(tmp_path, topics)
    stamps, force, rate = topics.pop("/imu3")
    topics |= {"/imu3/accel": (stamps, force, None), "/imu3/gyro": (stamps, None, rate)}
    layout = rig()
    layout["imus"]["/imu3"]["topic"] = ["/imu3/accel", "/imu3/gyro"]
    bag = write(tmp_path / "run", kind, topics)
    options = ["--columns", put(tmp_path, layout), "--out", str(tmp_path / "rec.nc"), "--quiet"]
    assert main(["convert", "ros", str(bag), *options]) == 0
    found = imuarray.read_recording(tmp_path / "rec.nc")
    for name in (*QUANTITIES, *NUMBERS, MATRICES[-1]):
        np.testing.assert_array_equal(getattr(found, name), getattr(expected, name), name)
    assert found.accelerometer_labels == found.gyroscope_labels == expected.gyroscope_labels
    assert found.source == bag.name


def test_the_documented_bag(tmp_path):
    page = {b.note: b.text for b in blocks(ROOT / "docs" / "convert.md") if b.kind == "file"}
    topics = dict(zip(("/imu0", "/imu1", "/imu2"), readings(4).values(), strict=False))
    topics |= {f"/camera/{kind}/sample": topics["/imu0"] for kind in ("accel", "gyro")}
    (tmp_path / "bag.yaml").write_text(page["bag.yaml"])
    logs = read_bags([write(tmp_path / "run", "mcap", topics)], tmp_path / "bag.yaml").logs
    assert [log.label for log in logs] == ["/imu0", "/imu1", "/imu2", "camera"]


def test_units_that_the_standard_does_not_have(tmp_path):
    topics = readings()
    bag = write(tmp_path / "run", "mcap", topics)
    said = {"unit": "g", "noise": 0.002, "range": 16.0}
    log, *_ = read_bags([bag], put(tmp_path, rig(accelerometers=said))).logs
    np.testing.assert_array_equal(log.specific_force, GRAVITY * topics[TOPICS[0]][1])
    assert log.accelerometer_range == 16 * GRAVITY
    still = {name: (part[0], part[1] / 14.0, part[2]) for name, part in topics.items()}
    bag = write(tmp_path / "still", "mcap", still)
    with pytest.raises(InputError, match="'/imu0': expected some 9.8 m/s.2 of gravity.* in g"):
        open_logs(bag, put(tmp_path, rig()))
    fast = {name: (part[0], part[1], 90 + 0 * part[2]) for name, part in topics.items()}
    bag = write(tmp_path / "fast", "mcap", fast)
    with pytest.raises(InputError, match="'/imu0': expected rates within its range.* in deg/s"):
        open_logs(bag, put(tmp_path, rig()))


@pytest.mark.parametrize("kind", KINDS)
def test_bags_of_a_rig_are_joined(tmp_path, kind):
    topics = readings()
    whole = read_bags([write(tmp_path / "whole", kind, topics)], put(tmp_path, rig())).logs
    parts = [
        write(tmp_path / f"part{k}", kind, {t: [x[rows] for x in v] for t, v in topics.items()})
        for k, rows in enumerate((slice(0, 15), slice(15, None)))
    ]
    for order in (parts, parts[::-1]):
        found = read_bags(order, tmp_path / "rig.yaml").logs
        for one, other in zip(found, whole, strict=True):
            np.testing.assert_array_equal(one.gyroscope_time, other.gyroscope_time)
            np.testing.assert_array_equal(one.specific_force, other.specific_force)
    with pytest.raises(InputError, match="/imu0: expected stamps that increase, found 17"):
        read_bags([parts[0], parts[1], parts[0]], tmp_path / "rig.yaml")


def test_stamps_of_the_header_in_nanoseconds(tmp_path):
    """Not when the message came; the origin is the earliest of all, exactly."""
    topics = readings(4)
    topics["/imu1"] = (topics["/imu1"][0] + 1_234_567, *topics["/imu1"][1:])
    bag = write(tmp_path / "run", "mcap", topics)
    logs = read_bags([bag], put(tmp_path, rig())).logs
    stamps = topics["/imu1"][0]
    expected = (stamps - topics["/imu0"][0][0]) * 1e-9
    np.testing.assert_array_equal(logs[1].accelerometer_time, expected)
    np.testing.assert_array_equal(logs[1].gyroscope_time, expected)
    np.testing.assert_array_equal(logs[1].angular_rate, topics["/imu1"][2])  # the chip's axes
    assert logs[0].accelerometer_time[0] == 0


def test_axes_that_nobody_knows(tmp_path):
    """The first IMU's are the array's; the others' are to be found."""
    layout = rig()
    for imu in layout["imus"].values():
        del imu["axes"]
    found = read_bags([write(tmp_path / "run", "mcap", readings(4))], put(tmp_path, layout))
    np.testing.assert_array_equal(found.logs[0].axes, np.eye(3))
    assert [log.axes for log in found.logs[1:]] == [None] * 3
    np.testing.assert_allclose(found.logs[3].position, [0, 0, 0.0555])


def test_which_topics(tmp_path):
    bag, layout = write(tmp_path / "run", "mcap", readings(4)), put(tmp_path, rig(TOPICS[:3]))
    found = read_bags([bag], layout)
    assert [log.label for log in found.logs] == list(TOPICS[:3])
    assert found.lines == ["not used: /imu3"]
    found = read_bags([bag], layout, ["/imu2", "/imu0"])
    assert [log.label for log in found.logs] == ["/imu2", "/imu0"]
    assert found.lines == ["not used: /imu1", "not used: /imu3"]
    for topics, words in ((["/imu3"], "an IMU of the topic /imu3"), (["imu0"], "topic imu0")):
        with pytest.raises(InputError, match=words):
            read_bags([bag], layout, topics)
    with pytest.raises(InputError, match="each of /imu0, /imu1, /imu2, /imu3, found none"):
        read_bags([bag])
    with pytest.raises(InputError, match="among /imu0, .*, found '/imu9'"):
        read_bags([bag], put(tmp_path, rig(["/imu0", "/imu9"])))


def change(topic, i, column, value):
    def changed(topics):
        parts = [np.array(part) for part in topics[topic]]
        parts[column][i] = value
        return topics | {topic: parts}

    return changed


@pytest.mark.parametrize(
    ("changed", "words"),
    [
        (change("/imu2", 5, 0, 0), "/imu2: expected stamps in .* headers, found none .* 1 of 40"),
        (change("/imu1", 6, 0, START + 1), f"increase, found {START + 1} after .* reading 7 "),
        (change("/imu1", slice(7, 9), 0, START + 5 * 10**9), r"/imu1.* in reading 9 \("),
        (change("/imu3", 7, 1, np.inf), "/imu3: expected finite numbers, found .*inf.* reading 8"),
        (lambda topics: topics | {"/imu0": (topics["/imu0"][0], topics["/imu0"][1], None)},
         "/imu0: expected readings, found none"),
    ],
)  # fmt: skip
def test_stamps_and_readings_that_cannot_be_used(tmp_path, changed, words):
    bag = write(tmp_path / "run", "ros1", changed(readings()))
    with pytest.raises(InputError, match=words) as caught:
        read_bags([bag], put(tmp_path, rig()))
    assert "\n" not in str(caught.value)


def test_readings_that_are_missing_or_came_twice(tmp_path):
    topics = readings()
    stamps, force, rate = topics["/imu1"]
    twice = np.sort([*range(40), 9, 9])
    force[3] = np.nan
    topics["/imu1"] = [part[twice] for part in (stamps, force, rate)]
    found = read_bags([write(tmp_path / "run", "mcap", topics)], put(tmp_path, rig()))
    log = found.logs[1]
    assert (len(log.accelerometer_time), len(log.gyroscope_time)) == (39, 40)
    np.testing.assert_array_equal(log.specific_force, np.delete(force, 3, axis=0))
    assert found.lines == [
        "/imu1: accelerometer: no reading in 1 of 42",
        "/imu1: accelerometer: the last one again in 2 of 42",
        "/imu1: gyroscope: the last one again in 2 of 42",
    ]


@pytest.mark.parametrize(
    ("name", "words"),
    [("gone.bag", "expected a file to read, found none"),
     ("text.bag", "text.bag: expected a whole ROS bag, found ReaderError: File magic"),
     ("empty", "empty: expected a whole ROS bag, found FileNotFoundError"),
     ("log.csv", "expected a folder or a file of .bag, .mcap, .db3"),
     ("bare.bag", "bare.bag: expected messages of sensor_msgs/msg/Imu, found none")],
)  # fmt: skip
def test_what_is_no_bag(tmp_path, capsys, name, words):
    (tmp_path / "text.bag").write_text("no bag\n")
    (tmp_path / "log.csv").write_text("t\n")
    (tmp_path / "empty").mkdir()
    write(tmp_path / "bare", "ros1", {})
    options = ["--columns", put(tmp_path, rig()), "--out", str(tmp_path / "rec.nc")]
    assert main(["convert", "ros", str(tmp_path / name), *options]) == 2
    error = capsys.readouterr().err
    assert re.search(words, error) and error.count("\n") == 1
    assert not (tmp_path / "rec.nc").exists()


@pytest.mark.parametrize(
    ("key", "value", "words"),
    [
        ("time", {"rate": 1}, "unknown key 'time'"),
        ("imus", {}, "imus: expected IMUs by label"),
        ("imus", {"/imu0": {}, "/imu1": {"position": [0, 0, 0]}}, "found none of '/imu0'"),
        ("gyroscopes", {"noise": 1, "range": 1, "unit": "rpm"}, "gyroscopes: unit: expected"),
        ("position_unit", "cm", "position_unit: expected a unit"),
        ("imus", {"/imu0": {"position": [0, 0, 0], "axes": "x"}}, "'/imu0': expected axes"),
    ],
)
def test_a_description_that_does_not_fit(tmp_path, key, value, words):
    bag = write(tmp_path / "run", "mcap", readings(2))
    with pytest.raises(InputError, match=words):
        read_bags([bag], put(tmp_path, rig() | {key: value}))


def test_without_the_library(tmp_path, monkeypatch):
    bag = write(tmp_path / "run", "ros1", readings(2))
    monkeypatch.setitem(sys.modules, "rosbags", None)
    with pytest.raises(InputError, match=r"rosbags \(pip install 'imuarray\[ros\]'\)"):
        read_bags([bag], put(tmp_path, rig()))
