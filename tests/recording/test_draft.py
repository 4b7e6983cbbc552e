"""`imuarray columns`: a YAML drafted from a table's header and readings."""

import numpy as np
import pytest

from imuarray.cli import main
from imuarray.errors import InputError
from imuarray.recording.draft import draft, triads_of
from imuarray.recording.layout import read_layout
from imuarray.recording.table import load, read_tables, stamps_of

FORCE, RATE = [0.1, -0.2, 9.79], [0.01, -0.02, 0.03]  # m/s^2, rad/s at rest


def table(names, force, rate, stamps, sep=",", head="", comma=False):
    """Text of a table of two IMUs at rest: readings in the units of ``force`` and ``rate``."""
    rng = np.random.default_rng(1)
    still = np.concatenate([np.array(FORCE) / force, np.array(RATE) / rate] * 2)
    noise = np.repeat([0.02 / force, 0.001 / rate] * 2, 3)
    rows = [sep.join(names)]
    for stamp in stamps:
        cells = [str(stamp), *(f"{x:.7g}" for x in still + noise * rng.standard_normal(12))]
        rows.append(sep.join(c.replace(".", ",") if comma else c for c in cells))
    return head + "\n".join(rows) + "\n"


PLAIN = ["t", *(f"{kind}{axis}{k}" for k in (1, 2) for kind in "ag" for axis in "xyz")]
LONG = [
    "Time [s]",
    *(f"IMU{k} {kind}{axis} [{unit}]" for k in (1, 2)
      for kind, unit in (("Acc", "g"), ("Gyr", "deg/s")) for axis in "XYZ"),
]  # fmt: skip
MILLI = ["t", *(f"{kind}{axis}{k}[{unit}]" for k in (1, 2)
                for kind, unit in (("A", "mg"), ("G", "mdps")) for axis in "xyz")]  # fmt: skip
G, DEGREE = 9.80665, np.radians(1)
DATES = [f"2026-03-01T12:00:{n // 100:02d}.{10 * (n % 100):03d}Z" for n in range(400)]


@pytest.mark.parametrize("names, force, rate, stamps, options, unit, scale, per_second", [
    (PLAIN, 1.0, 1.0, range(0, 4000, 10), {}, ("m/s^2", "rad/s"), None, ("ms", 100)),
    (LONG, G, DEGREE, np.round(np.arange(400) / 200, 3), {"sep": ";", "comma": True},
     ("g", "deg/s"), None, ("s", 200)),
    (PLAIN, G / 4096, DEGREE / 16.4, range(0, 2_000_000, 5000), {"head": "board 7\nby me\n"},
     ("g", "deg/s"), 1 / 4096, ("us", 200)),
    (PLAIN, 1.0, DEGREE, range(0, 4000, 10), {}, ("m/s^2", "deg/s"), None, ("ms", 100)),
    (["ts", *PLAIN[1:]], 1.0, 1.0, np.round(0.5 + np.arange(400) / 250, 6), {},
     ("m/s^2", "rad/s"), None, ("s", 250)),
    (PLAIN, 1e-3 * G, 1.0, DATES, {"sep": "\t"}, ("mg", "rad/s"), None, ("ns", 100)),
    (["Zeit", *PLAIN[1:]], 1.0, 1.0, [f"01.03.2026 12:00:0{n / 100:.3f}" for n in range(400)],
     {"sep": ";", "comma": True}, ("m/s^2", "rad/s"), None, ("ns", 100)),
    (MILLI, 1e-3 * G, 1e-3 * DEGREE, range(0, 4000, 10), {"sep": "  "}, ("mg", "mdeg/s"), None,
     ("ms", 100)),
])  # fmt: skip
def test_a_draft_describes_its_table(
    names, force, rate, stamps, options, unit, scale, per_second, tmp_path
):
    (tmp_path / "log.csv").write_text(table(names, force, rate, stamps, **options))
    line = f"columns {tmp_path / 'log.csv'} --out {tmp_path / 'columns.yaml'}"
    assert main(line.split()) == 0
    layout = read_layout(tmp_path / "columns.yaml")
    kinds = layout["accelerometers"], layout["gyroscopes"]
    assert tuple(section["unit"] for section in kinds) == unit
    assert kinds[0].get("scale", 1.0) == pytest.approx(scale or 1.0, rel=1e-4)
    assert (kinds[1].get("scale") == "?") is (scale is not None)  # of counts it is asked
    assert kinds[0]["noise"] == pytest.approx(0.02 / force * (scale or 1.0), rel=0.2)
    for section, first in zip(kinds, (1, 4), strict=True):
        assert [*section["triads"]] == ["1", "2"]
        assert section["triads"]["2"]["columns"] == names[first + 6 : first + 9]
    text = (tmp_path / "columns.yaml").read_text()
    assert f"unit: {per_second[0]}}}  # {per_second[1]} samples" in text
    assert main(line.split()) == 2  # what a user has edited is not written over


