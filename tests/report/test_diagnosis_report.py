"""The report of a diagnosis: one page that stands alone, its figures, its words, its numbers."""

import base64
import json
from dataclasses import replace
from html.parser import HTMLParser
from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest
from scipy.linalg import subspace_angles

from imuarray.diagnosis.adoption import (
    conditional,
    orthonormal,
    separability,
    squared_correlations,
)
from imuarray.diagnosis.document import cause_in_words, diagnose
from imuarray.diagnosis.replicates import _beside
from imuarray.model.effects import DATA_EFFECTS, EFFECTS
from imuarray.report import drawings as drawn
from imuarray.report import numbers
from imuarray.report import write as report
from imuarray.report.answers import ANSWERS, verdict
from imuarray.report.panels import abscissa, binned, cause_table, signal_of
from imuarray.words import (
    equation,
    number,
    plus_minus,
    probability,
    quantity,
    ratio,
    span,
    split_name,
)
from imuarray.words.effects import sizes
from imuarray_papers.blind.cases import Case, make
from tests.browser import in_browser, needs_browser

PATH = "a folder/<script>alert(1)</script> & $x$_{.nc"
ALWAYS = {
    "discrepancies",
    "residual",
    "separability",
    "detectable",
    "positions",
    "board",
    "course",
    "timeline",
    "sphere",
}
VOID = {"meta", "img", "br", "link", "input", "hr", "wbr"}


@pytest.fixture(scope="module")
def found():
    """Gyroscope 3 scaled, 25 sigma, diagnosed."""
    case = Case("report", (("gyroscope_scale", (2,)),), 25.0, kind="one", duration=4.0)
    return diagnose(make(case, 3)[0], recording_path=PATH, replicates=19)


@pytest.fixture(scope="module")
def folder(found, tmp_path_factory):
    place = tmp_path_factory.mktemp("report") / "new"
    report.write_report(found, place)
    return place


@pytest.fixture(scope="module")
def page(folder):
    return (folder / "report.html").read_text(encoding="utf-8")


class Reader(HTMLParser):
    """Elements with their attributes, text, and tags that are not closed in order."""

    def __init__(self, text):
        super().__init__()
        self.open, self.wrong, self.seen, self.text = [], [], [], []
        self.feed(text)
        self.close()

    def handle_starttag(self, tag, attrs):
        self.seen.append((tag, dict(attrs)))
        if tag not in VOID:
            self.open.append(tag)

    def handle_endtag(self, tag):
        if not self.open or self.open.pop() != tag:
            self.wrong.append(tag)

    def handle_data(self, data):
        self.text.append(data)


def test_page_is_whole_and_stands_alone(page, found):
    read = Reader(page)
    assert page.startswith("<!DOCTYPE html>") and not read.wrong and not read.open
    tags = [tag for tag, _ in read.seen]
    assert tags.count("h1") == 1 and "script" not in tags and "link" not in tags
    assert "http://" not in page and "https://" not in page and "url(" not in page
    sources = [attributes["src"] for tag, attributes in read.seen if tag == "img"]
    assert len(sources) == len(ALWAYS) + 1 + len(found.found.search.causes)
    for source in sources:
        head, _, data = source.partition(",")
        assert head == "data:image/png;base64"
        assert base64.b64decode(data, validate=True).startswith(b"\x89PNG")
    assert all(attributes.get("alt") for tag, attributes in read.seen if tag == "img")
    ids = [attributes["id"] for _, attributes in read.seen if "id" in attributes]
    assert len(ids) == len(set(ids))
    table = [len([t for t in row.split("<td")]) for row in page.split("<tr")[1:] if "<td" in row]
    assert min(table) > 3


@needs_browser
def test_a_browser_shows_the_page(page, tmp_path):
    seen = in_browser(page, tmp_path)
    assert len(seen["widths"]) == page.count("<img ") and min(seen["widths"]) > 1000
    assert seen["fetched"] == [] and seen["wide"]


