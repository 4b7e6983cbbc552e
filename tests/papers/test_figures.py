"""Figures and tables from small made-up tables: labels, numbers behind them, the same bytes."""

import json
import re
import subprocess
import sys
from pathlib import Path

import matplotlib
import numpy as np
import pandas as pd
import pytest
import yaml

from imuarray.geometry import mimu4444
from imuarray.posterior.chains import Chains, chain_tree
from imuarray.posterior.prior import GaussianPrior
from imuarray_papers.figures import paper2017, paper2021, paper2021_array, paper2021_tables, style
from imuarray_papers.figures.gallery import caption, gallery, title
from imuarray_papers.figures.style import rounded, significant, write_figure

ROOT = Path(__file__).parents[2]
SAMPLES = (5, 50, 500)
NAMES = [f"2017_fig{n}" for n in (2, 3, 4, 5)] + [f"2021_fig{n}" for n in (1, 2, 3, 4, 5)]


def verdict(samples=5, converged=False, **more):
    return {
        "samples": samples, "draws_per_sample": 3, "step_length_m": 4.1e-7, "steps": 8000,
        "acceptance": [0.2, 0.19], "rhat_max": 1.01 if converged else 1.7, "ess_min": 12.3,
        "ess_median": 40.0, "burn_in_steps": 400, "rhat_threshold": 1.05, "converged": converged,
        **more,
    }  # fmt: skip


def rate_errors():
    grid = [(rate, sd) for sd in (0.0, 1e-4) for rate in (10.0, 1000.0, 5000.0)]
    table = pd.DataFrame(grid, columns=["angular_rate_dps", "position_sd_m"])
    table["array_rmse_dps"] = [0.011, 0.012, 0.4, 0.013, 0.014, 4.5]
    table["gyroscopes_rmse_dps"] = [0.01, 0.02, 900.0, 0.03, 0.02, 1000.0]
    return table.assign(array_rmse_se_dps=1e-3, gyroscopes_rmse_se_dps=1e-3, realisations=10)


def sample_errors():
    rows = [(n, i, 1e-3 / (i * np.sqrt(n))) for n in (2, 10, 40, 160) for i in (1, 10)]
    table = pd.DataFrame(rows, columns=["samples", "iterations", "rmse_m"])
    return table.assign(rmse_se_m=table.rmse_m / 20, realisations=10)


def motion_errors():
    rows = [(r, a, 1 / (r * a)) for a in (200.00000000000003, 2e5) for r in (50.0, 2000.0)]
    table = pd.DataFrame(rows, columns=["angular_rate_dps", "angular_acceleration_dps2", "rmse_m"])
    return table.assign(rmse_se_m=table.rmse_m / 20, samples=10, iterations=200, realisations=10)


def sweep(samples):
    draws = np.array([1, 2, 5, 10])
    variance = 0.01 * samples / draws
    return pd.DataFrame({"samples": samples, "draws": draws, "variance": variance}).assign(
        variance_se=variance / 10, realisations=200
    )


def effective():
    config = yaml.safe_load((ROOT / "config.yaml").read_text(encoding="utf-8"))
    return config | {"scale": {"name": "test", **config["scales"]["quick"]}}


def chained(draws, prior_mean):
    """What `read_chains` gives of (chains, draws, A - 1, 3) m: thinned to every 20th step."""
    labels = [str(k) for k in range(2, 2 + draws.shape[2])]
    flat = draws.reshape(*draws.shape[:2], -1)
    chains = Chains(flat, np.zeros(draws.shape[:2]), np.array([0.2, 0.19]), 20, 4e-7)
    prior = GaussianPrior.of(prior_mean.ravel(), 3e-3)
    return chains, chain_tree(chains, labels, prior, {})


def figure_2021_fig3(draws, burn_in, truth=1e-6):
    """Of chains of one coordinate, (chains, draws) m."""
    made = np.stack([draws] * 3, axis=-1)[:, :, None]
    judged = verdict(burn_in_draws=burn_in, burn_in_steps=20 * burn_in)
    truths = pd.DataFrame({"truth_m": [truth] * 3})
    given = [chained(made, np.zeros((1, 3)))], [judged], [truths]
    return paper2021.figure_2021_fig3(*given, effective())


