"""The map common to all gyroscopes: the one by which rates carry gravity from pose to pose.

No residual between gyroscopes shows it, but the rotation between two still poses does: integrated
rates have to turn gravity's direction in the first pose into that in the next one.
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.linalg import block_diag
from scipy.spatial.transform import Rotation

from imuarray.errors import InputError
from imuarray.firstorder.settings import SETTINGS
from imuarray.linear import diagonal_blocks

LOST = np.radians(10.0)  # median error of a move from which the rates are not what they say
NODE = np.sqrt(3) / 6


class Move(NamedTuple):
    """From pose ``first`` to the next: times (n,) s, rates (n, 3) rad/s, and its sd (rad)."""

    first: int
    time: np.ndarray
    rate: np.ndarray
    sd: np.ndarray

    @property
    def angle(self) -> float:
        """Length of the way, rad."""
        speed = np.linalg.norm(self.rate, axis=1)
        return float(np.sum(np.diff(self.time) * (speed[1:] + speed[:-1]) / 2))


@dataclass(frozen=True)
class CommonMap:
    """The angular rate is ``map @ turn @ mean`` of the gyroscopes.

    Attributes
    ----------
    map : (3, 3), near the identity
    covariance : (9, 9) of it, row by row
    turn : (3, 3), one of the 24 that map axes onto axes; the identity but for foreign axes
    first : (n,) index of the pose before each move that was used
    error : (n,) rad, between gravity carried and found, after the fit
    before : float, rad, the same before it, median
    weight : (n,) between 0 and 1
    score, information : (3 P,), (3 P, 3 P) of the poses' directions, the map eliminated
    beside : (3 P, 9), times the directions' covariance their covariance with the map
    """

    map: np.ndarray
    covariance: np.ndarray
    turn: np.ndarray
    first: np.ndarray
    error: np.ndarray
    before: float
    weight: np.ndarray
    score: np.ndarray
    information: np.ndarray
    beside: np.ndarray

    @property
    def scale(self) -> float:
        """Mean of the map's diagonal."""
        return float(np.trace(self.map)) / 3

    @property
    def scale_sd(self) -> float:
        """Its standard deviation."""
        diagonal = np.eye(3).ravel() / 3
        return float(np.sqrt(diagonal @ self.covariance @ diagonal))


def gather(rate, time, poses, offsets, good, noise_sd: float) -> list[Move]:
    """The moves between successive poses that can be integrated.

    Parameters
    ----------
    rate : (T, 3) rad/s, the gyroscopes' mean, ``offsets`` (P, 3) its mean in each pose
    time : (T,) s
    poses : slices
    good : (T,) bool, off the rails
    noise_sd : rad/s, of one reading of the mean
    """
    usual = np.median(np.diff(time))
    # how far an offset strays between poses, beside what its line between them follows
    stray = np.sqrt(np.mean(np.diff(offsets, axis=0) ** 2, axis=0)) / 2 if len(poses) > 1 else 0.0
    moves = []
    for p, (one, two) in enumerate(zip(poses[:-1], poses[1:], strict=True)):
        part = slice(one.stop - 1, two.start + 1)
        own, length = time[part], time[two.start] - time[one.stop - 1]
        if not good[part].all() or length > SETTINGS.longest_move or len(own) < 4:
            continue
        longest = max(SETTINGS.longest_gap, SETTINGS.move_bridged * usual)
        gap, (own, seen, bridged) = np.diff(own).max(), _bridged(own, rate[part], offsets[p], usual)
        if bridged > SETTINGS.most_bridged or gap > longest:
            continue
        middles = [(time[pose.start] + time[pose.stop - 1]) / 2 for pose in (one, two)]
        share = ((own - middles[0]) / (middles[1] - middles[0]))[:, None]
        bias = (1 - share) * offsets[p] + share * offsets[p + 1]
        sd = np.sqrt((stray * length) ** 2 + len(own) * (noise_sd * usual) ** 2)
        moves.append(Move(p, own, seen - bias, sd + bridged))
    return moves