def answers(diagnosis):
    return [answer(diagnosis) for answer in ANSWERS.values()]


def test_page_answers_the_four_questions(page):
    text = "".join(Reader(page).text)
    for question in (
        "What does the simulation get wrong?", "Why?", "What does the extended model look like?",
        "What did it gain?",
    ):  # fmt: skip
        assert text.count(question) == 1
    assert "Gyroscope scale, IMU 3: " in text and "times the noise, and positions move by" in text
    assert "(1 + c_i) ω_i" in text and "nats" in text and "µm" in text
    assert "{" not in text.split("Diagnosis of", 2)[2].replace(PATH, "").split("Tables")[0]


def test_texts_of_a_recording_are_escaped(page, folder, found):
    assert "<script" not in page and "&lt;script&gt;alert(1)" in page
    assert PATH in "".join(Reader(page).text)
    assert json.loads((folder / "diagnosis.json").read_text())["recording"] == PATH
    odd = replace(found, document=found.document | {"causes": [
        found.document["causes"][0] | {"sensors": ["<b>3</b>"]}
    ]})  # fmt: skip
    assert "<b>3</b>" not in report.html(odd, [])


def test_files_are_complete(folder, found):
    names = {path.name for path in folder.iterdir()}
    expected = ALWAYS | {"gain", "cause_01_gyroscope_scale"}
    files = {f"{name}.{suffix}" for name in expected for suffix in ("pdf", "png", "csv")}
    assert names == files | {"report.html", "cal.nc", "diagnosis.json"}
    document = json.loads((folder / "diagnosis.json").read_text())
    assert document == json.loads(found.to_json())
    assert (folder / "residual.pdf").read_bytes().startswith(b"%PDF")
    last = folder / "diagnosis.json", folder / "report.html"
    others = [p.stat().st_mtime_ns for p in folder.iterdir() if p not in last]
    assert last[0].stat().st_mtime_ns >= last[1].stat().st_mtime_ns >= max(others)


def test_an_error_leaves_a_former_report_alone(folder, found, monkeypatch):
    before = {path.name: path.read_bytes() for path in folder.iterdir()}

    def fails(*_):
        raise RuntimeError

    monkeypatch.setattr(report, "draw", lambda *_: [])
    monkeypatch.setattr(report, "html", fails)
    with pytest.raises(RuntimeError):
        report.write_report(found, folder)
    assert {path.name: path.read_bytes() for path in folder.iterdir()} == before


def test_figures_of_a_former_report_go(found, tmp_path, monkeypatch):
    for name in ("cause_07_size_effect.png", "gain.csv", "mine.png"):
        (tmp_path / name).write_text("old")
    monkeypatch.setattr(report, "draw", lambda *_: [])
    monkeypatch.setattr(report, "html", lambda *_: "page")
    report.write_report(found, tmp_path)
    kept = {"mine.png", "report.html", "cal.nc", "diagnosis.json"}
    assert {path.name for path in tmp_path.iterdir()} == kept


def of(found, **changed):
    """A diagnosis with parts of its document changed."""
    return replace(found, document=found.document | changed)


def test_nothing_and_unexplained_are_said(found):
    nothing = of(found, causes=[], unexplained=False, remaining=[])
    assert verdict(nothing)[0].startswith("Nothing:")
    wrong, why, extended, gained, onward = answers(nothing)
    assert onward.lead == "The plain model is enough for this recording."
    assert wrong.lead.startswith("Nothing that this recording shows")
    assert "nothing to explain" in why.lead and "as it stands" in extended.lead
    assert gained.lead.startswith("Nothing")
    left = of(found, unexplained=True, remaining=["residual against omega dot", "outliers"])
    assert verdict(left)[-1] == "Unexplained: something is left that no known cause explains."
    loud = answers(left)[1].loud
    assert "no known cause explains" in loud and "dω/dt and outliers" in loud
    assert loud in report.html(left, []) and '<p class="loud">' in report.html(left, [])
    assert not answers(found)[1].loud
    alone = of(found, causes=[], unexplained=True, remaining=["outliers"])
    [said] = verdict(alone)
    assert said.startswith("Unexplained:") and "no known cause" in said
    smooth = {
        "unexplained": False,
        "accelerometer": {"residual": 0.8},
        "gyroscope": {"residual": 2},
    }
    shaken = of(found, unexplained=True, remaining=["outliers"], smooth=smooth)
    assert verdict(shaken)[-1].startswith("Smooth samples are explained")
    assert "In smooth samples that turn fast the residual is 0.8" in answers(shaken)[1].lead
    assert not any(answer.loud for answer in answers(shaken))
    assert "faster than the samples: outliers" in answers(shaken)[1].lead
    assert 'class="loud"' not in report.html(shaken, [])


