"""The blind study: what the diagnosis is given, the grades, the criteria, tables and figures."""

import json
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
import yaml

from imuarray.diagnosis.procedure import run_procedure
from imuarray_papers.blind import study, summary
from imuarray_papers.blind.cases import Case, make, matrix
from imuarray_papers.blind.inject import CATALOGUE, EFFECTS
from imuarray_papers.figures import blind as drawing
from imuarray_papers.figures.style import columns, write_figure, write_table
from imuarray_papers.pipeline.rules import effective

ROOT = Path(__file__).parents[2]
POSITIONS = [[0.0, 0.0, 0.0], [0.02, 0.0, 0.0], [0.0, 0.02, 0.001]]
SHORT = {"duration": 2.0}


def cause(effect, sensors=("3",), rivals=()):
    return {
        "effect": effect, "sensors": list(sensors), "indistinguishable_from": list(rivals),
        "p_value": 1e-9,
    }  # fmt: skip


def model(error=1e-4, sd=1e-4, shift=0.0):
    """Positions off by ``error`` in each coordinate, all moved by ``shift``, metres."""
    found = np.array(POSITIONS) + shift
    found[1:] += error
    return {"positions_m": found.tolist(), "positions_sd_m": np.full((3, 3), sd).tolist()}


def answer(causes=(), unexplained=False):
    return {"extended": model(), "causes": list(causes), "unexplained": unexplained}


def truth_of(kind, names, sigma=20.0, sensors=("3",), **settings):
    """The truth of a made-up case with these effects, all of one size."""
    case = {"kind": kind, "imus": 8, "sampling_rate": 125.0, "duration": 24.0, "rails": False}
    effects = [
        {"effect": name, "sensors": list(sensors), "sigma": sigma, "sigma_exact": sigma,
         "amplitude": {"value": 0.01 * sigma, "unit": "m"}, "parameters": {}}
        for name in names
    ]  # fmt: skip
    return {
        "case": case | {"sigma": sigma} | settings, "effects": effects, "positions_m": POSITIONS,
        "sigma": sigma * len(names), "sigma_exact": sigma * len(names),
        "struck": list(names) if kind == "struck" else [],
    }  # fmt: skip


NUMBER = iter(range(10**6))


def graded(kind, names, *given, size=20.0, seconds=20.0, **settings):
    """A row; ``given``: causes and unexplained, or "crash"."""
    crash = given == ("crash",)
    return study.grade(
        {
            "case": f"{kind}-{next(NUMBER):04d}",
            "truth": truth_of(kind, names, size, **settings),
            "diagnosis": None if crash else answer(*given),
            "error": "ValueError: nothing" if crash else None,
            "seconds": 1000.0,
            "cpu_seconds": seconds,
        }
    )


BIAS, SCALE, DELAY = "accelerometer_bias", "accelerometer_scale", "sensor_delay"
CLOCKLIKE = cause("sensor_clock", rivals=[DELAY])


@pytest.mark.parametrize(
    ("kind", "names", "causes", "unexplained", "confident"),
    [
        ("gauge", ["gauge_sensor_delay"], [], False, False),
        ("gauge", ["gauge_sensor_delay"], [cause(DELAY)], False, True),
        ("gauge", ["gauge_sensor_delay"], [cause(DELAY)], True, False),
        ("gauge", ["gauge_sensor_delay"], [CLOCKLIKE], False, False),
        ("gauge", ["gauge_sensor_delay"], [CLOCKLIKE, cause(BIAS)], False, True),
        ("outside", ["outside_cubic"], [CLOCKLIKE], False, True),
        ("outside", ["outside_cubic"], [CLOCKLIKE], True, False),
        ("struck", [BIAS], [cause(SCALE)], False, True),
        ("struck", [BIAS], [], True, False),
    ],
)
def test_a_name_without_reserve(kind, names, causes, unexplained, confident):
    row = graded(kind, names, causes, unexplained)
    assert row["confident"] is confident and not row["crash"]
    json.dumps(row, allow_nan=False)