def case(name, section=None):
    """(figure, table) of one figure, drawn afresh from the numbers that are published."""
    draw, table = parts(name, section)
    return draw(rounded(table)), rounded(table)


def parts(name, section=None):
    """(drawing function, table) of one figure; ``section`` of the configuration: the array."""
    rng = np.random.default_rng(7)
    settings = effective()
    settings["array"] = section or settings["array"]
    array = paper2021_array.array_from_config(settings["array"])
    places = array.relative[1:]
    simple = {
        "2017_fig3": (paper2017.figure_2017_fig3, rate_errors()),
        "2017_fig4": (paper2017.figure_2017_fig4, sample_errors()),
        "2017_fig5": (paper2017.figure_2017_fig5, motion_errors()),
        "2017_fig2": (paper2021_array.figure_2017_fig2,),
        "2021_fig1": (paper2021_array.figure_2021_fig1,),
        "2021_fig2": (paper2021.figure_2021_fig2, [sweep(samples) for samples in SAMPLES]),
    }
    if name in simple:
        function, *given = simple[name]
        return function(*given, settings)
    if name == "2021_fig3":
        return figure_2021_fig3(1e-5 * rng.standard_normal((2, 200)), 40)
    verdicts = [verdict(samples, burn_in_draws=0) for samples in SAMPLES]
    if name == "2021_fig4":
        chains = [
            chained(1e-4 / T * rng.standard_normal((2, 100, 1, 3)), np.zeros((1, 3)))
            for T in SAMPLES
        ]
        truths = [pd.DataFrame({"truth_m": np.full(3, -1e-6)})]
        return paper2021.figure_2021_fig4(chains, verdicts, truths, settings)
    chains = [
        chained(places + 1e-3 / T * rng.standard_normal((2, 50, *places.shape)), places)
        for T in SAMPLES
    ]
    truths = [pd.DataFrame({"truth_m": places.ravel()})]
    return paper2021_array.figure_2021_fig5(chains, verdicts, truths, [array], settings)


def save(name, folder):
    folder.mkdir(exist_ok=True)
    draw, table = parts(name)
    paths = {kind: folder / f"{name}.{kind}" for kind in ("pdf", "png", "csv")}
    write_figure(draw, table, **paths)
    return rounded(table), paths


def curves(figure):
    """Data (points, 2) of every line but for levels and the caps of error bars."""
    lines = [line for axes in figure.axes for line in axes.get_lines() if line.get_marker() != "_"]
    return [line.get_xydata() for line in lines if len(line.get_xydata()) > 2]


@pytest.mark.parametrize("name", NAMES)
def test_labels_name_their_units(name):
    figure, _ = case(name)
    labels = [text for axes in figure.axes for text in (axes.get_xlabel(), axes.get_ylabel())]
    labels = [text for text in labels if text]
    assert len(labels) >= 2 or name == "2017_fig2"  # seen obliquely, it has no axes
    assert all(re.search(r"\(.+\)", text) for text in labels), labels
    assert "Scale test" in figure.texts[0].get_text()


@pytest.mark.parametrize("name", NAMES)
def test_same_bytes_and_csv_gives_the_table_back(name, tmp_path):
    table, first = save(name, tmp_path / "a")
    with matplotlib.rc_context({"font.size": 20, "lines.linewidth": 9, "savefig.dpi": 30}):
        _, second = save(name, tmp_path / "b")
    for kind in first:
        assert first[kind].read_bytes() == second[kind].read_bytes(), kind
    read = pd.read_csv(first["csv"], dtype={"accelerometer": str})
    pd.testing.assert_frame_equal(read, table, check_dtype=False, check_exact=True)
    assert b"CreationDate" not in first["pdf"].read_bytes()
    assert b"Software" not in first["png"].read_bytes()
    assert not list(tmp_path.glob("*/.*"))
    # and the figure is drawn from that file and nothing else
    read.attrs = parts(name)[1].attrs
    write_figure(parts(name)[0], read, **{kind: tmp_path / f"c.{kind}" for kind in first})
    assert all((tmp_path / f"c.{kind}").read_bytes() == first[kind].read_bytes() for kind in first)


