"""Arrays: the board of both papers, and positions from configs and CSV files."""

from dataclasses import replace

import numpy as np
import pytest

from imuarray import simulate
from imuarray.errors import IdentifiabilityError, InputError
from imuarray.geometry import (
    UNDERSIDE_ROTATION,
    array_from_config,
    array_from_csv,
    mimu4444,
    mimu4444_corners,
)
from imuarray.geometry.array import require_planar_extent
from imuarray.geometry.boards import BOARDS

CORNERS = 1e-3 * np.array([[-9.45, 9.45], [-9.45, -9.45], [9.45, 9.45], [9.45, -9.45]])
SQUARE = [[0, 0, 0], [0.01, 0, 0], [0, 0.01, 0]]


def test_board_has_32_imus_and_starts_in_the_corner():
    board = mimu4444()
    assert (board.accelerometers, board.gyroscopes) == (32, 32)
    assert board.labels == tuple(str(k) for k in range(1, 33))
    np.testing.assert_allclose(board.positions[0], [-9.45e-3, 9.45e-3, 1e-3], atol=1e-12)


def test_board_is_a_grid_of_pairs():
    """16 places at 6.3 mm pitch; odd above, even 2 mm beneath, at the same x and y."""
    positions = mimu4444().positions
    top, bottom = positions[0::2], positions[1::2]
    np.testing.assert_array_equal(top[:, :2], bottom[:, :2])
    np.testing.assert_allclose(top[:, 2] - bottom[:, 2], 2e-3, atol=1e-15)
    for axis in (0, 1):
        steps = np.unique(np.round(positions[:, axis], 9))
        np.testing.assert_allclose(np.diff(steps), 6.3e-3, atol=1e-9)
        assert len(steps) == 4
    assert len({tuple(np.round(p, 9)) for p in positions}) == 32
    np.testing.assert_allclose(positions.mean(axis=0), 0, atol=1e-15)


def test_corner_board():
    board = mimu4444_corners()
    expected = [[x, y, z] for x, y in CORNERS for z in (1e-3, -1e-3)]
    np.testing.assert_allclose(board.positions, expected, atol=1e-12)
    whole = {tuple(np.round(p, 9)) for p in mimu4444().positions}
    assert {tuple(np.round(p, 9)) for p in board.positions} <= whole
    np.testing.assert_allclose(board.positions[0], mimu4444().positions[0], atol=1e-15)


def test_underside_rotation_is_half_a_turn_in_the_plane_of_the_board():
    R = UNDERSIDE_ROTATION
    np.testing.assert_array_equal(R @ R.T, np.eye(3))
    assert np.linalg.det(R) == pytest.approx(1.0)
    np.testing.assert_array_equal(R @ [1, -1, 0], [1, -1, 0])  # the axis y = -x
    np.testing.assert_array_equal(R @ [0, 0, 1], [0, 0, -1])  # what was up is down


def test_parameters_are_relative_to_the_first_triad():
    board = mimu4444()
    assert board.parameters.shape == (93,)
    np.testing.assert_array_equal(board.relative[0], 0)
    np.testing.assert_allclose(
        board.parameters.reshape(31, 3) + board.positions[0], board.positions[1:], atol=1e-15
    )


@pytest.mark.parametrize("count", [None, 1, 5])
def test_config_names_a_board(count):
    section = {"board": "mimu4444"} if count is None else {"board": "mimu4444", "gyroscopes": count}
    board = array_from_config(section)
    np.testing.assert_array_equal(board.positions, mimu4444().positions)
    assert board.gyroscopes == (32 if count is None else count)


def test_a_board_keeps_its_axes_in_a_configuration_and_a_simulated_recording(monkeypatch):
    turns = np.array([np.eye(3), UNDERSIDE_ROTATION] * 4)
    turned = replace(mimu4444_corners(), axes=turns)
    monkeypatch.setitem(BOARDS, "turned", lambda: turned)
    board = array_from_config({"board": "turned", "gyroscopes": 2})
    assert board.gyroscopes == 2
    recording, _ = simulate(board, duration=0.1)
    np.testing.assert_array_equal(recording.accelerometer_axes, turns)


