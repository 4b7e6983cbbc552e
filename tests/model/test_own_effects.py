"""Effects of a user's own file, through the commands."""

import json
from pathlib import Path

import numpy as np
import pytest
import xarray as xr

import imuarray
from imuarray import provenance
from imuarray.cli import main
from imuarray.model import DATA_EFFECTS, EFFECTS, ArrayModel
from imuarray.model import effects as own
from imuarray.motion import Motion
from tests.cases import model

CUBIC = '''
from imuarray.model.effects import effect


@effect("accelerometer_cubic", unit="s4 m-2", prior_sd={sd}, shape=lambda a, g: (a, 3))
def accelerometer_cubic(curvature, instant, predicted):
    """u_i + c_i u_i^3."""
    force = predicted.specific_force
    return predicted._replace(specific_force=force + curvature * force**3)
'''


GAIN = '''
import numpy as np

from imuarray.model.effects import effect


def common_gain(shape, axes):
    """One gain of all accelerometers is a unit of length."""
    return [2.0 * np.ones(shape)]


@effect(
    "accelerometer_gain", unit="1", prior_sd=0.02, shape=lambda a, g: (a,), shown="%",
    components=(("gain",),), gauge=common_gain, resembles=("accelerometer_scale",),
    meaning="each accelerometer has one gain", against="specific force",
)
def accelerometer_gain(gain, instant, predicted):
    """(1 + c) u."""
    return predicted._replace(specific_force=(1.0 + gain[:, None]) * predicted.specific_force)
'''


@pytest.fixture(autouse=True)
def catalogue():
    """As it was, afterwards: a new process begins without the file."""
    before = dict(EFFECTS), dict(own._READ), dict(provenance._ADDED)
    yield
    for now, then in zip((EFFECTS, own._READ, provenance._ADDED), before, strict=True):
        now.clear()
        now.update(then)


@pytest.fixture
def mine(tmp_path):
    path = tmp_path / "mine.py"
    path.write_text(CUBIC.format(sd="2e-6"))
    return path


def test_commands_know_the_effect(mine, tmp_path, capsys):
    recording, _ = imuarray.simulate(model().array, 1.0, 50.0, seed=1)
    imuarray.write_recording(recording, tmp_path / "rec.nc")
    asked = ["calibrate", str(tmp_path / "rec.nc"), "--effects"]
    asked += ["accelerometer_cubic", "--out", str(tmp_path / "cal.nc"), "--json"]
    assert main(asked) == 2
    assert "found accelerometer_cubic" in capsys.readouterr().err
    assert main([*asked, "--effect-file", str(mine)]) == 0
    found = json.loads(capsys.readouterr().out)
    assert len(found["effects"]) == 15
    with xr.open_dataset(tmp_path / "cal.nc", engine="h5netcdf") as dataset:
        assert json.loads(dataset.attrs["versions"])["mine.py"].startswith("sha256 ")
    motion = ["apply", str(tmp_path / "cal.nc"), str(tmp_path / "rec.nc"), "--quiet", "--out"]
    motion += [str(tmp_path / "motion.nc")]
    assert main([*motion, "--effect-file", str(mine)]) == 0
    # a calibration does not do with another text, nor without
    mine.write_text(CUBIC.format(sd="2e-6").replace("force**3", "force**2"))
    assert main([*motion, "--effect-file", str(mine)]) == 2
    assert "accelerometer_cubic as it was" in capsys.readouterr().err
    EFFECTS.pop("accelerometer_cubic")
    assert main(motion) == 2
    assert "found no accelerometer_cubic: name the file" in capsys.readouterr().err


def test_a_file_whose_effects_nobody_asks_for_is_said(mine, tmp_path, capsys):
    recording, _ = imuarray.simulate(model().array, 1.0, 50.0, seed=1)
    imuarray.write_recording(recording, tmp_path / "rec.nc")
    asked = ["calibrate", str(tmp_path / "rec.nc"), "--effect-file", str(mine)]
    assert main([*asked, "--out", str(tmp_path / "cal.nc")]) == 2
    assert "expected --effects" in capsys.readouterr().err
    with pytest.raises(imuarray.InputError, match="expected a Python file"):
        imuarray.read_effects(tmp_path / "nothing.py")


def test_another_text_is_compiled_anew(mine):
    """As a notebook's cell is run again: what is compiled for one text is not another's."""

    def seen(name):
        made = ArrayModel.isotropic(model().array, 0.04, 1e-3, (name,))
        motion = Motion(*np.ones((5, 2, 3)))
        both = [one.predict_many(motion, made.array.relative, np.ones(15)) for one in (made, first)]
        return [part.specific_force[0, 0] for part in both]

    imuarray.read_effects(mine)
    first = ArrayModel.isotropic(model().array, 0.04, 1e-3, ("accelerometer_cubic",))
    one, before = seen("accelerometer_cubic")
    mine.write_text(CUBIC.format(sd="2e-6").replace("curvature * force", "2 * curvature * force"))
    imuarray.read_effects(mine)
    two, still = seen("accelerometer_cubic")
    np.testing.assert_allclose((two - 1.0) / (one - 1.0), 2.0)
    np.testing.assert_array_equal(before, still)  # a model that was made keeps its effects
    mine.write_text(CUBIC.replace("accelerometer_cubic", "accelerometer_other").format(sd="2e-6"))
    imuarray.read_effects(mine)
    np.testing.assert_array_equal(seen("accelerometer_other")[0], one)