def test_published_numbers_have_the_digits_that_they_are_worth():
    table = pd.DataFrame({"x": [1.23456789e-7, np.nan], "x_se": [0.123456, 1e10], "n": [123456, 2],
                          "far": [10.1234567, -1 / 3], "name": ["a", "b"]})  # fmt: skip
    table.attrs["digits"] = {"far": 8}
    found = rounded(table)
    assert found.x[0] == 1.2346e-7 and np.isnan(found.x[1]) and list(found.n) == [123456, 2]
    assert list(found.x_se) == [0.123, 1e10] and list(found.far) == [10.123457, -0.33333333]


def rows_of(curve, table, x, y):
    """Whether all of a curve's points are rows of the table."""
    points = set(zip(table[x], table[y], strict=True))
    return all((a, b) in points for a, b in curve)


def test_2017_figures_plot_their_tables():
    for name, x, y in (
        ("2017_fig3", "angular_rate_dps", "rmse_dps"),
        ("2017_fig4", "samples", "rmse_m"),
    ):
        figure, table = case(name)
        drawn = curves(figure)
        assert sum(map(len, drawn)) == len(table)
        assert all(rows_of(curve, table, x, y) for curve in drawn)
    figure, table = case("2017_fig5")
    lines = [line for line in figure.axes[0].get_lines() if line.get_marker() in ("o", "s")]
    assert len(lines) == 2
    assert all(rows_of(x.get_xydata(), table, "angular_rate_dps", "rmse_m") for x in lines)
    assert sorted(table.angular_acceleration_dps2.unique()) == [200.0, 2e5]


def gyroscopes_of_nine():
    settings = effective()
    settings["array"] = {"board": "mimu4444", "gyroscopes": 9}
    return paper2017.figure_2017_fig3(rate_errors(), settings)[1]


def test_gyroscopes_are_averaged_over_position_errors():
    table = gyroscopes_of_nine()
    means = table[table.series == "gyroscopes"]
    np.testing.assert_allclose(means.rmse_dps, np.sqrt([5e-4, 4e-4, 905000.0]))
    np.testing.assert_allclose(means.rmse_se_dps.iloc[1], 1e-3 / np.sqrt(2))
    np.testing.assert_allclose(table[table.series == "unsaturated"].rmse_dps, 0.02)


def test_reference_line_passes_through_the_last_line():
    _, table = case("2017_fig4")
    last = table[(table.series == "bcd") & (table.iterations == 10)]
    reference = table[table.series == "reference"]
    np.testing.assert_allclose(reference.rmse_m, last.rmse_m, rtol=1e-3)


def test_2021_fig2_plots_its_table_with_the_fit():
    figure, table = case("2021_fig2")
    np.testing.assert_allclose(table.fit, table.variance, rtol=1e-4)
    drawn = curves(figure)
    assert len(drawn) == 2 * len(SAMPLES)
    for curve in drawn:
        assert rows_of(curve, table, "draws", "variance") or rows_of(curve, table, "draws", "fit")


def test_2021_fig3_plots_its_table():
    figure, table = case("2021_fig3")
    for panel in ("trace", "autocorrelation"):
        for chain in (1, 2):
            rows = table[(table.panel == panel) & (table.chain == chain)]
            wanted = rows[["step", "value"]].to_numpy()
            found = [curve for curve in curves(figure) if np.array_equal(curve, wanted)]
            assert len(found) == (2 if panel == "trace" else 1)
    bins = table[table.panel == "histogram"]
    area = (bins.value * (bins.high_um - bins.low_um)).groupby(bins.chain).sum()
    np.testing.assert_allclose(area, 1.0, rtol=1e-4)
    first = table[table.panel == "autocorrelation"].groupby("chain").value.first()
    np.testing.assert_allclose(first, 1.0)


def test_2021_fig3_leaves_the_burn_in_out_of_the_histogram():
    draws = np.concatenate([np.full((2, 30), 1.0), np.zeros((2, 70))], axis=1)
    draws += 1e-6 * np.random.default_rng(3).standard_normal(draws.shape)
    table = paper2021.chain_panels(draws, 30, 10)
    assert table.high_um.max() < 10 and table[table.panel == "trace"].value.max() > 9e5
    assert not (table.panel == "truth").any()


