"""`imuarray columns`: a YAML drafted from a table's header and readings."""

import numpy as np
import pytest

from imuarray.cli import main
from imuarray.errors import InputError
from imuarray.recording.draft import draft, triads_of
from imuarray.recording.layout import read_layout

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
G, DEGREE = 9.80665, np.radians(1)
DATES = [f"2026-03-01T12:00:{n // 100:02d}.{10 * (n % 100):03d}Z" for n in range(400)]


@pytest.mark.parametrize("names, force, rate, stamps, options, unit, scale, per_second", [
    (PLAIN, 1.0, 1.0, range(0, 4000, 10), {}, ("m/s^2", "rad/s"), None, ("ms", 100)),
    (LONG, G, DEGREE, np.round(np.arange(400) / 200, 3), {"sep": ";", "comma": True},
     ("g", "deg/s"), None, ("s", 200)),
    (PLAIN, G / 4096, DEGREE / 16.4, range(0, 2_000_000, 5000), {"head": "board 7\nby me\n"},
     ("g", "rad/s"), 1 / 4096, ("us", 200)),
    (PLAIN, 1e-3 * G, 1.0, DATES, {"sep": "\t"}, ("mg", "rad/s"), None, ("ns", 100)),
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
