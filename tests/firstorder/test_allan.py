"""Noise of still stretches: its spectrum, its terms, what is left open, and the command."""

import json

import numpy as np
import pandas as pd
import pytest

import imuarray
from imuarray.cli import main
from imuarray.errors import InputError
from imuarray.firstorder.noise import noise_terms, spectrum
from imuarray.geometry import mimu4444_corners
from imuarray.recording import Recording

RATE = 100.0
WHITE, WALK = 2e-3, 5e-4  # unit / sqrt(Hz), unit / s / sqrt(Hz)


def noise(rng, shape, white=WHITE, walk=WALK):
    """White noise on a random walk, readings at RATE."""
    drift = np.cumsum(rng.standard_normal(shape), axis=0)
    return white * np.sqrt(RATE) * rng.standard_normal(shape) + walk / np.sqrt(RATE) * drift


def flicker(rng, size, samples, axes):
    """Noise whose power falls as 1 / f, (samples, axes)."""
    frequency = np.fft.rfftfreq(2 * samples, 1 / RATE)[1:]
    shape = np.concatenate([[0.0], np.sqrt(size**2 / (2 * np.pi * frequency) * RATE)])
    whole = np.fft.rfft(rng.standard_normal((2 * samples, axes)), axis=0)
    return np.fft.irfft(whole * shape[:, None], axis=0)[:samples]


def still(count=2, samples=60000, seed=0):
    """A recording of a board that lies still."""
    rng = np.random.default_rng(seed)
    force = noise(rng, (samples, count, 3)) + [0.0, 0.0, 9.81]
    rate = noise(rng, (samples, count, 3), 1e-4, 0.0)
    labels = tuple(str(k + 1) for k in range(count))
    return Recording(
        np.arange(samples) / RATE, force, rate, mimu4444_corners().positions[:count], labels,
        labels, 0.02, 1e-3, 157.0, 34.9, 3e-3,
    )  # fmt: skip


def test_the_spectrum_has_all_of_the_variance():
    pieces = [np.random.default_rng(1).standard_normal((n, 2)) for n in (700, 512)]
    found = spectrum(pieces, 0.01)
    assert found.count.sum() == 700 + 512 - 2
    total = sum(((x - x.mean(axis=0)) ** 2).sum(axis=0) for x in pieces)
    np.testing.assert_allclose(found.count @ found.power, 0.01 * total)
    np.testing.assert_allclose(found.shape[:, 0], 1.0)


def test_terms_of_known_size_are_found_and_others_left_open():
    """40 axes, seed 2: mean squared z 1 +- 5 sqrt(2 / 40); false alarm 1e-4 by the law's tail."""
    x = noise(np.random.default_rng(2), (60000, 40))
    found = noise_terms(spectrum([x], 1 / RATE), RATE)
    for term, true in ((0, WHITE), (2, WALK)):
        seen = np.isfinite(found.value[term])
        assert seen.sum() > 37
        z = (found.value[term] - true) / found.sd[term]
        assert np.mean(z[seen] ** 2) == pytest.approx(1.0, abs=1.1)
        assert np.median(found.sd[term][seen]) < 0.2 * true
    assert np.isnan(found.value[1]).sum() > 37
    # ten seconds show no walk of this size; they bound it
    short = noise_terms(spectrum([x[:1000]], 1 / RATE), RATE)
    assert np.isnan(short.value[2]).sum() > 35
    bounds = short.below[2][np.isnan(short.value[2])]
    assert np.mean(bounds > WALK) > 0.8 and np.median(bounds) < 10 * WALK


def test_what_is_left_open_is_within_its_limit():
    """A walk beside flicker that it is mistaken for, 24 axes, seed 4."""
    rng, size, walk = np.random.default_rng(4), 2e-4, 1e-5
    x = flicker(rng, size, 120000, 24)
    x += noise(rng, (120000, 24), 1e-3, walk)
    found = noise_terms(spectrum([x], 1 / RATE), RATE)
    open_ = np.isnan(found.value[2])
    assert open_.sum() > 10 and np.mean(found.below[2][open_] > walk) > 0.8
    # where the walk shows, it is as uncertain as if the flicker were there
    z = (found.value[2] - walk)[~open_] / found.sd[2][~open_]
    assert np.abs(z).max() < 5