def test_what_to_do_next_follows_from_what_was_found(found):
    assert "cal.nc" in answers(found)[4].items[0]
    cause = found.document["causes"][0]
    drifting = of(found, causes=[cause | {"effect": "bias_drift"}], reasons=["too slow"])
    first, use, *_ = answers(drifting)[4].items
    assert first == "Mend this first: too slow" and "Without bias drift" in use
    swapped = of(found, causes=[cause | {"effect": "axis_swap"}], unexplained=True)
    axes, unknown, again = answers(swapped)[4].items
    assert "columns.yaml" in axes and "effect of your own" in unknown and "second" in again


def test_the_verdict_says_what_it_is_worth(found):
    before, after = (numbers.in_noise_sds(m)["gyroscope"] for m in (found.base, found.extended))
    said = verdict(found)[-1]
    assert f"gyroscopes' residual falls from {ratio(before)} to {ratio(after)} times" in said
    assert quantity(found.document["gain"]["position_change_m"], None, "m") in said


def test_detectable_sizes_are_drawn_beside_what_was_found(found):
    table = numbers.detectable_table(found).set_index("effect")
    assert (table.best <= table.worst).all() and set(table.columns) >= {"unit", "typical"}
    assert np.isfinite(table.found.gyroscope_scale) and table.found.notna().sum() == 1
    assert table.found.gyroscope_scale > table.best.gyroscope_scale
    drawn.detectable_figure(table.reset_index()).draw_without_rendering()


def test_answers_hold_the_document_s_numbers(found):
    cause, gain = found.document["causes"][0], found.document["gain"]
    value = cause["parameters"]["x_3"]["value"]
    shown = answers(found)[1].items[0]
    assert number(round(1e6 * value, 1))[:4] in shown and "IMU 3" in shown
    lead = answers(found)[3].lead
    key = "over_inflated_noise_nats_per_sample"
    assert plus_minus(gain[key], gain[f"{key}_se"]) in lead
    largest = numbers.position_table(found).change.abs().max()
    assert number(1e6 * largest) in answers(found)[3].items[1]
    base = numbers.in_noise_sds(found.base)["gyroscope"]
    sd = found.document["base"]["residual_sd"]["angular_rate"]
    declared = found.base.fit.readings.declared[0, 1]
    assert base == pytest.approx(sd / declared, rel=1e-6)


@pytest.mark.parametrize(
    ("effect", "gain", "words"),
    [
        ("stale_samples", 5.0, ["Readings that are left out count in the nats"]),
        ("saturation", 5.0, ["Readings that are left out count in the nats"]),
        ("axis_swap", 5.0, ["Axes that are turned back count in all"]),
        ("axis_swap", 0.0, []),
        ("gyroscope_scale", 5.0, []),
    ],
)
def test_where_readings_count_is_said(found, effect, gain, words):
    cause = found.document["causes"][0] | {"effect": effect, "heldout_gain_nats": gain}
    said = answers(of(found, causes=[cause]))[3].items[2:]
    assert len(said) == len(words)
    assert all(text.startswith(start) for text, start in zip(said, words, strict=True))


