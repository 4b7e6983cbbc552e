"""`imuarray board`: from a log to positions and a page; what the page says, and that it renders."""

import errno
import re
from dataclasses import replace
from functools import partial
from pathlib import Path

import matplotlib
import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
import pytest
import xarray as xr
import yaml

import imuarray
from benchmarks.board import Options, draw_board, write
from imuarray.analysis.board import board
from imuarray.analysis.motion import _late, as_calibrated
from imuarray.cli import main
from imuarray.commands.board import lines_on
from imuarray.commands.positions import position_lines
from imuarray.engine.estimate import Recorded, estimate
from imuarray.engine.forward import EFFECT_GROUPS, GYROSCOPES, gains
from imuarray.engine.parameters import POSITION, columns_of
from imuarray.engine.readings import arrange
from imuarray.engine.widths import corrected
from imuarray.errors import InputError
from imuarray.pictures.board import missing
from imuarray.report.board import advice, facts, html, noises, turned, verdict, write_board
from imuarray.trust import of_file, of_first_order, reasons_of_calibration, reasons_of_motion
from imuarray.words import lags_apart, sentences
from tests.browser import in_browser, needs_browser

matplotlib.use("agg")
LATE = 0.003
FEW = Options(still=4.0, move=1.5, twisting=6.0, late=LATE)
FILES = {"report.html", "cal.nc", "positions.csv", "recording.nc"}


@pytest.fixture(scope="module")
def drawn():
    return draw_board(1, FEW)


@pytest.fixture(scope="module")
def folder(drawn, tmp_path_factory):
    """A log, and what `write_board` makes of it in `answer`."""
    folder = tmp_path_factory.mktemp("board")
    write(drawn.table(), drawn.columns(), folder)
    return folder


@pytest.fixture(scope="module")
def found(folder):
    """With the model given: the search for it has tests of its own, and takes its time."""
    with pytest.MonkeyPatch.context() as patch:
        given = partial(imuarray.calibrate, effects=["sensor_delay"])
        patch.setattr("imuarray.analysis.board.calibrate_sensors", given)
        answer = board([folder / "log.csv"], folder / "columns.yaml", 9.81)
    write_board(answer, folder / "answer")
    return answer


@pytest.fixture(scope="module")
def page(found, folder):
    return (folder / "answer" / "report.html").read_text(encoding="utf-8")


@pytest.fixture
def no_pictures(monkeypatch):
    monkeypatch.setattr("imuarray.report.board.pictured", lambda *_, **_more: [])


def words(page: str) -> str:
    return " ".join(re.sub("<style>.*?</style>|<[^>]*>", " ", page, flags=re.S).split())


def test_positions_are_those_of_the_board(found, folder, drawn):
    table = pd.read_csv(folder / "answer" / "positions.csv", dtype={"imu": str})
    assert list(table.imu) == drawn.labels and not found.reasons
    values = table[["x_m", "y_m", "z_m"]].to_numpy()
    sds = table[["sd_x_m", "sd_y_m", "sd_z_m"]].to_numpy()[1:]
    error = (values - drawn.truth.positions)[1:]
    assert np.sqrt(np.mean((error / sds) ** 2)) < 2 and np.sqrt(np.mean(error**2)) < 40e-6


def test_the_folder_has_what_other_commands_read(found, folder):
    answer = folder / "answer"
    assert {path.name for path in answer.iterdir()} == FILES
    calibration = imuarray.read_calibration(answer / "cal.nc")
    np.testing.assert_array_equal(calibration["position"], found.calibration["position"])
    assert calibration.attrs["trusted"] == 1
    assert imuarray.read_recording(answer / "recording.nc").stationary.any()


def test_the_page_says_whose_delay_it_is(page):
    text = words(page)
    number = re.search(r"IMU 4 is read ([\d.]+)\s±\s([\d.]+) ms late", text)
    value, sd = map(float, number.groups())
    assert abs(value - 1e3 * LATE) < 4 * sd and sd < 0.05
    assert "IMU 3 is read" not in text and "Not to be trusted" not in text