def test_another_text_makes_other_chains(mine):
    """A checkpoint's key holds `code_digest`."""
    without = provenance.code_digest()
    assert imuarray.read_effects(mine) == ("accelerometer_cubic",)
    assert imuarray.read_effects(mine) == ("accelerometer_cubic",)  # once only
    one = provenance.code_digest()
    mine.write_text(CUBIC.format(sd="3e-6"))
    assert imuarray.read_effects(mine) == ("accelerometer_cubic",)
    assert EFFECTS["accelerometer_cubic"].prior_sd == 3e-6
    two = provenance.code_digest()
    other = mine.parent / "other" / mine.name
    other.parent.mkdir()
    other.write_text(CUBIC.replace("accelerometer_cubic", "gyroscope_own").format(sd="1"))
    assert imuarray.read_effects(other) == ("gyroscope_own",)
    assert len({without, one, two, provenance.code_digest()}) == 4
    assert provenance.versions()["mine.py"].count("sha256") == 2


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("x = (", "line 1: SyntaxError"),
        ("\nimport no_such_module\n", "line 2: ModuleNotFoundError"),
        ("x = 1\n", "found none"),
        (CUBIC.format(sd="1.0") + "\nraise SystemExit(0)\n", "SystemExit"),
        (CUBIC.format(sd="1.0").replace("accelerometer_cubic", "gyroscope_scale"), "already"),
        (b"\xff\xfe\x00", "UTF-8"),
        (None, "expected a file to read"),
        # found when it is used first
        (CUBIC.format(sd="1.0").replace("curvature * force**3", "1.0"), "left as it is"),
        (GAIN.replace('_gain"', '_cubic"').replace("s(shape)", "s(3)"), "gauge(shape, axes)"),
    ],
)
def test_a_wrong_file_is_one_line(text, said, tmp_path, capsys):
    path, known = tmp_path / "mine.py", dict(EFFECTS)
    if text is not None:
        path.write_bytes(text if isinstance(text, bytes) else text.encode())
    recording, _ = imuarray.simulate(model().array, 1.0, 50.0, seed=1)
    imuarray.write_recording(recording, tmp_path / "rec.nc")
    asked = ["calibrate", str(tmp_path / "rec.nc"), "--effects"]
    asked += ["accelerometer_cubic", "--effect-file", str(path), "--out", str(tmp_path / "cal.nc")]
    assert main(asked) == 2
    error = capsys.readouterr().err
    assert said in error and len(error.splitlines()) == 1
    assert not (tmp_path / "cal.nc").exists()
    if said not in ("left as it is", "gauge(shape, axes)"):
        assert known == EFFECTS


@pytest.mark.slow
def test_an_effect_with_a_gauge_of_its_own_is_one_place(tmp_path):
    """Simulated, calibrated, sampled and diagnosed; no other file knows of it."""
    path = tmp_path / "gain.py"
    path.write_text(GAIN)
    effects = imuarray.read_effects(path)
    recording, truth = imuarray.simulate(model().array, 2.5, 100.0, seed=3, effects=effects)
    true = truth["effect_parameter"].to_numpy()
    assert list(truth.parameter.values) == [f"accelerometer_gain gain_{k + 1} 1" for k in range(5)]
    found = imuarray.calibrate(recording, effects=effects)
    # the mean is a gauge, and pinned
    off = found["effect_parameter"].to_numpy() - (true - true.mean())
    off = off / found["effect_sd"].to_numpy()
    assert np.abs(off).max() < 4
    few = imuarray.select(recording, 5)
    posterior = imuarray.sample(few, method="nuts", steps=16, effects=effects)
    assert posterior["posterior"]["effect_parameter"].shape[-1] == 5
    without = [name for name in EFFECTS if name not in (*effects, "gyroscope_bias")]
    made = imuarray.diagnose(recording, without=without, replicates=2)
    (cause,) = made.document["causes"]
    assert cause["effect"] == "accelerometer_gain" and cause["sensors"] == ["all"]
    assert "each accelerometer has one gain" in cause["says"] and "%" in cause["says"]
    # the mean is pinned: single gains are determined against it
    gains = np.array([item["value"] for item in cause["parameters"].values()])
    assert abs(gains.mean()) < 1e-4
    assert np.abs(gains - (true - true.mean())).max() < 2e-3
    pinned = made.extended.fit.columns.prior_precision(made.extended.fit.active)
    assert np.linalg.eigvalsh(pinned)[-1] > 1e5 / 0.02**2


def test_no_module_beside_the_finders_names_an_effect():
    """What an effect is stands with it; what is special in finding it, with its finder."""
    finders = {
        "scans",
        "shocks",
        "special",
        "reading_effects",
        "noise_effects",
        "generic",  # names of sds
        "words",  # the sensor model's own in plain words; others by their names
        "export",  # what other tools have a place for
        "beside",  # how a recording's own clocks are found beside a known board
    }
    package = Path(imuarray.__file__).parent
    folders = "diagnosis", "report", "trust", "analysis", "commands", "estimation", "posterior"
    for folder in folders:
        for path in (package / folder).rglob("*.py"):
            text = path.read_text(encoding="utf-8")
            named = [name for name in {**EFFECTS, **DATA_EFFECTS} if f'"{name}"' in text]
            assert path.stem in finders or not named, (path, named)