def test_a_magnetometer_is_left_out_and_one_triad_has_a_label():
    names = ["accel_x", "accel_y", "accel_z", "mag_x", "mag_y", "mag_z", "gyroX", "gyroY", "gyroZ"]
    assert [(t.kind, t.label) for t in triads_of(names)] == [
        ("accelerometers", "1"), ("gyroscopes", "1"),
    ]  # fmt: skip


def loggers(names):
    """The triads that names in loggers' tables are, as (label, first column)."""
    return {kind: [(t.label, t.columns[0]) for t in triads_of(names) if t.kind == kind]
            for kind in ("accelerometers", "gyroscopes")}  # fmt: skip


@pytest.mark.parametrize("three, accelerometers, gyroscopes", [
    ("accelerometer_m_s2[{}] gyro_rad[{}]", "1", "1"),
    ("imu[0].a{} imu[1].a{} imu[2].a{} imu[0].w{} imu[1].w{} imu[2].w{}", "0 1 2", "0 1 2"),
    ("pelvis_Acc_{} pelvis_Gyr_{} torso_Acc_{} torso_Gyr_{}", "pelvis torso", "pelvis torso"),
    ("mpu1A{} mpu2A{} mpu1G{} mpu2G{}", "1 2", "1 2"),
    ("a{}_A g{}_A a{}_B g{}_B", "A B", "A B"),
    ("a_RS_S_{}_[m_s^-2] w_RS_S_{}_[rad_s^-1]", "1", "1"),
    ("Acc{}(g) As{}(deg/s) Angle{}(deg) H{}(uT)", "1", "1"),
    ("ACCEL_{}(10) ACCEL_{}(11) GYRO_{}(10) GYRO_{}(11)", "10 11", "10 11"),
    ("accelerometer{} gravity{} orientation{} linear_velocity{} gyroscope{} q{}", "1", "1"),
    ("omega_{} alpha_{}", "1", "1"),
])  # fmt: skip
def test_names_as_loggers_write_them(three, accelerometers, gyroscopes):
    axes = "012" if "[{}]" in three else "XYZ" if "Acc" in three or "ACC" in three else "xyz"
    names = [name.format(axis) for name in three.split() for axis in axes]
    found = loggers(names)
    assert [label for label, _ in found["accelerometers"]] == accelerometers.split()
    assert [label for label, _ in found["gyroscopes"]] == gyroscopes.split()


def test_a_row_of_units_and_counts(tmp_path):
    """Units below the header are read, and are no data; of counts a gyroscope's scale is asked."""
    text = table(PLAIN, 1.0, DEGREE, range(0, 4000, 10))
    units = ",".join(["ms", *["m/(s^2)"] * 3, *["deg/s"] * 3, *["m/(s^2)"] * 3, *["deg/s"] * 3])
    (tmp_path / "log.csv").write_text(text.replace("\n", f"\n{units}\n", 1))
    said, _ = draft([tmp_path / "log.csv"])
    assert "unit: deg/s" in said and "unit: m/s^2" in said and "unit: ms" in said
    (tmp_path / "columns.yaml").write_text(said)
    layout = read_layout(tmp_path / "columns.yaml")
    found, lines = load(tmp_path / "log.csv", layout, "columns.yaml")
    assert len(found) == 400 and "a line of units below the header left out" in lines[0]
    (tmp_path / "log.csv").write_text(table(PLAIN, G / 16384, DEGREE / 131, range(0, 4000, 10)))
    said, asked = draft([tmp_path / "log.csv"])
    assert 'scale: "?"' in said and any("a count in deg/s" in line for line in asked)


@pytest.mark.parametrize("head", ["", "logger v2, of today\n"])
def test_columns_without_a_header_go_by_their_place(tmp_path, head):
    """The same readings as with names; which are accelerometers', gravity tells."""
    text = table(PLAIN, 1.0, DEGREE, range(0, 4000, 10))
    (tmp_path / "log.csv").write_text(head + text.split("\n", 1)[1])
    said, asked = draft([tmp_path / "log.csv"])
    assert 'time: {column: "1", unit: ms}' in said and any("no header" in line for line in asked)
    for label, columns in (("1", '"2", "3", "4"'), ("2", '"8", "9", "10"')):
        assert f'"{label}": {{columns: [{columns}]}}  # ' in said
    (tmp_path / "columns.yaml").write_text(said)
    bare, lines = load(tmp_path / "log.csv", read_layout(tmp_path / "columns.yaml"), "")
    assert "no header: columns by their place" in lines[0] and len(bare) == 400
    (tmp_path / "named.csv").write_text(text)
    named, _ = load(tmp_path / "named.csv", {"columns": PLAIN}, "")
    np.testing.assert_array_equal(bare.to_numpy(), named.to_numpy())


