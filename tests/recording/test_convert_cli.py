"""`imuarray convert` at its edges: what it writes, prints, and refuses before it reads."""

import numpy as np
import pytest
import xarray as xr

from imuarray.cli import main
from tests.mimu_writer import packets, readings

POSITIONS = "axes, IMU 1, IMU 2, IMU 3\nx, 0, 0.01, 0\ny, 0, 0, 0.01\nz, 0, 0, 0.001\n"


@pytest.fixture
def folder(tmp_path):
    """A stream of three IMUs with a repeated packet, one missing and seven bytes of garbage."""
    parts = packets(readings(np.random.default_rng(0), 60, 3))
    content = b"".join([*parts[:20], parts[19], b"garbage", *parts[20:30], *parts[31:]])
    (tmp_path / "data.bin").write_bytes(content)
    (tmp_path / "positions.csv").write_text(POSITIONS)
    return tmp_path


def convert(folder, *extra, data="data.bin", positions="positions.csv", out="rec.nc"):
    paths = [str(folder / name) for name in (data, positions, out)]
    return main(
        ["convert", "mimu", paths[0], "--positions", paths[1], "--out", paths[2], *extra]
    )  # fmt: skip


def test_the_account_is_in_the_file(folder, capsys):
    assert convert(folder) == 0
    with xr.open_dataset(folder / "rec.nc", engine="h5netcdf") as found:
        names = ("packets_lost", "packets_bad", "packets_out_of_sequence", "garbage_bytes")
        assert [int(found.attrs[name]) for name in names] == [1, 0, 1, 46 + 7]
    text = capsys.readouterr().out
    assert "59 samples of 3 IMUs, 62.50 Hz" in text
    assert "lost 1, bad 0, out of sequence 1, garbage 53 bytes" in text
    assert "packet out of sequence dropped at byte 920" in text


def test_quiet_is_quiet(folder, capsys):
    assert convert(folder, "--quiet") == 0
    captured = capsys.readouterr()
    assert captured.out == captured.err == ""


@pytest.mark.parametrize("text", ["2,3", " 3 , 2,", None, ""])
def test_which_are_turned(folder, text):
    assert convert(folder, *([] if text is None else ["--underside", text])) == 0
    assert convert(folder, "--underside", "", out="plain.nc") == 0
    turned = {"2,3": [1, 2], " 3 , 2,": [1, 2], None: [1], "": []}[text]
    with (
        xr.open_dataset(folder / "rec.nc", engine="h5netcdf") as found,
        xr.open_dataset(folder / "plain.nc", engine="h5netcdf") as plain,
    ):
        expected = plain.specific_force.to_numpy().copy()
        for i in turned:
            x, y, z = expected[:, i].T
            expected[:, i] = np.stack([-y, -x, -z], axis=1)
        np.testing.assert_allclose(found.specific_force, expected)


@pytest.mark.parametrize("kind", ["mimu", "csv"])
@pytest.mark.parametrize("missing", ["data", "other"])
def test_a_missing_input_is_found_before_anything_is_read(folder, capsys, kind, missing):
    (folder / "columns.yaml").write_text("never: read\n")
    option, name = {"mimu": ("--positions", "positions.csv"), "csv": ("--columns", "columns.yaml")}[
        kind
    ]
    (folder / {"data": "data.bin", "other": name}[missing]).unlink()
    arguments = ["convert", kind, str(folder / "data.bin"), option, str(folder / name)]
    assert main([*arguments, "--out", str(folder / "rec.nc")]) == 2
    error = capsys.readouterr().err
    assert "expected a file to read, found none" in error and error.count("\n") == 1


@pytest.mark.parametrize("name", ["data.bin", "positions.csv"])
def test_no_input_is_overwritten(folder, capsys, name):
    before = (folder / name).read_bytes()
    assert convert(folder, out=name) == 2
    assert "expected another file than the input" in capsys.readouterr().err
    assert (folder / name).read_bytes() == before


def test_positions_of_another_board(folder, capsys):
    (folder / "two.csv").write_text("axes,IMU 1,IMU 2\nx,0,1\ny,0,0\nz,0,0\n")
    assert convert(folder, positions="two.csv") == 2
    assert "expected 3 IMUs, as the packets hold, found 2" in capsys.readouterr().err
    assert not (folder / "rec.nc").exists()


def test_convert_takes_a_kind(capsys):
    assert main(["convert"]) == 2
    assert main(["convert", "xml"]) == 2
    assert capsys.readouterr().err.count("\n") == 2


def test_declared_noise_and_prior_are_the_options(folder):
    out = folder / "noise.nc"
    options = ["--accelerometer-noise", "0.05", "--gyroscope-noise-dps", "0.2"]
    arguments = [str(folder / "data.bin"), "--positions", str(folder / "positions.csv"), *options]
    assert main(["convert", "mimu", *arguments, "--position-prior", "1e-3", "--out", str(out)]) == 0
    with xr.open_dataset(out) as found:
        assert found.attrs["accelerometer_noise_sd"] == 0.05
        assert found.attrs["gyroscope_noise_sd"] == pytest.approx(np.radians(0.2))
        assert found.attrs["position_prior_sd"] == 1e-3