@pytest.mark.parametrize(
    ("names", "causes", "right"),
    [
        ([BIAS], [cause(BIAS)], True),
        ([DELAY], [CLOCKLIKE], True),
        ([DELAY], [CLOCKLIKE, cause(DELAY)], False),
        ([BIAS], [cause(SCALE), cause(BIAS)], False),
        ([BIAS], [], False),
        ([BIAS, SCALE], [cause(SCALE), cause(BIAS)], True),
        ([BIAS, DELAY], [CLOCKLIKE, cause(BIAS)], True),
        ([BIAS, SCALE], [cause(SCALE, rivals=[BIAS])], False),
        ([BIAS, SCALE], [cause(SCALE), cause(SCALE, ["4"])], False),
    ],
)
def test_exactly_the_right_set(names, causes, right):
    assert graded("pair", names, causes)["right_set"] is right


def test_found_by_class_named_by_itself_and_on_the_right_sensors():
    def seen(causes, sensors=("3",)):
        effect = graded("one", [DELAY], causes, sensors=sensors)["truth"][0]
        return effect["found"], effect["named"], effect["sensors_right"]

    assert seen([cause(DELAY)]) == (True, True, True)
    assert seen([CLOCKLIKE]) == (True, False, True)
    assert seen([cause(DELAY, ["3", "4"])]) == (True, True, False)
    assert seen([cause(DELAY, ["3"]), cause(DELAY, ["4"])], ["3", "4"]) == (True, True, True)
    assert seen([cause(DELAY, map(str, range(8)))], ["all"]) == (True, True, True)
    assert seen([cause(DELAY, ["all"])]) == (True, True, False)
    assert seen([cause(BIAS)]) == (False, False, False)
    # the one named itself decides on the sensors
    assert seen([cause("sensor_clock", ["5"], [DELAY]), cause(DELAY)]) == (True, True, True)


def test_wrong_names_are_those_whose_class_has_nothing_of_the_truth():
    row = graded("pair", [BIAS, DELAY], [CLOCKLIKE, cause(SCALE, rivals=["size_effect"])])
    assert row["wrong_names"] == [SCALE] and not row["right_set"]
    # three causes for two effects are not the set, even without a wrong name
    many = [cause(BIAS), CLOCKLIKE, cause(DELAY)]
    row = graded("pair", [BIAS, DELAY], many)
    assert row["wrong_names"] == [] and not row["right_set"]


def test_accuracy_is_relative_to_the_first_triad():
    """Errors 1e-4 m: sds of 1e-4 / 1.96 cover just so."""
    sd = 1.001e-4 / 1.96
    assert study.accuracy(model(1e-4, sd), POSITIONS)["covered"] == 6
    assert study.accuracy(model(1e-4, 0.99 * sd), POSITIONS)["covered"] == 0
    moved = study.accuracy(model(1e-4, sd, shift=0.3), POSITIONS)
    assert moved["coordinates"] == 6 and moved["position_rmse_m"] == pytest.approx(1e-4)
    with pytest.raises(ValueError, match="positions"):
        study.accuracy(model(), POSITIONS[:2])


def spy(document, seen):
    def diagnose(recording, **options):
        seen.append((recording, options))
        if document is None:
            raise ZeroDivisionError("no motion")
        return SimpleNamespace(document=document)

    return diagnose


def words_of(recording) -> str:
    """All texts of a recording and the options."""
    return repr([value for value in vars(recording).values() if not isinstance(value, np.ndarray)])