@pytest.mark.parametrize("step, unit, rate", [(100, '"0.1 ms"', 100), (5000, "us", 200)])
def test_sample_time_fine_is_in_what_its_maker_counts(tmp_path, step, unit, rate):
    """Tenths of milliseconds in one series of theirs, microseconds in another."""
    text = table(PLAIN, 1.0, 1.0, range(0, 400 * step, step)).replace("t,", "SampleTimeFine,", 1)
    (tmp_path / "log.csv").write_text(text)
    said, _ = draft([tmp_path / "log.csv"])
    assert f"time: {{column: SampleTimeFine, unit: {unit}}}  # {rate} samples a second" in said
    (tmp_path / "columns.yaml").write_text(said)
    time = read_layout(tmp_path / "columns.yaml")["time"]
    found = stamps_of(load(tmp_path / "log.csv", {}, "")[0], time, "", "")
    assert found[1] == pytest.approx(1 / rate / step)


def test_seconds_that_many_rows_share_are_no_stamps(tmp_path):
    """Their nanoseconds are; noise and ranges have no exponent, which YAML would take for text."""
    rows = [f"{n // 200},{n % 200 * 5_000_000}" for n in range(400)]
    text = table(PLAIN, 1.0, 1e-4, rows).replace("t,", "secs,nsecs,", 1)
    (tmp_path / "log.csv").write_text(text)
    said, _ = draft([tmp_path / "log.csv"])
    assert "time: {column: nsecs, unit: ns}  # 200 samples a second" in said and "e+" not in said


@pytest.mark.parametrize("content", [
    b"", b"\0\1\2", b"a,b\n1,2\n", b"ax,ay,az\n", b"ax,ay,az\n1,2,x\n", b'"ax\n', b"\xff\xfea",
])  # fmt: skip
def test_what_is_no_table_is_refused(content, tmp_path):
    (tmp_path / "log.csv").write_bytes(content)
    with pytest.raises(InputError):
        draft([tmp_path / "log.csv"])


@pytest.mark.parametrize("paths", [("left.csv", "right.csv"), ("left/imu.csv", "right/imu.csv")])
def test_logs_of_single_imus_are_a_rig(paths, tmp_path):
    logs = [tmp_path / path for path in paths]
    for path in logs:
        text = table(PLAIN, 1.0, 1.0, range(0, 4000, 10)).splitlines()
        lines = [",".join(line.split(",")[:7]) for line in text]
        path.parent.mkdir(exist_ok=True)
        path.write_text("\n".join(lines) + "\n")
    (tmp_path / "rig.yaml").write_text(draft(logs)[0])
    layout = read_layout(tmp_path / "rig.yaml")
    assert layout["columns"] == PLAIN[1:7] and [*layout["imus"]] == ["left", "right"]
    assert layout["accelerometers"]["unit"] == "m/s^2" and "triads" not in layout["gyroscopes"]
    logs[1].write_text(table(LONG, 1.0, 1.0, range(400)))
    with pytest.raises(InputError, match="expected one IMU, its columns as the first log's"):
        draft(logs)


def test_a_table_with_a_row_for_each_imu(tmp_path):
    """A column numbers the IMUs: drafted, and read as logs of their own."""
    lines = table(PLAIN, 1.0, 1.0, range(0, 4000, 10)).splitlines()[1:]
    cells = [line.split(",") for line in lines]
    rows = [",".join([c[0], k, *part]) for c in cells for k, part in (("3", c[1:7]), ("5", c[7:]))]
    path, yaml = tmp_path / "log.csv", tmp_path / "columns.yaml"
    path.write_text("\n".join(["t,I,ax,ay,az,gx,gy,gz", *rows]) + "\n")
    said = draft([path])[0]
    assert "sensor: I" in said
    yaml.write_text(said)
    rig, _ = read_tables([path], yaml)
    assert [log.label for log in rig.logs] == ["3", "5"]
    for log, part in zip(rig.logs, (slice(1, 4), slice(7, 10)), strict=True):
        np.testing.assert_allclose(log.specific_force, [[float(x) for x in c[part]] for c in cells])
    yaml.write_text(said.replace('"5":', '"6":'))
    with pytest.raises(InputError, match="rows of it by column 'I', found 3, 5"):
        read_tables([path], yaml)
    yaml.write_text(said.replace("sensor: I", "sensor: K"))
    with pytest.raises(InputError, match="a column 'K'"):
        read_tables([path], yaml)