def test_2021_fig4_plots_its_table():
    figure, table = case("2021_fig4")
    for axes, axis in zip(figure.axes[::2], "xyz", strict=True):
        rows = table[table.axis == axis]
        drawn = [line.get_xydata() for line in axes.get_lines() if len(line.get_xydata()) > 2]
        groups = list(rows.groupby(["samples", "chain"]))
        assert len(drawn) == len(groups) == 7
        for curve, ((samples, _), one) in zip(drawn, groups, strict=True):
            peak = rows[rows.samples == samples].density_per_um.max()
            np.testing.assert_array_equal(curve[:, 0], one.deviation_um)
            np.testing.assert_array_equal(curve[:, 1], one.density_per_um / peak)
            area = np.trapezoid(one.density_per_um, one.deviation_um)
            assert abs(area - 1) < 0.01


def test_2021_fig5_plots_its_table():
    figure, table = case("2021_fig5")
    board = [axes for axes in figure.axes if axes.get_title().endswith("from above")]
    for axes, side in zip(board, ("topside", "underside"), strict=True):
        rows = table[(table.side == side) & (table.samples > 0)]
        dots = [line.get_xydata()[0] for line in axes.get_lines() if line.get_marker() == "."]
        np.testing.assert_array_equal(dots, rows[["mean_x_mm", "mean_y_mm"]].to_numpy())
        low, high = axes.get_ylim()
        assert low > high  # y points down: IMU 1 is in the lower left
    assert figure.get_suptitle() == "MEASURED"


def test_ellipse_holds_its_share():
    """Seed 11; 20000 draws, 4.5 sd: false alarm 1e-5."""
    rng = np.random.default_rng(11)
    covariance = np.array([[2.0, 0.9], [0.9, 1.0]])
    draws = rng.multivariate_normal([3.0, -1.0], covariance, 20000)
    row = pd.Series(
        {
            "mean_x_mm": 3.0,
            "mean_y_mm": -1.0,
            "cov_xx_mm2": 2.0,
            "cov_xy_mm2": 0.9,
            "cov_yy_mm2": 1.0,
        }
    )
    outline = matplotlib.path.Path(paper2021_array.ellipse(row, 0.5, 721))
    assert abs(outline.contains_points(draws).mean() - 0.5) < 4.5 * 0.5 / np.sqrt(20000)


@pytest.mark.parametrize("name", ["2017_fig2", "2021_fig1", "2021_fig5"])
def test_other_arrays_can_be_drawn(name, tmp_path):
    flat = {"positions": [[0, 0, 0], [0.01, 0, 0], [0, 0.01, 0], [0.01, 0.02, 0]]}
    for section in ({"board": "mimu4444_corners"}, flat):
        paths = {kind: tmp_path / f"a.{kind}" for kind in ("pdf", "png", "csv")}
        write_figure(*parts(name, section), **paths)


def test_underside_lies_beneath_and_is_turned():
    table = paper2021_array.layout_table(mimu4444())
    assert (table.side == "underside").to_numpy().tolist() == [False, True] * 16
    marker = table[["marker_x_m", "marker_y_m"]].to_numpy() - table[["x_m", "y_m"]].to_numpy()
    np.testing.assert_allclose(marker[1::2], -marker[::2][:, ::-1])


def test_only_converged_chains_are_called_so():
    assert "converged" not in " ".join(style.chain_lines({5: verdict(), 50: verdict(50)}))
    lines = style.chain_lines({5: verdict(converged=True), 50: verdict(50)})
    assert "converged: T = 5." in lines[-1] and "preliminary: T = 50." in lines[-1]
    assert "0.20/0.19" in lines[0] and "0.41 µm" in lines[0] and "R-hat 1.700" in lines[1]


def test_significant():
    assert [significant(x) for x in (2103.4, 31.44, 0.41151)] == ["2100", "31.4", "0.412"]


