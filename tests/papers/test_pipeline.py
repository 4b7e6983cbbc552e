"""The pipeline end to end: `quick` in a temporary directory, and one core against two."""

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
import xarray as xr

ROOT = Path(__file__).parents[2]

DRAWN = {f"figure_{name}" for name in (
    *(f"2017_fig{number}" for number in range(2, 6)),
    *(f"2021_fig{number}" for number in range(1, 6)),
)} | {"table_2021_table1", "table_2021_table2"}  # fmt: skip

pytestmark = pytest.mark.slow


def started(directory, *arguments, options="", profile="none", **environment):
    """The workflow with ``directory`` as its working directory, as it came to its end."""
    path = f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"
    command = [
        *(sys.executable, "-m", "snakemake", "-s", str(ROOT / "Snakefile")),
        *("--directory", str(directory), *options.split()),
        *("--workflow-profile", profile, *arguments),
    ]
    return subprocess.run(
        command, cwd=directory, env={**os.environ, "PATH": path, **environment}, timeout=1500,
        capture_output=True, text=True,
    )  # fmt: skip


def snakemake(directory, *arguments, source=ROOT / "src"):
    """It ends as it should, with the project's configuration; fail with its output."""
    shutil.copy(ROOT / "config.yaml", directory)
    options = "--configfile config.yaml --quiet rules"
    done = started(directory, *arguments, options=options, PYTHONPATH=str(source))
    assert done.returncode == 0, done.stdout[-3000:] + done.stderr[-6000:]
    return done


@pytest.fixture(scope="module")
def quick(tmp_path_factory):
    """Results of the whole quick pipeline on two cores."""
    directory = tmp_path_factory.mktemp("quick")
    snakemake(directory, "--cores", "2", "quick")
    return directory / "results" / "quick"


def test_every_figure_table_and_claim_is_there(quick):
    figures = {path.name for path in (quick / "figures").iterdir()}
    names = [*(f"2017_fig{i}" for i in range(2, 6)), *(f"2021_fig{i}" for i in range(1, 6))]
    assert figures == {f"{name}.{kind}" for name in names for kind in ("pdf", "png", "csv")}
    tables = {path.name for path in (quick / "tables").iterdir()}
    assert tables == {f"2021_table{i}.{kind}" for i in (1, 2) for kind in ("csv", "tex", "md")}
    claims = pd.read_csv(quick / "claims" / "claims.csv")
    assert set(claims.verdict) <= {"holds", "does not hold", "cannot be tested here"}
    for paper in (2017, 2021):
        testable = (claims.paper == paper) & (claims.verdict != "cannot be tested here")
        assert testable.sum() >= 12


def test_figure_3_without_position_error_is_the_gyroscopes_average(quick):
    """100 realisations x 3 axes: the RMSE's own sd is 4 %; 5 sd."""
    table = pd.read_csv(quick / "calibration" / "rate_error.csv")
    exact = table[(table.position_sd_m == 0) & (table.angular_rate_dps < 1000)]
    assert len(exact) and np.allclose(exact.array_rmse_dps, 0.06 / np.sqrt(32), rtol=0.2)


def test_figure_4_falls_with_the_square_root_of_the_samples(quick):
    table = pd.read_csv(quick / "calibration" / "position_error_samples.csv")
    last = table[(table.iterations == table.iterations.max()) & (table.samples >= 10)]
    slope = np.polyfit(np.log(last.samples), np.log(last.rmse_m), 1)[0]
    assert -0.56 < slope < -0.44
    assert 1e-6 < last.rmse_m.iloc[-1] < 4e-6


def test_figure_2_variance_is_inverse_in_the_draws(quick):
    """200 realisations: each variance's sd is 10 %; the slope's about 0.05; 4 sd."""
    for samples in (5, 50, 500):
        table = pd.read_csv(quick / "tuning" / f"variance_T{samples}.csv")
        regime = table[table.variance < 1]
        slope = np.polyfit(np.log(regime.draws), np.log(regime.variance), 1)[0]
        assert -1.2 < slope < -0.8


def test_results_carry_config_seed_and_versions(quick):
    with xr.open_datatree(quick / "chains" / "T5.nc", engine="h5netcdf") as tree:
        assert {"config", "seed", "versions", "thin", "step_length_m"} <= set(tree.attrs)
        assert tree["posterior"]["position"].dims == ("chain", "draw", "accelerometer", "axis")