def _bridged(time, rate, offset, usual):
    """Times and rates (n, 3) with straight lines over gaps, and the way (rad) along these."""
    steps = np.diff(time)
    far = np.flatnonzero(steps >= SETTINGS.move_bridged * usual)
    if not len(far):
        return time, rate, 0.0
    speed = np.linalg.norm(rate - offset, axis=1)
    way = (speed[far] + speed[far + 1]) / 2 * steps[far]
    more = [np.arange(time[k] + usual, time[k + 1] - usual / 2, usual) for k in far]
    every = np.sort(np.concatenate([time, *more]))
    return every, np.stack([np.interp(every, time, axis) for axis in rate.T], 1), float(way.sum())


def common_map(moves: list[Move], direction, covariance) -> CommonMap | str:
    """The map by robust least squares under a prior about the identity, or why there is none.

    Parameters
    ----------
    moves : of the mean rate in about the array's frame
    direction : (P, 3) unit vectors of specific force in all poses, ``covariance`` (3 P, 3 P)

    InputError where the rates carry gravity only if their sign or unit is another.
    """
    every, moves = moves, [move for move in moves if move.angle < SETTINGS.farthest_move]
    if len(moves) < SETTINGS.least_moves:
        if len(every) >= SETTINGS.least_moves:
            _require_unit(every, direction)
        return (
            f"{len(moves)} moves between still poses off the rails, {SETTINGS.least_moves} needed"
        )
    turn = np.eye(3)
    before = _typical(moves, direction, turn)
    if before > LOST:
        found = _other_axes(moves, direction)
        if found is None:
            return f"rates do not carry gravity from pose to pose ({np.degrees(before):.0f} deg)"
        turn = found
    moves = [move._replace(rate=move.rate @ turn.T) for move in moves]
    return _fit(moves, direction, covariance, turn, before)


def _typical(moves, direction, change) -> float:
    """Median angle (rad) between gravity carried and found, rates times ``change``."""
    errors = []
    for move in moves:
        carried = _to_end(move, change)[0].T @ direction[move.first]
        found = direction[move.first + 1]
        errors.append(np.arctan2(np.linalg.norm(np.cross(carried, found)), carried @ found))
    return float(np.median(errors))


def _require_unit(moves, direction) -> None:
    """InputError where the rates carry gravity once they are in the other unit."""
    degree = np.pi / 180
    for factor, words in (
        (1 / degree, "as large; are they in rad/s, declared deg/s?"),
        (degree, "smaller; are they in deg/s, declared rad/s?"),
    ):
        if _typical(moves, direction, factor * np.eye(3)) < LOST / 2:
            raise InputError(
                "gyroscopes: expected rates that carry gravity from pose to pose, found that they"
                f" had to be 57.3 times {words}"
            )


def _other_axes(moves, direction) -> np.ndarray | None:
    """A turn that maps axes onto axes and does what the identity did not; else the mistake."""
    _require_unit(moves, direction)
    turns = Rotation.create_group("O").as_matrix()
    errors = [_typical(moves, direction, turn) for turn in (*turns, *-turns)]
    best = int(np.argmin(errors))
    if errors[best] > LOST:
        return None
    if best < len(turns):
        return turns[best]
    axes = [name for name, sign in zip("xyz", np.diag(turns[best - 24]), strict=True) if sign > 0.5]
    asked = "is the board's frame left-handed, or are the rates of the opposite sign"
    if len(axes) == 1:
        asked = f"is the sign of {axes[0]} wrong in all of them"
    raise InputError(
        "gyroscopes: expected right-handed axes, found rates that carry gravity from pose to pose"
        f" only in a mirror image; {asked}?"
    )


def _to_end(move: Move, change) -> np.ndarray:
    """Rotations (n, 3, 3) of the array from each sample of the move to its end."""
    step = np.diff(move.time)
    spline = CubicSpline(move.time, move.rate @ change.T)
    # within the steps, to fourth order: Magnus' two nodes
    one, two = (spline(move.time[:-1] + (0.5 + s) * step) for s in (-NODE, NODE))
    step = step[:, None]
    vector = step / 2 * (one + two) + step**2 * NODE / 2 * np.cross(one, two)
    steps, width = Rotation.from_rotvec(vector).as_matrix(), 1
    while width < len(steps):  # products of 1, 2, 4, ... steps
        steps[:-width] = steps[:-width] @ steps[width:]
        width *= 2
    return np.concatenate([steps, np.eye(3)[None]])