def test_diagnosis_is_given_nothing_of_the_case():
    seen = []
    document = answer() | {"discrepancies": ["figures"], "seed": 7}
    case = Case("one-0001-accelerometer_bias", ((BIAS, (2,)),), 20.0, kind="one", **SHORT)
    entry = study.diagnosed(case, 7, spy(document, seen))
    (recording, options), = seen  # fmt: skip
    assert options == {"seed": 7, "without": ()}
    assert case.id not in words_of(recording) and BIAS not in words_of(recording)
    assert entry["truth"]["effects"][0]["effect"] == BIAS and entry["case"] == case.id
    assert set(entry["diagnosis"]) == set(study.KEPT) and entry["error"] is None
    assert entry["seconds"] > 0 and entry["cpu_seconds"] >= 0
    struck = Case("struck", ((BIAS, (2,)),), 20.0, kind="struck", **SHORT)
    study.diagnosed(struck, 7, spy(document, seen))
    assert seen[-1][1]["without"] == (BIAS,)
    outside = Case("x", (("outside_cubic", (2,)),), kind="outside")
    assert outside.struck == () == case.struck


def test_a_crash_is_a_row(capsys):
    clean = Case("clean-0001", **SHORT)
    entry = study.diagnosed(clean, 7, spy(None, []))
    assert entry["diagnosis"] is None and entry["error"] == "ZeroDivisionError: no motion"
    assert "Traceback" in capsys.readouterr().err
    row = graded("one", [BIAS], "crash")
    assert row["crash"] and not row["truth"][0]["found"] and row["extended"] is None
    bad = answer() | {"unexplained": float("nan")}
    assert study.diagnosed(clean, 7, spy(bad, []))["error"].startswith("ValueError")
    short = {"causes": []}
    assert study.diagnosed(clean, 7, spy(short, []))["error"].startswith("KeyError")


@pytest.mark.parametrize("batches", [1, 7, 26])
def test_batches_hold_every_case_once(batches):
    cases = matrix("default")
    dealt = [study.batch_of(cases, batch, batches) for batch in range(batches)]
    assert sorted(c.id for part in dealt for c in part) == sorted(c.id for c in cases)
    assert max(map(len, dealt)) - min(map(len, dealt)) <= 1
    with pytest.raises(ValueError, match="batch"):
        study.batch_of(cases, batches, batches)


def test_limits_of_shares():
    """Clopper and Pearson: none of n has the upper limit 1 - 0.025^(1/n)."""
    assert summary.share_limits(0, 80) == pytest.approx((0.0, 1 - 0.025 ** (1 / 80)))
    assert summary.share_limits(20, 400) == pytest.approx((0.0308, 0.0762), abs=5e-4)
    assert summary.share_limits(0, 0) == (0.0, 1.0)


def bars_of(rows):
    table = summary.criteria(summary.recordings(rows))
    return {row["id"]: row for row in table.to_dict("records")}


def test_bars_count_the_recordings_they_are_set_for():
    one = [BIAS]
    rows = [graded("one", one, [cause(BIAS)]) for _ in range(8)]
    rows += [graded("one", one, [cause(SCALE)]), graded("one", one, "crash")]
    rows += [graded("one", one, [], size=4.0), graded("one", one, [], imus=32)]
    found = bars_of(rows)
    assert (found["one_found"]["recordings"], found["one_found"]["count"]) == (10, 8)
    assert found["one_found"]["verdict"] == "short by 17.0 points"
    assert found["one_found"]["sure"] is False
    # the crash is no wrong name, and not counted among the others
    assert (found["one_wrong"]["recordings"], found["one_wrong"]["count"]) == (9, 1)
    assert found["one_found"]["all_recordings"] == 11
    assert (found["crashes"]["recordings"], found["crashes"]["count"]) == (11, 1)
    assert found["crashes"]["verdict"].startswith("short")
    assert found["pair_set"]["verdict"] == summary.NONE
    # 7.95 sigma was 8 when asked for, 7 was not
    near = [graded("one", one, [], size=size) for size in (7.95, 7.0)]
    assert bars_of(near)["one_found"]["recordings"] == 1


