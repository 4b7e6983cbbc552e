"""`python -m imuarray_papers`: what the papers did, for a recording of one's own."""

import numpy as np
import pytest
import xarray as xr

import imuarray
from imuarray.cli import main
from imuarray.geometry import sub_array
from imuarray.recording import read_recording, write_recording
from imuarray_papers.__main__ import papers_parser


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    place = tmp_path_factory.mktemp("papers")
    array = sub_array(imuarray.mimu4444(), 4)
    recording, _ = imuarray.simulate(array, 2.0, 50.0, seed=3)
    write_recording(recording, place / "rec.nc")
    return place


def run(folder, command: str) -> int:
    words = command.replace("@", f"{folder}/").split()
    return main([*words, "--quiet"], papers_parser())


def test_ml_bcd_finds_what_gauss_newton_does(folder):
    assert run(folder, "calibrate @rec.nc --out @cal.nc") == 0
    found = imuarray.read_calibration(folder / "cal.nc")
    other = imuarray.calibrate(read_recording(folder / "rec.nc"), "papers")
    assert found.sizes["iteration"] > 10 * other.sizes["iteration"]
    np.testing.assert_allclose(found["position"], other["position"], atol=1e-7)


def test_pmmh_says_how_far_the_flat_prior_shrinks_the_array(folder, capsys):
    command = "sample @rec.nc --steps 400 --seed 2 --out @posterior.nc"
    assert run(folder, command) == 3
    last = capsys.readouterr().err.splitlines()[-1]
    assert "have not converged" in last
    with xr.open_datatree(folder / "posterior.nc", engine="h5netcdf") as tree:
        assert tree.attrs["sampler"] == "pmmh" and tree.attrs["draws_per_sample"] > 0
        assert tree.attrs["shrunk_by_sds"] > 0 and tree.attrs["on_a_line"] == 0
        assert tree["posterior"]["position"].sizes["chain"] == 2