def test_an_answer_not_to_be_trusted_says_so_first(
    found, tmp_path, monkeypatch, capsys, no_pictures
):
    odd = found._replace(reasons=["gyroscopes <b>2 %</b> too large?"], source="<i>log</i>")
    monkeypatch.setattr("imuarray.commands.board.answered", lambda *_: odd)
    status = main(["board", __file__, "--out", str(tmp_path / "new" / "answer"), "--quiet"])
    assert status == 3 and "not to be trusted: gyroscopes" in capsys.readouterr().err
    page = (tmp_path / "new" / "answer" / "report.html").read_text(encoding="utf-8")
    assert page.index("Not to be trusted: gyroscopes") < page.index("What to do next")
    assert "<b>2 %" not in page and "<i>log" not in page and "imuarray diagnose" in page
    assert imuarray.read_calibration(tmp_path / "new/answer/cal.nc").attrs["trusted"] == 0


def test_a_terminal_has_the_answer_first_in_few_lines(found):
    lines = lines_on(found, Path("answer"))
    assert lines[0].startswith("The positions of 4 IMUs are known to") and len(lines) <= 15
    assert any(re.match(r"IMU 4 is read [\d.]+\s±\s[\d.]+ ms late", line) for line in lines)
    assert "imuarray apply answer/cal.nc answer/recording.nc" in "".join(lines)
    assert lines[-1] == "Page: answer/report.html"
    odd = lines_on(found._replace(reasons=["odd"]), Path("answer"))
    assert odd[0].startswith("If the answer could be trusted") and "is read" not in "".join(odd)


def test_a_log_that_says_little_says_that_first(found):
    surely = replace(found.corrected, position_prior_sd=1e-6)
    reasons = reasons_of_calibration(surely, found.calibration, ["no still poses"])
    assert "says little of the positions" in reasons[0] and reasons[1] == "no still poses"


def test_a_unit_is_the_first_reason_and_the_first_step(found):
    """Whatever else follows from it: sds that exceed the drawing's, advice on the motion found."""
    metres = replace(
        found.corrected, position_prior_sd=1e-6,
        accelerometer_position=1e3 * found.corrected.accelerometer_position,
    )  # fmt: skip
    unknown = found.calibration.assign_attrs(converged=0)
    reasons = reasons_of_calibration(metres, unknown, ["no still poses"])
    assert "in mm declared m" in reasons[0] and reasons[1:] == ["no still poses"]
    slow = found.calibration.copy()
    slow["angular_rate"] = 0.1 * slow["angular_rate"]
    assert "Twist it harder" in "".join(advice(found._replace(calibration=slow)))
    steps = advice(found._replace(calibration=slow, reasons=reasons))
    assert "in mm declared m" in steps[0] and "Twist" not in "".join(steps)


def test_without_still_poses_the_page_says_what_is_missing(found, no_pictures):
    odd = found._replace(first_order="recording: expected still poses, found none")
    page = words(html(odd._replace(account=["IMU 2: turned by 162.1 +- 0.1 degrees"])))
    assert "IMU 2: turned by 162.1 ± 0.1 degrees." in page
    assert "Record again with still poses" in page and "found none" in page
    assert "How each sensor is turned" not in page


def test_an_accelerometer_with_other_axes_than_declared_is_told_from_its_gyroscope(found):
    matrix = found.first_order.triads.matrix.copy()
    matrix[1] = matrix[1] @ np.diag([-1.0, -1.0, 1.0])
    odd = found.first_order
    odd = found._replace(first_order=replace(odd, triads=replace(odd.triads, matrix=matrix)))
    (said,) = turned(odd)
    assert re.match(r"Accelerometer 2 is turned by 1(79|80)\.\d degrees .*gyroscope 2 is not", said)
    assert said in lines_on(odd, Path()) and "Nothing speaks" not in verdict(odd)
    assert turned(found) == [] and "Nothing speaks" in verdict(found)