def test_bars_of_the_other_sets():
    rows = [graded("clean", [], []) for _ in range(98)]
    rows += [graded("clean", [], [cause(BIAS)]), graded("clean", [], [], True)]
    rows += [graded("pair", [BIAS, SCALE], [cause(BIAS), cause(SCALE)], size=12.0)] * 6
    rows += [graded("pair", [BIAS, SCALE], [cause(BIAS)], size=12.0)]
    rows += [graded("pair", [BIAS, SCALE], [], size=9.0)]
    rows += [graded("gauge", ["gauge_lever_arm"], [cause(BIAS)])]
    rows += [graded("outside", ["outside_cubic"], [cause(BIAS)], True, seconds=61.0)]
    rows += [graded("struck", [BIAS], [cause(SCALE)])]
    found = bars_of(rows)
    assert found["false_alarms"]["share"] == pytest.approx(1 / 100)
    assert found["false_alarms"]["verdict"] == "pass" and not found["false_alarms"]["sure"]
    assert found["clean_unexplained"]["count"] == 1 and found["clean_unexplained"]["verdict"] == ""
    assert found["false_alarms_limit"]["verdict"] == "needs 400"
    assert (found["pair_set"]["count"], found["pair_set"]["recordings"]) == (6, 7)
    assert found["gauge"]["verdict"] == "short by 100.0 points"
    assert found["outside"]["verdict"] == "pass" and found["struck"]["count"] == 1
    assert found["time"]["count"] == 1 and found["time"]["verdict"].startswith("short")
    many = bars_of([graded("clean", [], [cause(BIAS)] if i < 12 else []) for i in range(400)])
    # 12 of 400: 3 %, upper limit 5.2 %
    assert many["false_alarms"]["verdict"] == "short by 1.0 points"
    assert many["false_alarms_limit"]["verdict"] == "short by 1.2 points"


def test_coverage_is_judged_between_recordings():
    def line(covered, coordinates):
        rows = [graded("clean", [], []) for _ in covered]
        for row, count in zip(rows, covered, strict=True):
            row["extended"] = {
                "position_rmse_m": 1e-4, "covered": count, "coordinates": coordinates
            }  # fmt: skip
        return bars_of(rows)["coverage_clean"]

    # shares 0.94 and 0.95 in turn: sd 0.00527; Student's t for 9 degrees of freedom 2.262
    found = line([9400, 9500] * 5, 10_000)
    assert found["share"] == pytest.approx(0.945) and found["verdict"] == "pass" and found["sure"]
    width = 2 * 2.262 * 0.00527 / np.sqrt(10)
    assert found["high"] - found["low"] == pytest.approx(width, rel=1e-2)
    found = line([10_000] * 10, 10_000)
    assert found["verdict"] == "short by 2.0 points" and found["sure"]
    # three recordings that agree are not sure of it: 0.0275 for 63 coordinates, t 4.303
    found = line([21] * 3, 21)
    assert found["verdict"] == "short by 2.0 points" and not found["sure"]
    assert found["low"] == pytest.approx(1 - 4.303 * np.sqrt(0.95 * 0.05 / 63), abs=1e-3)
    assert line([21], 21)["sure"] is None


def test_confusion_counts_right_and_wrong_names_apart():
    rows = [graded("one", [DELAY], [CLOCKLIKE]), graded("one", [DELAY], [cause(DELAY)], True)]
    rows += [graded("one", [DELAY], [cause(BIAS)]), graded("one", [DELAY], [])]
    rows += [graded("one", [DELAY], "crash"), graded("one", [DELAY], [cause(BIAS)], size=4.0)]
    rows += [graded("clean", [], []), graded("outside", ["outside_cubic"], [], True)]
    table = summary.confusion(rows).set_index(["truth", "named"])
    line = table.loc[DELAY]
    assert set(line.recordings) == {5}
    assert line.right.to_dict() == {"sensor_clock": 1, DELAY: 1, "unexplained": 0, BIAS: 0,
                                    "nothing": 0, "crash": 0}  # fmt: skip
    assert line.wrong.to_dict() == {"sensor_clock": 0, DELAY: 0, "unexplained": 1, BIAS: 1,
                                    "nothing": 1, "crash": 1}  # fmt: skip
    assert table.loc[("clean", "nothing"), "right"] == 1
    assert table.loc[("outside_cubic", "unexplained"), "right_share"] == 1.0