def test_a_class_is_stated_as_one(found):
    cause = found.document["causes"][0] | {"indistinguishable_from": ["sensor_delay"]}
    assert "cannot be distinguished from sensor delay" in cause_in_words(cause, ("1", "2", "3"))
    said, _ = verdict(of(found, causes=[cause]))
    assert said.startswith("Gyroscope scale, IMU 3: ") and "sensor delay" not in said
    doubtful = cause | {"gain_in_sample_nats": 10.0, "placebo_gain_nats": 6.0}
    assert "doubtful" in cause_in_words(doubtful, ("3",))
    assert "doubtful" not in cause_in_words(cause, ("3",))


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        (plus_minus(0.13684, 0.0062), "0.1368 ± 0.0062"),
        (plus_minus(6315.8, 391.7), "6320 ± 390"),
        (plus_minus(-9.18e6, 5.2e5), "(−9.18 ± 0.52) · 10⁶"),
        (plus_minus(1.0, None), "1"),
        (quantity(0.01, 0.001, "rad s-1"), "10.0 ± 1.0 mrad/s (0.573 ± 0.057 deg/s)"),
        (quantity(-2e-6, 1e-7, "s"), "−2.00 ± 0.10 µs"),
        (quantity(1e-4, None, "rad s m-1"), "0.1 mrad/s per m/s² (0.0562 deg/s per g)"),
        (quantity(1e-5, None, "s2 m-1"), "10 ppm per m/s² (0.157 % at 16 g)"),
        (quantity(2.5e-4, 1e-5, "m"), "0.250 ± 0.010 mm"),
        (quantity(2.5e-5, 1e-6, "m"), "25.0 ± 1.0 µm"),
        (quantity(0.003, None, "rad"), "3 mrad (0.172 deg)"),
        (span(1.0, 1.0, "1"), "1"),
        (span(0.038, 0.041, "m s-2"), "38 to 41 mm/s²"),
        (probability(-103.9), "< 10⁻⁶"),
        (probability(-2.0), "0.01"),
        (number(0.0), "0"),
        (number(float("nan")), "not known"),
    ],
)
def test_numbers_as_people_read_them(text, expected):
    assert text.replace("\u00a0", " ") == expected


def test_every_effect_has_words():
    for effect, item in {**EFFECTS, **DATA_EFFECTS}.items():
        assert item.meaning and equation(effect) and "omega" not in equation(effect)
        parameters = {"x_a_b": {"value": 0.1, "sd": 0.01, "unit": "1"}}
        cause = {"effect": effect, "sensors": ["all"], "parameters": parameters}
        assert "0.1" in sizes(cause, ("b", "a_b")) or "10" in sizes(cause, ("b", "a_b"))
    assert split_name("x_a_b", ("b", "a_b")) == ("x", "a_b")
    # every unit of the catalogue can be shown
    for effect in EFFECTS.values():
        for unit in effect.unit.replace("|", ",").split(","):
            assert quantity(0.1, 0.01, unit.strip())


def test_sentences_follow_the_p_value():
    band = {"median": 1.0, "q025": 0.9, "q975": 1.1}
    assert _beside(1.3, band, 0.01).startswith("outside")
    assert _beside(1.0, band, 0.6) == "within the simulated 0.9 to 1.1"
    assert "in 20 % of simulations" in _beside(1.2, band, 0.2)
    parameters = {
        "share_gyroscope_1": {"value": 0.1, "sd": 0.0, "unit": "1"},
        "factor_gyroscope_1": {"value": 10.0, "sd": 0.0, "unit": "1"},
    }
    says = sizes({"effect": "heavy_tails", "parameters": parameters}, ("1",)).replace("\u00a0", " ")
    assert says == "share gyroscope 10 %, factor gyroscope 10"


def test_separability_is_that_of_subspaces():
    """Against principal angles of explicit signals."""
    signals = np.random.default_rng(1).standard_normal((40, 7))
    signals[:, 5] = signals[:, 0] + 0.3 * signals[:, 5]
    information, scale = signals.T @ signals, np.linalg.norm(signals, axis=0)
    sets = [np.array([0, 1, 2]), np.array([4, 5])]
    pairs = [(chosen, orthonormal(information, chosen, scale[chosen])) for chosen in sets]
    found = squared_correlations(information, *pairs)
    expected = np.cos(subspace_angles(signals[:, :3], signals[:, 4:6])) ** 2
    assert np.allclose(np.sort(found), np.sort(expected))