def test_sds_have_a_unit_that_fits_and_the_frame_its_cost(found, page):
    wide = found.calibration.copy()
    wide["position_covariance"] = 1e6 * wide["position_covariance"]
    lines = position_lines(wide)
    assert "(sd mm)" in lines[0] and "e+" not in "".join(lines)
    assert "(sd um)" in position_lines(found.calibration)[0]
    far = np.linalg.norm(found.calibration["position"], axis=1).max()
    size = re.search(r"not the board\S+s edges: .* away by ([\d.]+)\sµm", words(page)).group(1)
    assert float(size) == pytest.approx(1e6 * np.radians(0.1) * far, rel=0.05)


def test_a_log_of_one_row_is_refused(folder, tmp_path):
    rows = (folder / "log.csv").read_text(encoding="utf-8").splitlines(keepends=True)
    (tmp_path / "log.csv").write_text("".join(rows[:2]), encoding="utf-8")
    with pytest.raises(InputError, match="^log.csv: expected at least 3 samples, found 1"):
        board([tmp_path / "log.csv"], folder / "columns.yaml", 9.81)


def test_the_motion_says_by_how_much_it_is_late(found):
    """One IMU is late: the mean of all is late by its share."""
    motion = imuarray.apply(found.calibration, found.corrected)
    count = found.calibration.sizes["accelerometer"]
    assert motion.attrs["late_s"] == pytest.approx(LATE / count, rel=0.05)


def test_the_noise_of_logs_of_their_own_is_each_one_s(found):
    count = found.calibration.sizes["accelerometer"]
    mine = np.arange(1.0, 2 * count + 1).reshape(count, 2)
    own = xr.Dataset({"interpolated_noise": (("imu", "kind"), mine)})
    table = noises(found._replace(recording=replace(found.recording, alignment=own)))
    assert table.declared.tolist() == mine.T.ravel().tolist()
    plain = noises(found).set_index("sensor").declared
    assert set(plain["gyroscope"]) == {found.recording.gyroscope_noise_sd}


def test_by_clocks_of_their_own_as_well(found):
    """A clock's offset is an age: it is what a delay is, of the other sign."""
    own = found.calibration
    names = [
        str(name).replace("sensor_delay delay", "sensor_clock offset")
        for name in own.parameter.to_numpy()
    ]
    clocks = own.assign(effect_parameter=-own.effect_parameter).assign_coords(parameter=names)
    assert _late(clocks) == _late(own) != 0.0


def test_a_log_as_read_is_corrected_as_the_calibration_s_was(found):
    raw, corrected = found.recording, found.corrected
    mine = as_calibrated(raw, found.calibration)
    np.testing.assert_array_equal(mine.specific_force, corrected.specific_force)
    np.testing.assert_array_equal(mine.angular_rate, corrected.angular_rate)
    assert as_calibrated(corrected, found.calibration) is corrected
    motions = [imuarray.apply(found.calibration, one).angular_rate for one in (raw, corrected)]
    assert np.abs(motions[0] - motions[1]).max() < 0.1 * raw.gyroscope_noise_sd
    said = reasons_of_motion(mine, found.calibration, as_read=True)
    assert any("offsets that have changed" in reason for reason in said)
    swapped = found.calibration.assign_attrs(corrected_readings="axis_swap")
    with pytest.raises(InputError, match="the right axes, found axis_swap"):
        imuarray.apply(swapped, raw)


