"""What is wrong, why, extended, gained: the panels and tables say what their inputs say."""

from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from imuarray.geometry import mimu4444_corners
from imuarray_papers.blind.cases import HIDDEN, hidden, make
from imuarray_papers.figures import criticism
from imuarray_papers.figures import hidden as hidden_figure
from imuarray_papers.figures.criticism import QUANTITIES
from imuarray_papers.figures.style import columns

ROOT = Path(__file__).parents[2]
STEPS = ("normal", "robust", "clocks", "no arms", "common arms")


def cause(effect, sensors, parameters, rivals=(), nats=100.0):
    return {
        "effect": effect, "sensors": list(sensors), "indistinguishable_from": list(rivals),
        "parameters": {k: {"value": v, "sd": s, "unit": "s"} for k, (v, s) in parameters.items()},
        "heldout_gain_nats": nats, "heldout_gain_se": 1.0,
    }  # fmt: skip


@pytest.fixture
def board():
    """Arguments of the board's figure: residuals twice the still noise, in two triads."""
    rows = [
        (source, quantity, triad, low, low + 1.0, size * (1 + low))
        for source, size in (("measured", 4.0), ("simulated", 1.0))
        for quantity in QUANTITIES for triad in "12" for low in (0.0, 1.0)
    ]  # fmt: skip
    names = ["source", "quantity", "triad", "bin_low", "bin_high", "rms"]
    noise = [(quantity, int(triad), 2.0) for quantity in QUANTITIES for triad in "12"]
    turn = np.linspace(0.0, 9.0, 10)
    clock = pd.DataFrame({"x": [*turn, *(turn + 10)], "y": 0.1, "se": 0.01, "model": 0.1,
                          "title": "IMU 3, 100 Hz"})  # fmt: skip
    lag = {f"delay_{k}": (1.5e-3, 1e-5) for k in range(8)}
    causes = [
        cause("gyroscope_delay", ["all"], lag),
        cause("sensor_clock", ["all"], {"period_1": (1e-3, None)}),
    ]
    model = pd.DataFrame({
        "step": STEPS, "rms_m": np.array([100, 50, 40, 12, 7]) * 1e-6, "same_size_rms_m": 4e-6,
        "covered": 0.95, "common_size_m": 1.3e-5, "smooth_ratio": [26.0, 20, 2, 1.9, 0.9],
        "residual_ratio": 16.0, "recordings": 5,
    })  # fmt: skip
    left_out = pd.DataFrame({"model": ["board"], "over_inflated": 81.4,
                             "over_inflated_error": 1.0})  # fmt: skip
    return {
        "summary": pd.DataFrame(rows, columns=names),
        "noise": pd.DataFrame(noise, columns=["sensor", "triad", "ratio"]),
        "diagnosis": ({"causes": causes}, {"cause_02_sensor_clock": clock}),
        "causes": model, "predicted": left_out, "name": "exp", "group": "board",
    }  # fmt: skip


def test_the_panels_have_what_was_computed(board):
    draw, table = criticism.figure_criticism(**board)
    draw(table).draw_without_rendering()
    wrong = table[(table.panel == "wrong") & (table.source == "measured")]
    # over the noise of still poses, twice the declared one; the simulation has the declared one
    assert set(wrong.y) == {2.0, 4.0}
    assert set(table[table.source == "simulated"].y) == {1.0, 2.0}
    clock = table[table.panel == "cause"]
    assert clock.x.min() == 0 and clock.x.max() == pytest.approx(1.9)
    rms = table[table.panel == "gained"].rms_m
    assert rms.tolist() == pytest.approx([1e-4, 5e-5, 4e-5, 1.2e-5, 7e-6])
    lag = table[(table.panel == "causes") & (table.effect == "gyroscope_delay")].iloc[0]
    assert lag["mean"] == pytest.approx(1.5e-3) and lag.sd == 1e-5


def test_the_table_answers_the_four_questions(board):
    table, _ = criticism.table_criticism(**board, recordings=mimu4444_corners())
    assert len(table) == 5 and list(table) == [column.name for column in columns("criticism")]
    text = "\n".join(table.astype(str).sum(axis=1))
    for said in ("accelerometers 4, gyroscopes 4", "1.50 ms ahead", "26.0", "100 µm", "7.0 µm; +81",
                 "13 µm", "16 × the noise"):  # fmt: skip
        assert said in text


