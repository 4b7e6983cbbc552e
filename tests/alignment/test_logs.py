"""Any logger's files as one recording."""

import numpy as np
import pandas as pd
import pytest
import yaml

import imuarray
from imuarray.alignment import align
from imuarray.cli import main
from imuarray.errors import InputError
from imuarray.motion import hand_twisting
from imuarray.recording import load_dataset
from imuarray.recording.record import NUMBERS, QUANTITIES
from tests.alignment.test_alignment import logs
from tests.bag_writer import write
from tests.mimu_writer import packets, readings
from tests.recording.cases import HEADER, blank, layout, table
from tests.recording.cases import read as read_table
from tests.recording.test_bags import put, rig
from tests.recording.test_bags import readings as topics
from tests.recording.test_convert_cli import POSITIONS
from tests.recording.test_csv_logs import description
from tests.recording.test_csv_logs import log as lines_of
from tests.recording.test_csv_logs import put as put_tables


def test_a_table_or_a_recording(tmp_path):
    expected = read_table(tmp_path, table())
    log, columns = tmp_path / "log.csv", tmp_path / "columns.yaml"
    found, lines = imuarray.open_logs([log], columns)
    np.testing.assert_array_equal(found.specific_force, expected.specific_force)
    assert lines == [] and found.alignment is None
    imuarray.write_recording(found, tmp_path / "rec.nc")
    again = imuarray.open_logs([tmp_path / "rec.nc"]).recording
    np.testing.assert_array_equal(again.angular_rate, expected.angular_rate)
    with pytest.raises(InputError, match="log.csv: expected a YAML that describes it"):
        imuarray.open_logs([log])


def test_packets_bags_and_what_cannot_be_told(tmp_path):
    counts = readings(np.random.default_rng(0), 20, 3)
    (tmp_path / "data.bin").write_bytes(b"".join(packets(counts)))
    (tmp_path / "positions.csv").write_text(POSITIONS)
    found, lines = imuarray.open_logs(tmp_path / "data.bin", tmp_path / "positions.csv")
    assert found.specific_force.shape == (20, 3, 3) and "lost 0" in lines[0]
    columns = put(tmp_path, rig())
    bag = write(tmp_path / "run", "mcap", topics())
    found, lines = imuarray.open_logs(bag, columns, ["/imu1", "/imu0"])
    assert found.gyroscope_labels == ("/imu1", "/imu0") and len(lines) == 2
    imuarray.write_recording(found, tmp_path / "rec.nc")
    for wrong in ([], [tmp_path / "rec.nc", bag]):
        with pytest.raises(InputError, match="logs: expected one recording, or what loggers wrote"):
            imuarray.open_logs(wrong, columns)


def test_a_rail_in_a_turned_sensor_s_own_axes_is_one(tmp_path):
    """Its reading in the array's axes is below the range."""
    columns, rows = layout(), table()
    turn = np.sqrt(0.5) * np.array([[1, -1, 0], [1, 1, 0], [0, 0, np.sqrt(2)]])
    rows[2][HEADER.index("gx1")], columns["gyroscopes"]["triads"]["1"]["axes"] = (
        "2000",
        turn.tolist(),
    )
    read_table(tmp_path, rows, columns)
    found = imuarray.open_logs(tmp_path / "log.csv", tmp_path / "columns.yaml").recording
    expected = np.zeros((4, 3, 3), bool)
    expected[1, 0, :2] = True
    np.testing.assert_array_equal(found.angular_rate_saturated, expected)
    assert not found.saturated_accelerometers().any()


@pytest.fixture(scope="module")
def loose(tmp_path_factory):
    """Logs of three IMUs as a bag and as tables, and what `align` makes of them."""
    folder = tmp_path_factory.mktemp("loose")
    motion = hand_twisting(np.random.default_rng(3), 8.0, 5.0, 4.0)
    apart, bag, tables = logs(motion), {}, {}
    for i, log in enumerate(apart):
        # the second one's clock has another origin
        stamps = np.round(1e9 * (log.gyroscope_time + 10 * (i != 1))).astype(int)
        values = np.round(np.hstack([log.specific_force, log.angular_rate]), 6)
        bag[f"/imu{i}"] = stamps, values[:, :3], values[:, 3:]
        tables[f"imu{i}.csv"] = lines_of(stamps, values)
    columns = description(position_unit="m", position_prior=1e-3, imus={
        label: {"position": log.position.tolist()} for label, log in zip(bag, apart, strict=True)
    })  # fmt: skip
    for kind, log in (("accelerometers", "accelerometer"), ("gyroscopes", "gyroscope")):
        columns[kind] = {
            "noise": getattr(apart[0], f"{log}_noise_sd"),
            "range": getattr(apart[0], f"{log}_range"),
        }
    for key in ("time", "columns"):
        del columns[key]
    write(folder / "run", "mcap", bag)
    put(folder, columns)
    return folder, apart, tables, columns