def test_offsets_that_corrections_left_are_each_recording_s_own(found):
    moving = np.flatnonzero(~found.corrected.stationary)
    parts = [found.corrected.select(part) for part in np.array_split(moving, 2)]
    readings = [arrange(one, sparse=True) for one in parts]
    names = dict.fromkeys([*EFFECT_GROUPS[GYROSCOPES], *corrected(readings[0].left)])
    columns = columns_of(readings[0].array, names, readings[0].position_prior_sd)
    begun = [Recorded.of(one, columns) for one in readings]
    both = estimate(begun, columns, columns.mask([POSITION]), steps=3)
    masks = {group: columns.mask(EFFECT_GROUPS[group]) for group in ("offsets", GYROSCOPES)}
    assert [group.name for group in gains(both, masks, {})] == ["offsets", GYROSCOPES]


def test_a_corrected_recording_is_for_calibrate(folder, tmp_path):
    with pytest.raises(InputError, match="found one that is corrected: imuarray calibrate"):
        board([folder / "answer" / "recording.nc"])


def test_the_input_is_not_written_over(folder, capsys):
    inputs = [str(folder / "answer" / "recording.nc"), "--out", str(folder / "answer")]
    assert main(["board", *inputs]) == 2
    assert "expected a folder without the input recording.nc" in capsys.readouterr().err


def test_a_selection_has_what_first_order_found(found, folder, tmp_path):
    read, few = folder / "answer" / "recording.nc", tmp_path / "few.nc"
    assert main(["select", str(read), "--samples", "100", "--out", str(few), "--quiet"]) == 0
    assert of_file(few) == of_file(read) == of_first_order(found.first_order)


def test_a_gyroscope_in_another_imu_s_place_is_refused(folder, tmp_path):
    layout = yaml.safe_load((folder / "columns.yaml").read_text(encoding="utf-8"))
    first = next(iter(layout["gyroscopes"]["triads"]))
    layout["gyroscopes"]["triads"].pop(first)
    (tmp_path / "columns.yaml").write_text(yaml.safe_dump(layout))
    with pytest.raises(InputError, match="IMUs without one last, found .* as number 1"):
        imuarray.open_logs(folder / "log.csv", tmp_path / "columns.yaml")


def test_an_error_leaves_the_folder_as_it_was(found, tmp_path, monkeypatch, no_pictures):
    (tmp_path / "report.html").write_text("mine")

    def fails(*_):
        raise OSError(errno.ENOSPC, "full", "a folder made meanwhile")

    monkeypatch.setattr("imuarray.report.board.write_csv", fails)
    with pytest.raises(OSError) as error:
        write_board(found, tmp_path)
    assert error.value.filename == str(tmp_path)
    with pytest.raises(OSError):
        write_board(found, tmp_path / "new")
    assert [path.name for path in tmp_path.iterdir()] == ["report.html"]
    assert (tmp_path / "report.html").read_text() == "mine"


def test_the_pictures_are_embedded_and_small(page):
    ids = re.findall(r'<figure id="(\w+)">\s*<img src="data:image/png;base64,', page)
    assert ids == ["board", "timeline", "sphere", "length", "course"]
    assert len(page) < 3e6 and "http" not in page and "url(" not in page and "<script" not in page


@needs_browser
def test_a_browser_shows_the_page(page, tmp_path):
    seen = in_browser(page, tmp_path)
    assert len(seen["widths"]) == 5 and min(seen["widths"]) > 1000 and seen["tall"] > 2000
    assert seen["fetched"] == [] and seen["wide"]