def test_positions_are_projected_out():
    """Against the residual of a regression on the positions' own signals."""
    signals = np.random.default_rng(3).standard_normal((30, 6))
    known, nothing = np.array([1, 4]), np.zeros(6)
    given = SimpleNamespace(information=signals.T @ signals, ridge=nothing)
    fitted = np.linalg.lstsq(signals[:, known], signals, rcond=None)[0]
    left = signals - signals[:, known] @ fitted
    assert np.allclose(conditional(given, known), left.T @ left)
    # a strong prior leaves them next to nothing to take
    given.ridge = nothing + 1e9
    assert np.allclose(conditional(given, known), given.information, rtol=1e-5)


def test_separability_of_effects(found):
    search = found.found.search
    pairs = separability(search.given, search.fit, [(c.effect, c.imus) for c in search.causes])
    place = {name: number for number, name in enumerate(dict.fromkeys(one for one, _ in pairs))}
    largest, mean = np.array(list(pairs.values())).T.reshape(2, len(place), len(place))
    for matrix in (largest, mean):
        assert np.allclose(matrix, matrix.T) and matrix.min() >= 0 and matrix.max() <= 1
        assert np.allclose(np.diag(matrix), 1.0)
        assert matrix[place["gyroscope_delay"], place["sensor_delay"]] > 0.98
        assert matrix[place["accelerometer_bias"], place["gyroscope_scale"]] < 0.1
    # a drift contains its constant; what only a scan sees is not there
    assert mean[place["bias_drift"], place["gyroscope_bias"]] > 0.999
    assert np.all(mean <= largest + 1e-12)
    assert "sensor_clock" not in place and "position_shift" not in place


def test_signal_is_what_the_model_without_the_cause_leaves(found):
    cause = found.found.search.causes[0]
    signal, bare = signal_of(found, cause), found.base.fit
    without = bare.residual * np.repeat(bare.readings.sd, 3, axis=1)
    seen = signal.total * np.repeat(signal.made.readings.sd, 3, axis=1)
    # their weights are not quite alike: one has the declared noise, one the noise as judged
    size = signal.explained[:, 2, 3:] * signal.made.readings.sd[2, 1]
    off = (seen - without)[:, 2, 3:]
    assert np.sqrt(np.mean(off**2)) < 0.06 * np.sqrt(np.mean(size**2))
    # the positions, refitted, leave nothing of it that they could take
    for imu, column in np.argwhere(signal.made.active & ~signal.mask):
        own = signal.made.whitened[:, imu, :, column]
        shared = np.sum(own * signal.explained[:, imu])
        assert abs(shared) < 1e-3 * np.linalg.norm(own) * np.linalg.norm(signal.explained)
    table = cause_table(found, cause)
    assert list(table.panel.unique()) == [0, 1, 2, 3]
    # slope of what is seen against angular rate: the scale error, less the motion's share
    part = table[table.panel == 1]
    slope = np.polyfit(part.x, part.y * (1e-3 if "10⁻³" in part.y_label.iloc[0] else 1), 1)[0]
    parameters = found.document["causes"][0]["parameters"]
    expected = parameters["x_3"]["value"]
    assert slope == pytest.approx(expected, rel=0.35)


def test_binned_means():
    rng = np.random.default_rng(2)
    x = rng.standard_normal(4000)
    total = 3 * x + 0.5 * rng.standard_normal(4000)
    total[:100] = np.nan
    found = binned(x, total, 3 * x, 0.5)
    assert 8 <= len(found) <= 14 and np.all(np.diff(found.x) > 0)
    assert np.allclose(found.model, 3 * found.x)
    pull = (found.y - found.model) / found.se
    assert 0.3 < np.sqrt(np.mean(pull**2)) < 2.0
    weights = (0.5 / found.se) ** 2
    assert weights.sum() == pytest.approx(3900)
    assert binned(np.ones(5), np.ones(5), np.ones(5), 1.0).empty