def study_of_everything():
    """Rows with every effect in each role; seed 1 decides what is found."""
    rng, rows = np.random.default_rng(1), [graded("clean", [], []) for _ in range(4)]
    for name in EFFECTS:
        kind = {"gauge": "gauge", "outside": "outside"}.get(name.split("_")[0], "one")
        for size in (4.0, 8.0, 50.0):
            named = name if rng.random() < 0.7 else str(rng.choice(CATALOGUE))
            rows.append(graded(kind, [name], [cause(named)], rng.random() < 0.2, size=size))
            if kind == "one":
                rows.append(graded("struck", [name], [], True, size=size))
    return rows


def test_figures_and_tables(tmp_path):
    given = {"rows": study_of_everything()}
    settings = {"scale": {"name": "quick"}, "seed": 1}
    draw, confusion = drawing.figure_blind_confusion(given, settings)
    axes = draw(confusion).axes[0]
    labels = [label.get_text() for label in axes.get_yticklabels()]
    struck = f"{drawing.STRUCK} ({3 * len(CATALOGUE)})"
    assert len(labels) == len(EFFECTS) + 2 and labels[-1] == struck
    cells = {(round(t.get_position()[0]), round(t.get_position()[1])) for t in axes.texts}
    assert len(cells) >= len(labels)
    paths = {kind: tmp_path / f"confusion.{kind}" for kind in ("pdf", "png", "csv")}
    write_figure(draw, confusion, **paths)
    assert all(path.stat().st_size > 1000 for path in paths.values())
    paths = {kind: tmp_path / f"bars.{kind}" for kind in ("csv", "tex", "md")}
    write_table("blind_bars", *drawing.table_blind_bars(given, settings), **paths)
    lines = [line for line in paths["md"].read_text().splitlines() if line.startswith("|")]
    assert {line.count("|") for line in lines} == {len(columns("blind_bars")) + 1}
    assert any("short by" in line for line in lines)
    paths["tex"].read_text().encode("latin-1")  # what LaTeX reads as it is


def test_config_names_matrices_that_exist():
    config = yaml.safe_load((ROOT / "config.yaml").read_text(encoding="utf-8"))
    for scale in config["scales"].values():
        assert scale["blind_batches"] <= len(matrix(scale["blind_cases"]))


def test_results_of_the_papers_do_not_depend_on_the_size_of_the_blind_study():
    config = yaml.safe_load((ROOT / "config.yaml").read_text(encoding="utf-8"))
    assert not any("blind" in key for key in effective(config, "quick")["scale"])


@pytest.mark.parametrize("which", ["0126-gyroscope_bias", "0306-position_shift"])
def test_a_weak_effect_of_all_imus_is_named_of_all(which):
    """No four of eight show the rest too small; each of them needs it hardly by itself."""
    (case,) = (c for c in matrix() if c.id == f"one-{which}+all-8sigma")
    (found,) = run_procedure(make(case, 20260101)[0]).search.causes
    assert (found.effect, len(found.imus)) == (which[5:], 8)


def test_an_effect_of_two_imus_that_all_might_share_is_named_of_the_two():
    (case,) = (c for c in matrix() if c.id.startswith("pair-0076-position_shift+two"))
    causes = run_procedure(make(case, 20260101)[0]).search.causes
    assert {c.effect: c.imus for c in causes}["position_shift"] == (0, 6)