def test_pictures_for_a_notebook(found):
    """The page's own drawings, into axes of one's own."""
    plots, seen = imuarray.plots, found.calibration
    titles = [plots.board(seen, plane).get_title() for plane in ("xy", "yz")]
    assert all(re.match(r"departures × \d+, ellipses", title) for title in titles)
    axes = plots.timeline(found.corrected, seen)
    assert "still poses" in [label.get_text() for label in axes.get_yticklabels()]
    assert plots.sphere(found.corrected, seen).get_aspect() == 1.0
    curve = plots.length(seen).lines[1].get_ydata()  # µm, rms
    assert np.all(np.diff(curve) < 1e-9) and curve[0] > 5 * curve[-1]
    sds = np.sqrt(np.einsum("kaka->ka", seen["position_covariance"].to_numpy()))[1:]
    assert curve[-1] == pytest.approx(1e6 * np.sqrt(np.mean(sds**2)), rel=0.01)
    assert plots.residual_course(seen, "gyroscope").get_title() == "gyroscopes"
    usual = np.median(seen["accelerometer_residual"])
    assert usual == pytest.approx(1.0, abs=0.2)
    with pytest.raises(imuarray.InputError, match="plane"):
        plots.board(seen, "zz")
    plt.close("all")


def test_what_limits_is_said_and_shocks_are_not_misfit(found, no_pictures):
    level, rough = found.calibration.copy(deep=True), found.calibration.copy()
    level["position_sd_by_length"][:] = level["position_sd_by_length"][-1].to_numpy()
    assert [len(imuarray.plots.length(seen).lines) for seen in (rough, level)] == [3, 2]
    page = words(html(found._replace(calibration=level)))
    assert "More motion of this kind gains little" in page
    plt.close("all")
    rough.attrs["residual_ratio"] = 11.0
    assert "imuarray diagnose" in words(html(found._replace(calibration=rough)))
    for kind in ("accelerometer", "gyroscope"):
        rough[f"{kind}_smooth_residual"] = (kind,), np.array([0.9, 0.9, 0.9, 2.0])
    quiet = rough.assign_attrs(residual_ratio=0.91)
    assert "shocks" not in facts(found._replace(calibration=quiet))
    page = words(html(found._replace(calibration=rough)))
    assert (
        "residual is 0.90 times the noise of the still poses where the motion is smooth (11 times"
        in page
    )
    assert "imuarray diagnose" not in page


def test_what_has_not_been_excited_is_named(found):
    assert missing(found.corrected, found.calibration) == []
    seen = found.corrected
    upper = seen.stationary & (np.median(seen.specific_force, axis=1)[:, 2] > -2)
    flat = found.calibration.copy()
    flat["angular_rate"] = flat["angular_rate"] * [1.0, 1.0, 0.1]
    said = missing(replace(seen, stationary=upper), flat)
    assert re.match(r"no still pose within \d+ degrees of \S+", said[0])
    assert said[1].startswith("hardly any turning about +z: ") or "about −z" in said[1]


def sizes(rows, components=("value",), sd=1e-6):
    """Parameters of IMUs 1, 2, ..., a row each, of one sd, and the IMUs' labels."""
    found = {
        f"{name}_{k}": (value, sd)
        for k, row in enumerate(rows, 1) for name, value in zip(components, row, strict=True)
    }  # fmt: skip
    return found, [str(k + 1) for k in range(len(rows))]


def test_a_lag_within_two_sds_is_none():
    (none,) = sentences("gyroscope_delay", *sizes([[1.4e-5]] * 3, sd=1.7e-5))
    assert none.startswith("no lag seen") and "0.017 ms" in none
    (some,) = sentences("gyroscope_delay", *sizes([[1.4e-5]] * 3, sd=1e-6))
    assert "run ahead of" in some
    alone = {f"delay_{k}": (-6e-3 * (k == 2), 3e-6 * (k == 2)) for k in range(4)}
    (lone,) = sentences("gyroscope_delay", alone, "0123")
    assert lone.startswith("gyroscope 2 is 6.0000")