def test_tables_behind_the_figures(found):
    checks = numbers.discrepancy_table(found)
    assert len(checks) == 2 * len(found.base.discrepancies)
    row = checks[(checks.model == "base") & (checks.check == "residual")].iloc[0]
    item = next(d for d in found.base.discrepancies if d.check == f"{row.kind} residual")
    band = item.simulated
    expected = 3.92 * (item.statistic - band["median"]) / (band["q975"] - band["q025"])
    assert row.standardised == pytest.approx(expected, rel=1e-3) and row.limit > 2.5
    residual = numbers.residual_table(found)
    triad = residual[(residual.imu == "3") & (residual.kind == "gyroscope")].set_index(
        ["model", "axis"]
    )
    assert triad.rms["base", "all"] > triad.rms["extended", "all"] > 0.9
    gain = numbers.gain_table(found)
    assert list(gain.what)[:1] == ["gyroscope_scale"] and len(gain) == 3
    total = found.document["gain"]["heldout_log_score_nats_per_sample"]
    assert gain.gain.iloc[1] == pytest.approx(total * found.document["samples"])
    scores = numbers.score_table(found)
    assert scores.effect.iloc[0] == "gyroscope_scale" and scores.adopted.iloc[0]
    assert "1" not in set(numbers.position_table(found).imu)


@pytest.mark.parametrize(
    "name", [("size_effect", "xx"), ("gyroscope_g_sensitivity", "xz"), ("gyroscope_scale", "z")]
)
def test_labels_of_neighbouring_panels_do_not_meet(name):
    """Four panels abreast."""
    rows = [(0, "all readings it touches", "predicted (noise sds)", "seen without it (noise sds)")]
    rows += [
        (n, "accelerometer 8, y (yx)", abscissa(*name)[1], "deviation (10⁻³ deg/s)")
        for n in (1, 2, 3)
    ]
    frames = [
        pd.DataFrame(
            {"x": [-1300.0, 0, 1300], "y": [-40.0, 0, 40], "se": 1.0, "model": 0.0}
        ).assign(panel=panel, title=title, x_label=x_label, y_label=y_label, series="")
        for panel, title, x_label, y_label in rows
    ]
    figure = drawn.cause_figure(pd.concat(frames))
    figure.draw_without_rendering()
    for part in ("xaxis", "title"):
        boxes = [
            (axes.xaxis.label if part == "xaxis" else axes.title).get_window_extent()
            for axes in figure.axes
        ]
        for left, right in zip(boxes[:-1], boxes[1:], strict=True):
            assert left.x1 < right.x0
    edge = figure.get_window_extent()
    assert all(edge.x0 <= axes.get_tightbbox().x0 for axes in figure.axes)
    assert all(edge.x1 >= axes.get_tightbbox().x1 for axes in figure.axes)


def test_scales_of_wide_and_narrow_checks():
    """A band that a statistic leaves by thousands of its sds stays in sight."""
    rows = [
        {"model": model, "kind": kind, "check": "residual", "label": "size", "limit": 3.0,
         "standardised": value, "p_value": 0.01}
        for kind in ("accelerometer", "gyroscope")
        for model, value in (("base", 7000.0 if kind == "gyroscope" else -3.0), ("extended", 1.0))
    ]  # fmt: skip
    figure = drawn.discrepancy_figure(pd.DataFrame(rows))
    figure.draw_without_rendering()
    narrow, wide = figure.axes
    assert narrow.get_xscale() == "linear" and wide.get_xscale() == "symlog"
    assert wide.get_xlim()[1] > 7000 and wide.get_xlim()[0] < -3
    place = wide.transData.transform([[-3, 0], [3, 0]])[:, 0]
    assert np.diff(place)[0] > 0.1 * wide.get_window_extent().width