def test_config_gives_positions():
    array = array_from_config({"positions": SQUARE, "gyroscopes": 1, "labels": ["a", "b", "c"]})
    assert (array.labels, array.gyroscopes) == (("a", "b", "c"), 1)
    np.testing.assert_array_equal(array.positions, SQUARE)
    assert array_from_config({"positions": SQUARE}).gyroscopes == 3


@pytest.mark.parametrize(
    ("section", "error"),
    [
        ({}, InputError),
        ({"board": "mimu9999"}, InputError),
        ({"positions": [[0, 0], [1, 0], [0, 1]]}, InputError),
        ({"positions": SQUARE, "labels": ["a", "a", "b"]}, InputError),
        ({"positions": SQUARE, "labels": ["a", "b"]}, InputError),
        ({"positions": SQUARE[:2]}, IdentifiabilityError),
        ({"positions": [[0, 0, 0], [1, 1, 1], [2, 2, 2], [3, 3, 3]]}, IdentifiabilityError),
        ({"positions": [[0, 0, 0]] * 3}, IdentifiabilityError),
        ({"positions": SQUARE, "gyroscopes": 0}, IdentifiabilityError),
        ({"board": "mimu4444", "gyroscopes": 0}, IdentifiabilityError),
        ({"positions": [[0, 0, 0], [0.01, 0, 0], [0, 0.01]]}, InputError),
        ({"positions": [[0, 0, 0], [0.01, 0, 0], [0, float("nan"), 0]]}, InputError),
    ],
)
def test_config_errors(section, error):
    with pytest.raises(error):
        array_from_config(section)


def test_csv_round_trip(tmp_path):
    path = tmp_path / "positions.csv"
    rows = [f"{x},{y},{z}" for x, y, z in mimu4444().positions.tolist()]
    lines = [f"{k + 1}, {row}" for k, row in enumerate(rows)]
    path.write_text("label,x,y,z\n" + "\n".join(lines) + "\n\n")
    array = array_from_csv(str(path), gyroscopes=4)
    np.testing.assert_array_equal(array.positions, mimu4444().positions)
    assert (array.labels, array.gyroscopes) == (mimu4444().labels, 4)
    np.testing.assert_array_equal(
        array_from_config({"file": str(path)}).positions, mimu4444().positions
    )


HEAD = "label,x,y,z\n1,0,0,0\n2,0.01,0,0\n"


@pytest.mark.parametrize(
    ("text", "error", "says"),
    [
        ("", InputError, "header"),
        ("x,y,z\n0,0,0\n", InputError, "header"),
        (HEAD + "3,0,0.01,zero\n", InputError, ":4:"),
        (HEAD + "3,0,nan,0\n", InputError, ":4:"),
        (HEAD + "3,0,0.01\n", InputError, ":4:"),
        (HEAD + "3,0,0.01,0,0\n", InputError, ":4:"),
        (HEAD + "2,0,0.01,0\n", InputError, "labels"),
        (HEAD, IdentifiabilityError, "at least 3"),
        (HEAD + "3,0.02,0,0\n", IdentifiabilityError, "collinear"),
    ],
)
def test_csv_errors(tmp_path, text, error, says):
    path = tmp_path / "positions.csv"
    path.write_text(text)
    with pytest.raises(error, match=says):
        array_from_csv(str(path))


def test_csv_that_cannot_be_read(tmp_path):
    with pytest.raises(InputError, match="readable"):
        array_from_csv(str(tmp_path / "none.csv"))
    (tmp_path / "binary.csv").write_bytes(b"\xff\xfe\x00\x81")
    with pytest.raises(InputError, match="readable"):
        array_from_csv(str(tmp_path / "binary.csv"))


def test_planar_extent_looks_at_the_shape_not_at_where_it_is():
    far = np.array(SQUARE) + 1.0
    require_planar_extent(far)
    with pytest.raises(IdentifiabilityError):
        require_planar_extent(np.linspace(0, 1, 4)[:, None] * [1.0, 2.0, 3.0] + 1.0)