def test_one_core_gives_the_bytes_of_two(quick, tmp_path):
    targets = [
        "calibration/rate_error.csv", "chains/T5.nc", "chains/quiet_T5.nc", "tuning/T50.json"
    ]  # fmt: skip
    snakemake(tmp_path, "--cores", "1", *(f"results/quick/{name}" for name in targets))
    for name in targets:
        one, two = tmp_path / "results" / "quick" / name, quick / name
        if name.endswith(".nc"):
            with (
                xr.open_datatree(one, engine="h5netcdf") as a,
                xr.open_datatree(two, engine="h5netcdf") as b,
            ):
                xr.testing.assert_identical(a.load(), b.load())
        else:
            assert one.read_bytes() == two.read_bytes()


def test_a_rule_reruns_alone(quick):
    """Deleting one table makes its rule run again, and nothing upstream of it."""
    table = quick / "tuning" / "T50.json"
    before, upstream = table.read_bytes(), (quick / "tuning" / "acceptance_T50.csv").stat()
    table.unlink()
    snakemake(quick.parents[1], "--cores", "1", "results/quick/tuning/T50.json")
    assert table.read_bytes() == before
    assert (quick / "tuning" / "acceptance_T50.csv").stat().st_mtime_ns == upstream.st_mtime_ns


def test_a_changed_source_reruns_what_rests_on_it(quick, tmp_path):
    """One file of each stage, by dry runs with a copy of the package."""
    shutil.copytree(ROOT / "src", tmp_path / "src", ignore=shutil.ignore_patterns("__pycache__"))
    assert rerun(quick.parents[1], tmp_path / "src") == set()
    for names, rules in (
        (("imuarray_papers/blind/scene.py", "imuarray/report/write.py",
          "imuarray/report/report.html.j2", "imuarray_papers/studies/sbc.py"), set()),
        (("imuarray_papers/studies/rate_error.py",), {"rate_error", "claims_accelerometers_only",
                                      "figure_2017_fig3", "claims", "quick"}),
        (("imuarray_papers/studies/checks/timing.py",), {"claims_timing", "claims", "quick"}),
        (("imuarray/pictures/imuarray.mplstyle",), {*DRAWN, "quick"}),
    ):  # fmt: skip
        texts = {tmp_path / "src" / name: "" for name in names}
        for path in texts:
            texts[path] = path.read_text(encoding="utf-8")
            added = "\nADDED = 1\n" if path.suffix == ".py" else "\n"
            path.write_text(texts[path] + added, encoding="utf-8")
        assert rerun(quick.parents[1], tmp_path / "src") == rules, names
        for path, text in texts.items():
            path.write_text(text, encoding="utf-8")


def rerun(directory, source):
    """Rules that a dry run lists with the package of ``source``."""
    said = snakemake(directory, "--cores", "1", "-n", "quick", source=source).stdout
    return set(re.findall(r"(?m)^(\w+) +\d+$", said)) - {"total"}


def test_what_is_printed_is_short(tmp_path):
    shutil.copy(ROOT / "config.yaml", tmp_path)
    profile = str(ROOT / "profiles" / "default")
    done = started(tmp_path, "--cores", "2", "-n", "quick", profile=profile)
    assert done.returncode == 0 and len(done.stdout) + len(done.stderr) < 10_000
    assert "figure 3 of 2017 (quick)" in done.stdout + done.stderr


def test_bad_configuration_is_one_clear_line(tmp_path):
    text = (ROOT / "config.yaml").read_text().replace("gyroscope_sd_dps: 0.06", "gyroscope_sd: 1")
    (tmp_path / "config.yaml").write_text(text)
    done = started(tmp_path, "--cores", "1", "-n")
    said = done.stdout + done.stderr
    assert done.returncode == 2 and "gyroscope_sd" in said and "Traceback" not in said
    assert not (tmp_path / "results").exists()


def test_lint_is_clean(tmp_path):
    shutil.copy(ROOT / "config.yaml", tmp_path)
    done = started(tmp_path, "--lint")
    assert "Congratulations" in done.stdout + done.stderr, done.stdout + done.stderr