def test_flicker_is_told_from_a_walk():
    rng, size = np.random.default_rng(3), 5e-4
    x = flicker(rng, size, 60000, 10)
    x += noise(rng, (60000, 10), 1e-3, 0.0)
    found = noise_terms(spectrum([x], 1 / RATE), RATE)
    assert np.isnan(found.value[2]).all()
    assert np.mean(found.value[1]) == pytest.approx(size, rel=0.1)


def test_a_line_is_no_noise():
    x = noise(np.random.default_rng(4), (30000, 1), walk=0.0)
    hum = 0.05 * np.sin(2 * np.pi * 3.0 * np.arange(30000) / RATE)[:, None]
    found = noise_terms(spectrum([x + hum], 1 / RATE), RATE)
    assert abs(found.value[0, 0] - WHITE) < 4 * found.sd[0, 0] < 0.15 * WHITE
    assert np.isnan(found.value[1:]).all()


def test_the_deviation_is_that_of_the_law():
    """Seed 0, 6 axes of 600 s: within 5 of the claimed sds."""
    found = imuarray.allan(still())
    table = found.deviation[found.deviation.sensor == "specific_force"]
    law = np.sqrt(WHITE**2 / table.tau_s + WALK**2 * table.tau_s / 3)
    assert np.abs((table.deviation - law) / table.sd).max() < 5
    assert found.stretches_s[0] == pytest.approx(599, abs=1)


def test_what_is_short_or_not_still_is_refused():
    with pytest.raises(InputError, match="expected still stretches of 128 samples"):
        slow = still(samples=50)
        slow.time[:] *= 20  # 5 Hz
        imuarray.allan(slow)
    shaken = still(samples=1000)
    shaken.specific_force[:] += np.random.default_rng(5).standard_normal((1000, 1, 3))
    with pytest.raises(InputError, match="was it never still"):
        imuarray.allan(shaken)


def test_a_logger_s_table_of_one_still_pose(tmp_path, capsys):
    """From `convert csv` to figure and tables; the plot is the command's."""
    recording = still(samples=6000)
    names = [f"{kind}{axis}{k}" for kind in "ag" for k in (1, 2) for axis in "xyz"]
    values = np.hstack([recording.specific_force.reshape(6000, 6),
                        recording.angular_rate.reshape(6000, 6)])  # fmt: skip
    pd.DataFrame(values, columns=names).to_csv(tmp_path / "log.csv", index=False)
    layout = ["time: {rate: 100.0}", "position_unit: m"]
    for kind, unit, sd, limit in (("accelerometers", "m/s^2", 0.02, 157),
                                  ("gyroscopes", "rad/s", 0.001, 34.9)):  # fmt: skip
        layout += [
            f"{kind}:",
            f"  unit: {unit}",
            f"  noise: {sd}",
            f"  range: {limit}",
            "  triads:",
        ]
        for k in (1, 2):
            columns = ", ".join(f"{kind[0]}{axis}{k}" for axis in "xyz")
            place = f", position: [0.0{k}, 0, 0]" if kind[0] == "a" else ""
            layout.append(f"    '{k}': {{columns: [{columns}]{place}}}")
    (tmp_path / "c.yaml").write_text("\n".join(layout))
    rec, out = tmp_path / "rec.nc", tmp_path / "noise"
    columns = tmp_path / "c.yaml"
    assert main(f"convert csv {tmp_path}/log.csv --columns {columns} --out {rec}".split()) == 0
    capsys.readouterr()
    assert main(f"allan {rec} --json --out {out}".split()) == 0
    said = json.loads(capsys.readouterr().out)
    assert said["trusted"] and len(said["terms"]) == 2 * 2 * 3 * 3
    terms = pd.read_csv(out / "noise.csv")
    density = terms[(terms.sensor == "specific_force") & (terms.term == "noise_density")]
    np.testing.assert_allclose(density.value, WHITE, rtol=0.2)
    assert terms[terms.value.isna()].says.str.startswith("left open").all()
    for name in ("allan.pdf", "allan.png", "allan.csv", "spectrum.csv"):
        assert (out / name).stat().st_size > 1000
    assert len(imuarray.plots.allan(imuarray.allan(imuarray.read_recording(rec)))) == 4
