"""A user's own recording through the pipeline."""

import numpy as np
import pandas as pd
import pytest
import yaml

from imuarray.geometry import mimu4444_corners
from imuarray.model import ArrayModel
from imuarray.motion import Motion, hand_twisting
from imuarray.recording import write_recording
from imuarray.simulation.recordings import simulate_samples
from tests.papers.test_pipeline import ROOT, started

RATE, GRAVITY = 50.0, 9.81

pytestmark = pytest.mark.slow


def own_recording(rng):
    """Sixteen still poses of 8 s, then 40 s of twisting, of a board 0.3 mm off its drawing."""
    board = mimu4444_corners()
    unit = rng.standard_normal((16, 3))
    unit /= np.linalg.norm(unit, axis=1, keepdims=True)
    force = [np.repeat(GRAVITY * unit, int(8 * RATE), axis=0)]
    rate = [np.zeros_like(force[0])]
    # a jerk between poses, as a hand gives
    for start in range(0, len(force[0]), int(8 * RATE)):
        rate[0][start : start + 25] += [3.0, -2.0, 1.0]
    moving = hand_twisting(rng, 9.0, 10.0, 5.0).at(np.arange(int(40 * RATE)) / RATE)
    parts = [moving.angular_rate, moving.angular_acceleration, moving.specific_force]
    still = [rate[0], np.zeros_like(rate[0]), force[0]]
    motion = Motion.of(*(np.concatenate(pair) for pair in zip(still, parts, strict=True)))
    positions = board.relative + 3e-4 * rng.standard_normal(board.relative.shape)
    positions[0] = 0.0
    time = np.arange(len(motion.angular_rate)) / RATE
    model = ArrayModel.isotropic(board, 0.04, 0.001)
    recording, _ = simulate_samples(model, motion, positions, board.positions, rng, time=time)
    return recording, positions


def snakemake(directory, *arguments, **environment):
    options = "--cores 2 --configfile config.yaml --quiet all"
    return started(directory, *arguments, options=options, **environment)


def configure(directory, recordings):
    config = yaml.safe_load((ROOT / "config.yaml").read_text())
    config["recordings"] = recordings
    config["experiment"]["recording"] = next(iter(recordings))
    (directory / "config.yaml").write_text(yaml.safe_dump(config))


def test_an_own_recording_goes_through_the_measured_rules(tmp_path):
    """Seed 0; the widths are honest here, so |z| beyond 5 in 21 coordinates is a fault (1e-5)."""
    recording, positions = own_recording(np.random.default_rng(0))
    for name in ("one", "two"):
        write_recording(recording, tmp_path / f"{name}.nc")
    entry = {"gravity": GRAVITY, "group": "board"}
    configure(tmp_path, {name: {"file": f"{name}.nc", **entry} for name in ("one", "two")})
    done = snakemake(tmp_path, "measured")
    assert done.returncode == 0, done.stdout[-3000:] + done.stderr[-6000:]
    measured = tmp_path / "results" / "measured"
    table = pd.read_csv(measured / "positions" / "one.csv")
    chosen = table[(table.samples == 500) & (table.method == "map") & (table.assumed == "residual")]
    z = (chosen.mean_m.to_numpy() - positions[1:].ravel()) / chosen.sd_m.to_numpy()
    # the first-order calibration's frame and scales add a little to the widths
    assert np.abs(z).max() < 5 and chosen.accelerometer_sd.iloc[0] == pytest.approx(0.04, rel=0.15)
    # the same data twice: no difference at all
    assert (pd.read_csv(measured / "agreement" / "board.csv").coverage_50 == 1.0).all()
    for name in ("noise_two.pdf", "agreement_board.png"):
        assert (measured / "figures" / name).stat().st_size > 5000
    assert "| one | 1 |" in (measured / "tables" / "first_order_board.md").read_text()


def test_a_missing_own_file_stops_the_run(tmp_path):
    configure(tmp_path, {"mine": {"file": "mine.nc"}})
    done = snakemake(tmp_path, "measured")
    assert done.returncode != 0
    assert "mine.nc: expected a file to read, found none" in done.stderr
    assert "Traceback" not in done.stderr
