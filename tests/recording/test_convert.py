"""Importers at the edge: tables, published files, and the command `convert`."""

import re
from pathlib import Path

import numpy as np
import pytest
import yaml

from imuarray.cli import main
from imuarray.errors import InputError
from imuarray.recording import read_recording
from tests.recording.cases import read_csv

ROOT = Path(__file__).parents[2]


@pytest.fixture
def example(tmp_path):
    """The documentation's own files."""
    text = (ROOT / "docs" / "convert.md").read_text()
    for name, language in (("log.csv", "csv"), ("columns.yaml", "yaml")):
        block = re.search(rf"```{language}\n(.*?)```", text, re.DOTALL).group(1)
        (tmp_path / name).write_text(block)
    return tmp_path


def test_the_documented_example(example):
    found = read_csv(example / "log.csv", example / "columns.yaml")
    g = 9.80665
    np.testing.assert_allclose(found.time, [0, 0.01, 0.02])
    np.testing.assert_allclose(found.specific_force[0, 0], [0.01 * g, -0.02 * g, g])
    # turned over: array x = -y, y = -x, z = -z of the sensor
    np.testing.assert_allclose(found.specific_force[0, 1], [-0.01 * g, 0.02 * g, 1.01 * g])
    np.testing.assert_allclose(np.degrees(found.angular_rate[0, 1]), [12.2, -3.1, 0.4])
    np.testing.assert_allclose(found.accelerometer_position[2], [0.019, 0, 0.001])
    assert found.accelerometer_noise_sd == pytest.approx(0.004 * g)
    assert found.gyroscope_range == pytest.approx(np.radians(2000))
    assert found.position_prior_sd == pytest.approx(3e-3)
    assert found.gyroscope_labels == ("1", "2")


def set_key(layout, path, value):
    *way, last = path.split("/")
    for step in way:
        layout = layout[step]
    if value is None:
        del layout[last]
    else:
        layout[last] = value


@pytest.mark.parametrize(
    ("path", "value", "words"),
    [
        ("time", None, "no 'time'"),
        ("times", 3, "unknown key 'times'"),
        ("time/unit", "minutes", "unit of s, ms, us, ns, 0.1 ms, found 'minutes'"),
        ("time/column", "stamp", "expected a column 'stamp', found t, ax1"),
        ("accelerometers/unit", "G", "unit of m s-2, m/s.2, m/s2, g, mg, found 'G'"),
        ("accelerometers/noise", -1, "positive number, found -1"),
        ("accelerometers/noise", True, "positive number, found True"),
        ("accelerometers/triads", [], "triads by label"),
        ("accelerometers/triads/2/columns", ["ax2"], "three columns"),
        ("accelerometers/triads/2/position", None, "of each or of none, found none of '2'"),
        ("accelerometers/triads/2/position", [1, "a", 2], "three numbers"),
        ("accelerometers/triads/2/axes", ["x", "x", "z"], "no rotation"),
        ("accelerometers/triads/2/axes", ["x", "q", "z"], "expected axes such as"),
        ("gyroscopes/triads/1/columns", ["gx1", "gy1", "gone"], "expected a column 'gone'"),
        ("position_unit", "cm", "unit of m, mm"),
    ],
)
def test_a_wrong_layout_is_one_line(example, path, value, words):
    layout = yaml.safe_load((example / "columns.yaml").read_text())
    set_key(layout, path, value)
    (example / "columns.yaml").write_text(yaml.safe_dump(layout))
    with pytest.raises(InputError, match=words) as caught:
        read_csv(example / "log.csv", example / "columns.yaml")
    assert "\n" not in str(caught.value)


def test_convert_csv_on_the_command_line(example, capsys):
    log, columns, out = (str(example / n) for n in ("log.csv", "columns.yaml", "rec.nc"))
    assert main(["convert", "csv", log, "--columns", columns, "--out", out]) == 0
    assert "3 samples of 3 IMUs, 100.00 Hz" in capsys.readouterr().out
    assert read_recording(out).specific_force.shape == (3, 3, 3)


def corners(folder):
    """A positions file as published, of the board's eight corners."""
    from imuarray.geometry import mimu4444_corners

    board = mimu4444_corners()
    rows = ["axes, " + ", ".join(f"IMU {label}" for label in board.labels)]
    for axis, values in zip("xyz", board.positions.T, strict=True):
        rows.append(", ".join([axis, *map(str, values)]))
    (folder / "positions.csv").write_text("\n".join(rows) + "\n")
    return str(folder / "positions.csv")


@pytest.mark.parametrize(
    ("content", "extra", "words"),
    [
        (b"nothing of the kind", [], "expected MIMU packets"),
        (None, [], "expected a file to read"),
        (b"\x00" * 50, ["--underside", "9"], "--underside: expected labels of"),
    ],
)
def test_bad_input_is_one_line_and_status_2(tmp_path, capsys, content, extra, words):
    if content is not None:
        (tmp_path / "data.bin").write_bytes(content)
    arguments = ["convert", "mimu", str(tmp_path / "data.bin"), "--positions", corners(tmp_path)]
    out = tmp_path / "rec.nc"
    assert main([*arguments, "--out", str(out), *extra]) == 2
    error = capsys.readouterr().err
    assert words in error and error.count("\n") == 1 and not out.exists()