def test_lever_arms_are_compared_by_the_axes_of_the_array():
    """From each chip's own, less what motion and positions take up."""
    _, truth = make(hidden("lever_arms", 4), 4)
    turns, rng = mimu_turns(), np.random.default_rng(0)
    true = np.array(truth["effects"][0]["parameters"]["lever_arm"]["value"])
    unseen = rng.normal(size=(1, 3, 3)) + rng.normal(size=(8, 1, 3))
    own = np.empty((8, 3, 3))
    for k, axis in np.ndindex(8, 3):
        along = int(np.argmax(np.abs(turns[k, :, axis])))
        own[k, axis] = turns[k].T @ (true + unseen)[k, along]
    values = {str(i): (float(value), 1e-6) for i, value in enumerate(own.ravel())}
    document = {"causes": [cause("size_effect", ["all"], values)]}
    table = hidden_figure._arms(document, truth, turns)
    np.testing.assert_allclose(table.found_m, table.true_m, atol=1e-12)
    assert np.std(table.true_m) > 0.5 * np.std(true)


def mimu_turns():
    """Of the boards that `make` draws: the underside's chips are turned."""
    recording, _ = make(hidden("nothing", 4), 4)
    return recording.accelerometer_axes


def test_what_is_hidden_is_drawn_in_one_scene():
    made = {which: make(hidden(which, 7), 7)[1] for which in HIDDEN}
    assert all(truth["positions_m"] == made["nothing"]["positions_m"] for truth in made.values())
    assert made["nothing"]["effects"] == []
    assert made["lever_arms"]["effects"][0]["sensors"] == ["all"]
    assert made["drawn"]["sigma"] == pytest.approx(hidden("drawn", 7).sigma, rel=1e-6)
    drawn = {hidden("drawn", seed).effects for seed in range(20)}
    assert len({name for ((name, _),) in drawn}) > 5


def test_a_row_says_what_was_found_of_what_was_hidden():
    truth = {"effects": [{
        "effect": "accelerometer_bias", "sensors": ["3"],
        "amplitude": {"value": 0.1, "unit": "m s-2"},
        "parameters": {"bias": {"value": [[0.3, 0.0, 0.4]], "unit": "m s-2"}},
    }]}  # fmt: skip
    found = {"x_3": (0.31, 0.01), "y_3": (0.5, 0.01), "z_3": (0.4, 0.01)}
    before, other = cause("sensor_clock", ["all"], {}), cause("shock", ["all"], {})
    right = {"causes": [before, cause("accelerometer_bias", ["3"], found)]}
    cases = [right, {"causes": [before]}, {"causes": [before, other]}]
    control = {"causes": [before]}, {}
    table, _ = hidden_figure.table_criticism_hidden(
        [(each, {}) for each in cases], [truth] * 3, [control] * 3, list("abc")
    )
    assert table.named.tolist() == ["accelerometer_bias", "nothing", "shock"]
    assert table.named_sensors[0] == "3" and table["size"][0] == "0.506 ± 0.01 m s-2"
    assert set(table.true_size) == {"0.5 m s-2"}
    assert set(table.control) == {"1 of its own, not this"}
    there = hidden_figure.table_criticism_hidden(
        [(right, {})], [truth], [({"causes": [before, right["causes"][1]]}, {})], ["a"]
    )[0]
    assert there.control[0] == "2 of its own, this too"


def test_the_pages_say_what_was_published(committed):
    """The paragraph of the README and of docs/measured.md, number by number."""
    table = pd.read_csv(committed / "criticism.csv").set_index("panel")
    wrong, smooth = table.loc["wrong"], table.loc["extended"].smooth.to_numpy()
    every = table.loc["extended"]["all"].to_numpy()
    apart = 1e6 * table.loc["gained"].rms_m.to_numpy()
    lag = table.loc["causes"].set_index("effect").loc["gyroscope_delay"]
    board = table.loc["left_out"].set_index("model").loc["board"]
    said = (
        f"up to {wrong[wrong.source == 'measured'].y.max():.0f} times the noise",
        f"{1e3 * lag['mean']:.2f} ± {1e3 * lag.sd:.2f} ms ahead",
        f"leave {smooth[-1]:.2f} times the noise instead of {smooth[0]:.0f}",
        f"All samples leave {every[-1]:.0f} instead of {every[0]:.0f}:",
        f"repeat to {apart[-1]:.1f} µm rms between recordings instead of {apart[0]:.0f};"
        f" heavy tails alone give {apart[1]:.0f}.",
        f"{board.over_inflated:.1f} ± {board.over_inflated_error:.1f} nats a sample more",
    )
    for page in ("README.md", "docs/measured.md"):
        text = " ".join((ROOT / page).read_text(encoding="utf-8").split())
        assert all(each in text for each in said), (page, said)