def _carried(move: Move, change) -> tuple[np.ndarray, np.ndarray]:
    """The whole rotation, and derivatives (3, 9) of a small turn at its end in a map's entries."""
    turned = _to_end(move, change)
    middle, angle = (turned[1:] + turned[:-1]) / 2, move.rate[1:] + move.rate[:-1]
    angle = angle / 2 * np.diff(move.time)[:, None]
    return turned[0], np.einsum("tji,tk->jik", middle, angle).swapaxes(0, 1).reshape(3, 9)


def _linear(moves, direction, change):
    """Errors (2 n,), slopes in the map (2 n, 9) and in directions (2 n, 3 P), own (n, 2, 2)."""
    errors, slopes, own = [], [], []
    along = np.zeros((2 * len(moves), direction.size))
    for i, move in enumerate(moves):
        turned, slope = _carried(move, change)
        carried = turned.T @ direction[move.first]
        across = np.linalg.svd(carried[None])[2][1:]  # two directions across it
        errors.append(across @ (direction[move.first + 1] - carried))
        by_turn = np.cross(across, carried)
        slopes.append(by_turn @ slope)
        own.append(by_turn @ np.diag(move.sd**2) @ by_turn.T)
        rows, place = slice(2 * i, 2 * i + 2), 3 * move.first
        along[rows, place : place + 3] = -across @ turned.T
        along[rows, place + 3 : place + 6] = across
    return np.concatenate(errors), np.vstack(slopes), along, np.array(own)


def prior_precision() -> np.ndarray:
    """Precision (9, 9) of a map's entries, row by row, about the identity."""
    other = np.eye(9).reshape(3, 3, 3, 3).swapaxes(2, 3).reshape(9, 9)
    return (np.eye(9) + other) / (2 * SETTINGS.map_prior**2) + (np.eye(9) - other) / (
        2 * SETTINGS.turn_prior**2
    )


def _fit(moves, direction, covariance, turn, before) -> CommonMap:
    """Gauss-Newton; a move that a shock has spoilt counts less, by a t distribution's weights."""
    change, prior = np.eye(3), prior_precision()
    inflation, size = np.ones(len(moves)), 1.0
    # along a direction its covariance says nothing
    across = block_diag(*(np.eye(3) - direction[..., None] * direction[:, None]))
    for _ in range(SETTINGS.move_steps):
        errors, slopes, along, own = _linear(moves, direction, change)
        along = along @ across
        given = along @ covariance @ along.T
        total = given + block_diag(*(size * inflation[:, None, None] * own))
        solved = np.linalg.solve(total, slopes)
        normal = slopes.T @ solved + prior
        gradient = solved.T @ errors - prior @ (change - np.eye(3)).ravel()
        delta = np.linalg.solve(normal, gradient)
        change = change + delta.reshape(3, 3)
        # share of each move's variance that the map has left in its error
        rest = total - slopes @ np.linalg.solve(normal, slopes.T)
        shares = np.linalg.solve(*(diagonal_blocks(part, 2) for part in (total, rest)))
        free = np.clip(np.einsum("nii->n", shares) / 2, 0.05, 1.0)
        inflation, size = _weights(errors - slopes @ delta, given, own, size, free)
        if np.abs(delta).max() < SETTINGS.move_close:
            break
    left, spread = errors - slopes @ delta, np.linalg.inv(normal)
    score, beside = -along.T @ np.linalg.solve(total, left), along.T @ solved @ spread
    information = along.T @ np.linalg.solve(total, along) - beside @ normal @ beside.T
    left = left + along @ covariance @ score
    return CommonMap(
        change, spread, turn, np.array([move.first for move in moves]),
        np.linalg.norm(left.reshape(-1, 2), axis=1), before, 1 / inflation,
        score, information, beside,
    )  # fmt: skip


def _weights(left, given, own, size, free):
    """Inflation of each move's variance by its own error, and of all by the typical one."""
    left, blocks = left.reshape(-1, 2), diagonal_blocks(given, 2)

    def squares(size):
        solved = np.linalg.solve(blocks + size * own, left[..., None])[..., 0]
        return np.sum(left * solved, axis=1) / free

    for _ in range(5):
        # 1.386 is the median of a chi-squared variable with two degrees of freedom
        size = max(1.0, size * np.median(squares(size)) / 1.386)
    return np.maximum(
        (SETTINGS.move_freedom + squares(size)) / (SETTINGS.move_freedom + 2), 1.0
    ), size