def test_loose_imus_are_aligned(loose, capsys):
    """By the command; what was found is printed, and kept beside the recording."""
    folder, apart, _, _ = loose
    out = folder / "rec.nc"
    options = ["--columns", str(folder / "rig.yaml"), "--out", str(out)]
    assert main(["convert", "ros", str(folder / "run"), *options]) == 0
    text = capsys.readouterr().out
    assert "rec.nc: " in text and "1: its stamps are at no time those of /imu0" in text
    assert "ppm fast" in text and "degrees against IMU /imu0" in text
    expected, alignment = align(apart, position_prior_sd=1e-3)
    found, kept = imuarray.read_recording(out), load_dataset(out, "alignment")
    assert found.source == "run" and found.position_prior_sd == 1e-3
    inner = slice(20, -20)
    np.testing.assert_allclose(found.angular_rate[inner], expected.angular_rate[inner], atol=2e-4)
    np.testing.assert_allclose(kept.rotation, alignment.rotation, atol=1e-6)
    np.testing.assert_allclose(kept.clock_drift, [c.drift for c in alignment.clocks], atol=1e-7)
    # by the logs' own stamps, which are these after an epoch of each
    epochs = np.array([10.0, 0.0, 10.0])
    for name, begun in (("offset", epochs - 10.0), ("middle", epochs)):
        true = [getattr(clock, name) for clock in alignment.clocks] + begun
        np.testing.assert_allclose(kept[f"clock_{name}"], true, atol=2e-5, err_msg=name)


def opened(folder, tables, columns):
    """The loose IMUs' tables."""
    units = {"accelerometers": "m/s^2", "gyroscopes": "rad/s"}
    names = {"time": {"column": "t", "unit": "ns"}, "columns": ["ax", "ay", "az", "gx", "gy", "gz"]}
    described = columns | names | {kind: columns[kind] | {"unit": u} for kind, u in units.items()}
    described["imus"] = {
        label: imu | {"log": f"{label[1:]}.csv"} for label, imu in columns["imus"].items()
    }
    put_tables(folder, tables, described)
    return imuarray.open_logs([folder / name for name in tables], folder / "rig.yaml")


def changed(loose, folder, change):
    """The tables, one of them (its cells but for the stamps) changed, opened."""
    _, _, tables, columns = loose
    head, *rows = tables["imu1.csv"]
    cells = np.array([row[1:] for row in rows], float)
    change(cells)
    table = [head, *([row[0], *new] for row, new in zip(rows, cells.tolist(), strict=True))]
    return opened(folder, tables | {"imu1.csv": table}, columns)


def test_a_rail_within_the_declared_range_is_one(loose, tmp_path):
    """Once interpolated, it could not be seen."""

    def clip(rows):
        rows[:, 3:] = np.clip(rows[:, 3:], -12.0, 12.0)

    found, lines = changed(loose, tmp_path, clip)
    (said,) = (line for line in lines if "clipped" in line)
    assert "/imu1: gyroscope: clipped at 12 rad/s" in said
    assert found.angular_rate_saturated[:, 1].any() and not found.angular_rate_saturated[:, 0].any()


def test_a_frozen_sensor_of_a_loose_imu_is_refused(loose, tmp_path):
    def freeze(rows):
        rows[500:700, :3] = rows[500, :3]

    with pytest.raises(InputError, match="/imu1: .* accelerometer '/imu1' is frozen"):
        changed(loose, tmp_path, freeze)


def test_tables_and_a_bag_agree_bit_for_bit(loose):
    folder, _, tables, columns = loose
    bag = imuarray.open_logs(folder / "run", folder / "rig.yaml")
    found = opened(folder, tables, columns)
    for name in (*QUANTITIES, *NUMBERS, "accelerometer_axes"):
        ours, theirs = (getattr(one.recording, name) for one in (found, bag))
        np.testing.assert_array_equal(ours, theirs, name)
    assert found.lines == bag.lines
    put(folder, columns)