def test_an_imu_that_is_late_lags_in_both_of_its_sensors():
    """Beside lags of each accelerometer, all are behind the motion."""
    lags, both = [[7.5e-4]] * 3 + [[-2.25e-3]], ("lag", "delay")
    one, two = (sizes(lags, (name,), sd=1e-5) for name in both)
    labels = one[1]
    found, (said,) = lags_apart({"accelerometer_filter": one[0], "gyroscope_delay": two[0]}, labels)
    assert said.startswith("IMU 4 is read 3.00") and "ms late" in said
    (own,) = sentences("gyroscope_delay", found["gyroscope_delay"], labels)
    assert own.startswith("no lag seen")
    two = sizes([[7.5e-4]] * 4, ("delay",), sd=1e-5)  # its gyroscope is not
    found, (said,) = lags_apart({"accelerometer_filter": one[0], "gyroscope_delay": two[0]}, labels)
    assert said.startswith("accelerometer 4 is read 3.00")
    _, own = sentences("gyroscope_delay", found["gyroscope_delay"], labels)
    assert own.startswith("gyroscope 4 is 3.00")
    lone = {"delay_1": (7.5e-4, 1e-5)}  # one gyroscope for all
    found, (said,) = lags_apart({"accelerometer_filter": one[0], "gyroscope_delay": lone}, labels)
    assert said.startswith("accelerometer 4 is read 3.00")
    assert found["gyroscope_delay"].keys() == lone.keys()
    assert lags_apart({"gyroscope_delay": two[0]}, labels) == ({"gyroscope_delay": two[0]}, [])


def test_filters_are_said_by_what_they_take_of_motion():
    given = sizes([[1e-5, 0], [1e-5, 0], [3e-5, 0]], ("droop", "skew"), sd=1e-6)
    all_of_them, one = sentences("gyroscope_filter", *given)
    assert all_of_them.startswith("of motion at 5 Hz the gyroscopes show 0.987")
    assert "gyroscope 3 shows 1.97" in one and "less than the others" in one
    lone = [[1e-3, 0, 0], [1e-3, 0, 0], [-2e-3, 1e-5, 0]]
    (said,) = sentences("accelerometer_filter", *sizes(lone, ("lag", "droop", "skew"), sd=1e-7))
    assert "accelerometer 3 shows 0.8389" in said


def test_plain_words_hold_one_against_the_others():
    said = sentences("sensor_delay", *sizes([[0.5e-3], [0.5e-3], [-1.0e-3]]))
    assert len(said) == 1 and re.match(r"IMU 3 is read 1.5000\s±\s0.0015 ms late", said[0])
    assert "IMU 2 is read" in sentences("sensor_delay", *sizes([[1e-3], [-1e-3]]))[0]
    many = sentences("sensor_delay", *sizes([[-2e-4], [1e-4], [3e-4], [-1e-4], [-1e-4]]))
    assert many == [
        "the IMUs are read at instants of their own, from 0.2 ms late to 0.3 ms early against"
        " their mean"
    ]
    names = ("period", "frequency", "phase", "offset", "drift")
    clocks = [[0, 0, 0, 0, 0], [0, 0, 0, 0, 0], [0, 0, 0, 2e-3, 0], [1e-3, 1.5, 0.2, 0, 0]]
    said = sentences("sensor_clock", *sizes(clocks, names))
    assert re.match(r"IMU 4 samples on a clock of its own: a reading is up to 1\sms old", said[0])
    assert re.match(r"IMU 3 is read 2.0000\s±\s0.0010 ms late", said[1]) and len(said) == 2
    # reading = (1 + M) rate: a turn about z by 0.6 degrees
    turn = np.radians(0.6)
    rows = np.zeros((4, 6))
    rows[2, [0, 2]] = -turn, turn
    names = ("xy", "xz", "yx", "yz", "zx", "zy")
    said = sentences("gyroscope_misalignment", *sizes(rows, names, 1e-5))
    assert re.match(r"gyroscope 3 is turned by 0.600\d*\s±\s0.000\d+ degrees", said[0])
    said = sentences("gyroscope_scale", *sizes([[0, 0, 0], [0, 0, 0], [0.01] * 3], "xyz", 1e-5))
    assert said[0].startswith("gyroscope 3 shows 1.000") and len(said) == 1