DRAW_ALONE = """
import sys
import pandas as pd
from imuarray_papers.figures import gallery, paper2017, paper2021, paper2021_array, paper2021_tables
settings = {"array": {"board": "mimu4444"}, "scale": {"name": "test"}, "seed": 1}
paper2021_array.figure_2021_fig1(settings)
rows = {"samples": [1, 2], "draws": 1, "variance": 1.0, "variance_se": 0.1, "realisations": 9}
paper2021.figure_2021_fig2([pd.DataFrame(rows)], settings | {"paper2021": {"variance_target": 1}})
bad = ("emcee", "arviz", "numba", "jax", "imuarray.posterior", "imuarray.simulation")
print([name for name in sys.modules if name.startswith(bad)])
"""


def test_drawing_does_not_touch_the_sampler():
    done = subprocess.run([sys.executable, "-c", DRAW_ALONE], capture_output=True, text=True)
    assert done.stdout.strip() == "[]", done.stdout + done.stderr


def two_tables():
    tunings = [
        {"samples": T, "draws": 3, "step_length_m": 4.1e-7, "variance": 0.09} for T in SAMPLES
    ]
    first = paper2021_tables.table_2021_table1(tunings, [verdict(T) for T in SAMPLES], effective())
    sources = [
        [part for T in SAMPLES for part in (
            pd.DataFrame({"axis": list("xyz"), "sd_m": np.array([1.0, 2.0, 3.0]) * scale}),
            verdict(T, converged=True))]
        for scale in (1e-4, 1.1e-4, 1e-6)
    ]  # fmt: skip
    return first, paper2021_tables.table_2021_table2(*sources, effective())


def test_tables(tmp_path):
    for name, (table, words) in zip(("2021_table1", "2021_table2"), two_tables(), strict=True):
        paths = {kind: tmp_path / f"{name}.{kind}" for kind in ("csv", "tex", "md")}
        style.write_table(name, table, words, **paths)
        read = pd.read_csv(paths["csv"])
        pd.testing.assert_frame_equal(read, rounded(table), check_dtype=False, check_exact=True)
        rows = [line for line in paths["md"].read_text().splitlines() if line.startswith("|")]
        assert len(rows) == len(table) + 2
        assert {row.count("|") for row in rows} == {len(style.columns(name)) + 1}
        tex = paths["tex"].read_text()
        assert "these are ours" in tex and r"50 \%" in style.latex(table, [], "50 %", [])
        assert tex.count(r"\\") == len(table) + 1


def test_table2_compares_with_the_last_source():
    (first, _), (table, words) = two_tables()
    np.testing.assert_allclose(table.ratio, [100, 110, 1] * 3)
    np.testing.assert_allclose(table.sd_median_m[:3], [2e-4, 2.2e-4, 2e-6])
    assert table.source[0] == "experiment (measured)"
    lines = style.notes("2021_table2", words)
    assert "IMUs: 2 (experiment" in lines[1] and "recording exp_1" in lines[0] and len(lines) == 3
    assert style.unfinished(table, 1.05) == ""
    assert "3 of 3" in style.unfinished(first, 1.05)


def test_captions_and_gallery():
    settings = effective()
    captions = {
        path.stem: caption(path.read_text(encoding="utf-8"), settings)
        for path in (ROOT / "workflow" / "report").glob("20*.rst")
    }
    names = ["2021_table1", "2021_table2"]
    assert sorted(captions) == sorted(NAMES + names)
    assert json.dumps(settings["paper2017"]["fig5_samples"]) in captions["2017_fig5"]
    figures = {name: captions[name] for name in NAMES}
    bodies = {name: (captions[name], "| T |") for name in names}
    page = gallery(figures, bodies, settings, {"Section IV-A": ["T=5: ..."]})
    for name in NAMES:
        assert f"]({name}.png)" in page and f"[PDF]({name}.pdf)" in page and captions[name] in page
    assert "(claims.md)" in page and "## Paper 2021, table II" in page and "- T=5: ..." in page
    assert title("2017_fig3") == "Paper 2017, figure 3"
    assert title("2017_fig10") == "Paper 2017, figure 10"
    assert title("2017_gain") == "Paper 2017, gain"