def test_a_board_with_a_sensor_slower_than_its_log(tmp_path):
    """Blank cells in half of the rows; all else is there at its time."""
    motion = hand_twisting(np.random.default_rng(3), 8.0, 5.0, 4.0)
    time = np.arange(1200) / 100
    sensed = [motion.force.derivative(time), motion.rotation.derivative(time)]
    noise = np.random.default_rng(0).normal(0, [[[0.04]], [[1e-3]]], (3, 2, 1200, 3))
    cells = [list(map(repr, row)) for row in np.concatenate(
        np.concatenate(sensed + noise, axis=0), axis=1).tolist()]  # fmt: skip
    rows = [HEADER, *([repr(t), *row] for t, row in zip(time.tolist(), cells, strict=True))]
    columns = layout() | {"time": {"column": "t", "unit": "s"}}
    columns["accelerometers"] |= {"unit": "m/s^2", "noise": 0.04, "range": 160}
    columns["gyroscopes"] |= {"unit": "rad/s", "noise": 1e-3, "range": 35}
    slow = blank(rows, [f"a{axis}2" for axis in "xyz"], range(2, 1201, 2))
    slow = blank(slow, ["gy3"], (7, 500))
    text = "\n".join(",".join(row) for row in slow) + "\n"
    (tmp_path / "log.csv").write_text(text)
    (tmp_path / "columns.yaml").write_text(yaml.safe_dump(columns))
    found, lines = imuarray.open_logs(tmp_path / "log.csv", tmp_path / "columns.yaml")
    assert "2: accelerometer: no reading in 600 of 1200" in lines
    assert "3: gyroscope: no reading in 2 of 1200" in lines
    np.testing.assert_allclose(found.alignment.rate[1], [50, 100], rtol=1e-4)
    assert np.abs(found.alignment.clock_offset).max() < 5e-6
    true = [motion.force.derivative(found.time), motion.rotation.derivative(found.time)]
    inner = slice(20, -20)
    for kind, (one, wanted) in enumerate(
        zip((found.specific_force, found.angular_rate), true, strict=True)
    ):
        left = (one - wanted[:, None])[inner].std(axis=(0, 2))
        assert (left < 1.1 * found.alignment.interpolated_noise[:, kind]).all()


def board_log(folder, stamps, read=None, rail=np.inf):
    """One table of three IMUs: what it is opened as. ``read``: when they read, if not then."""
    rng, read = np.random.default_rng(0), stamps if read is None else read
    waves = np.stack(
        [np.sin(2 * np.pi * hertz * read + hertz) for hertz in (1.1, 1.7, 2.3)], axis=1
    )
    noise = rng.standard_normal((6, len(read), 3))
    parts = [12.0 * waves + 0.04 * part for part in noise[:3]]
    rates = [9.0 * waves + 1e-3 * part for part in noise[3:]]
    parts += [rates[0], np.clip(rates[1], -rail, rail), rates[2]]
    names = [f"{kind}{axis}{k}" for kind in "ag" for k in range(3) for axis in "xyz"]
    table = pd.DataFrame(np.hstack(parts), columns=names)
    table.insert(0, "t", stamps)
    table.to_csv(folder / "log.csv", index=False)
    triads = {
        kind: {str(k): {"columns": [f"{kind}{axis}{k}" for axis in "xyz"]} for k in range(3)}
        for kind in "ag"
    }
    for k, place in enumerate(np.eye(3)):
        triads["a"][str(k)]["position"] = (20 * place).tolist()
    columns = {
        "time": {"column": "t", "unit": "s"}, "position_unit": "mm",
        "accelerometers": {"unit": "m/s^2", "noise": 0.04, "range": 100, "triads": triads["a"]},
        "gyroscopes": {"unit": "rad/s", "noise": 1e-3, "range": 35, "triads": triads["g"]},
    }  # fmt: skip
    (folder / "columns.yaml").write_text(yaml.safe_dump(columns))
    return imuarray.open_logs(folder / "log.csv", folder / "columns.yaml")


EVEN = np.arange(600) / 200
LATE = EVEN + 2e-4 * np.random.default_rng(1).standard_normal(600)


def test_stamps_of_a_table_that_jitter_are_evened(tmp_path):
    found, (said,) = board_log(tmp_path, LATE, read=EVEN)
    assert "stamps 0.19 ms off even readings" in said
    np.testing.assert_allclose(np.diff(found.time), 5e-3, atol=1e-6)


@pytest.mark.parametrize("stamps", [EVEN, LATE], ids=["even", "as uneven as the readings"])
def test_stamps_of_a_table_that_are_right_stay(tmp_path, stamps):
    found, lines = board_log(tmp_path, stamps)
    assert not lines
    np.testing.assert_allclose(found.time, stamps - stamps[0], atol=1e-12)


def test_a_rail_that_a_table_shows_is_its_range(tmp_path):
    found, (said,) = board_log(tmp_path, EVEN, rail=np.radians(500))
    assert (
        "gyroscope 1: clipped at 8.727 rad/s (500 deg/s), within its declared range of 35:" in said
    )
    assert found.gyroscope_range == 35
    railed = found.saturated_gyroscopes()
    assert railed[:, 1].any() and not railed[:, [0, 2]].any()
