"""Effects: what real triads add to the papers' model, each in one place.

An effect of the mean names its parameters' shape, unit and prior scale, and turns a predicted
measurement into another one: simulation, both estimators and the likelihood call
`ArrayModel.predict`, and derivatives come from autodiff. What a diagnosis must know of it beside
that (its words, its gauge, what contains it, what only a scan finds) are fields of the same
`Effect`. The package's are in `imuarray.model.catalogue` and `imuarray.model.timing`;
`docs/effects.md` adds one.
"""

import traceback
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

import numpy as np

from imuarray.errors import InputError, require
from imuarray.motion.state import Motion
from imuarray.provenance import add_code, code_version, digest

_READ: dict[str, tuple[str, tuple[str, ...]]] = {}  # by path: digest of the text, and its ids


class Prediction(NamedTuple):
    """Noise-free measurement of the whole array at one instant."""

    specific_force: object  # (A, 3) m/s^2
    angular_rate: object  # (G, 3) rad/s


class Turning(NamedTuple):
    """Turning as one kind of sensor sees it, its filter between: each (3,)."""

    rate: object  # rad/s
    acceleration: object  # rad/s^2
    jerk: object  # rad/s^3, or None where it is not told apart


class Slow(NamedTuple):
    """The ideal measurement's time derivatives of second and third order, less their fast noise."""

    second: Prediction
    third: Prediction


class Instant(NamedTuple):
    """The truth an effect may look at: the motion, where the triads are and what time it is.

    ``second`` and ``third`` are the ideal measurement's time derivatives of those orders, zero
    where they are not known (only a recording's smooth motion determines them). Where it is rough,
    the gyroscopes' filters may pass another turning than the accelerometers' do.
    """

    motion: Motion
    positions: object  # (A, 3) m
    time: object = 0.0  # s since the recording began
    span: object = 1.0  # s, the recording's length
    second: Prediction = Prediction(0.0, 0.0)
    third: Prediction = Prediction(0.0, 0.0)
    gyroscopes: Turning | None = None  # as they see the motion, where that is free
    slow: Slow | None = None  # where the motion's course is smooth
    axes: object = None  # rotations from the accelerometers' own axes to the array's, (A, 3, 3)
    clock_deviation: object = 0.0  # turns by which clocks depart from a steady drift, (N,)


@dataclass(frozen=True)
class Effect:
    """A named cause by which real readings depart from the papers' model.

    Attributes
    ----------
    unit : str
        Of its parameters, in SI as files have it; `imuarray.model.array_model.unit_of` for several.
    prior_sd : float, or nested tuples that broadcast to ``shape``
        Prior standard deviation of each parameter around zero, in ``unit``.
    shape : callable (A, G) -> tuple
        Shape of its parameters for A accelerometer and G gyroscope triads.
        The first axis counts the triads, each of which its own row alone concerns.
    apply : callable (parameters, Instant, Prediction) -> Prediction
        The forward function; its docstring's first line is the equation that reports print.
    derivatives : bool
        Whether it needs omega double dot and s dot (12-column H instead of 6).
    sensors : str
        Whose reading it changes: accelerometer, gyroscope or imu (both).
    sampling : bool
        Whether it says when or where a triad samples: that comes before the triad's own errors.
    components : tuple of tuples of str
        Names of a triad's parameters along each axis after the first, joined by underscores; of
        a scalar, its one name. By default axes (x, xy), or numbers.
    gauge : callable (shape, axes) -> list of arrays, or None
        Sets of parameters (bool, or weights) whose mean the motion or the positions take up:
        `common_mean`, ...; ``axes`` (A, 3, 3) as in `Instant`.
    meaning : str
        What it is, in the words of one who holds the board.
    shown : str
        What parameters of unit 1 are shown in: %, rad or, by default, bare.
    against : str
        What a diagnosis draws it against: "specific force", "angular rate", "reading" (its own),
        "lever arm", "time", "angular acceleration", "age", "place"; by default what each parameter
        multiplies.
    contains : tuple of str
        Effects that are a part of it: adopted, it takes their place.
    resembles : tuple of str
        Effects that it can stand for without containing them.
    forms : tuple of (str, callable (place) -> bool)
        Forms that it is tested in, and which of a triad's parameters (their indices) each frees.
    scanned : bool
        Whether a score at zero cannot see it: an instant or a frequency is to be found first.
    held, held_rough : tuple of int
        Entries of the last axis that a scan fixes; those that are fixed too where the motion is
        rough and the gyroscopes' angular acceleration is free.
    critical : float or None
        log p from which it is believed, where its test has another tail than all others' tests.
    kind : str
        "mean", or where it is: in the "readings" themselves, in the "noise" (no parameters then).
    remedy : str
        What the extended model does about it, if it is no part of the mean.
    left_out : bool
        Whether that is leaving readings out.
    resizes : bool
        Whether the array's size takes its gauge up: then it matters what the mean is.
    own : bool
        Whether it is a recording's own, not the board's: recordings fitted jointly each have it.
    sized : bool
        Whether an estimate finds its size, ``prior_sd`` at first: the data would not keep what
        the motion takes up of it from being as large as a prior for any sensor allows.
    common_sd : float, or one for each as for ``prior_sd``
        Prior sd of what a parameter of all triads has in common, beside each one's own: chips of
        one kind are alike. How much they differ, ``prior_sd`` at first, an estimate finds.
    smooth : bool
        Whether only smooth motion tells it: where it is rough, all that gyroscopes see is free.
    beside : str
        The effect beside which alone a diagnosis tests it, being what that leaves; "": any.
    """

    id: str
    unit: str = "1"
    prior_sd: float | tuple = 1.0
    shape: Callable[[int, int], tuple[int, ...]] | None = None
    apply: Callable[[object, Instant, Prediction], Prediction] | None = None
    derivatives: bool = False
    sensors: str = "imu"
    sampling: bool = False
    components: tuple[tuple[str, ...], ...] = ()
    gauge: Callable[[tuple[int, ...], np.ndarray], list] | None = None
    meaning: str = ""
    shown: str = ""
    against: str = ""
    contains: tuple[str, ...] = ()
    resembles: tuple[str, ...] = ()
    forms: tuple[tuple[str, Callable[[tuple[int, ...]], bool]], ...] = ()
    scanned: bool = False
    held: tuple[int, ...] = ()
    held_rough: tuple[int, ...] = ()
    critical: float | None = None
    kind: str = "mean"
    remedy: str = ""
    left_out: bool = False
    resizes: bool = False
    own: bool = False
    sized: bool = False
    common_sd: float | tuple = 0.0
    smooth: bool = False
    beside: str = ""

    @property
    def scope(self) -> str:
        """Owner of its parameters, as files have it: the "recording", or the "imu"."""
        return "recording" if self.own else "imu"

    @property
    def shifts_time(self) -> bool:
        """True where it says when a triad samples: its first parameter is a time."""
        return self.sampling and self.unit.split(",")[0] == "s"

    @property
    def kinds(self) -> list[int]:
        """Numbers of the `KINDS` that it changes the readings of."""
        return [0, 1] if self.sensors == "imu" else [KINDS.index(self.sensors)]


AGAINST = (
    "", "specific force", "angular rate", "reading", "lever arm", "time", "angular acceleration",
    "age", "place",
)  # fmt: skip
EFFECTS: dict[str, Effect] = {}  # of the mean: a model can have them
DATA_EFFECTS: dict[str, Effect] = {}  # of the readings themselves, and of their noise
KINDS = ("accelerometer", "gyroscope")


def effect(id, *, unit, prior_sd, shape, sensors=None, **fields):
    """Register the decorated function as the effect ``id``; ``fields`` are those of `Effect`."""

    def register(function):
        if "," in id or " " in id:
            raise ValueError(f"effect {id!r}: expected an id without commas and spaces")
        # a notebook's cell that is run once more replaces its own effect
        again = id in EFFECTS and EFFECTS[id].apply.__module__ == function.__module__ == "__main__"
        if id in EFFECTS and not again:
            raise ValueError(f"effect {id}: expected a new id, found it registered already")
        if (what := fields.get("against", "")) not in AGAINST:
            raise ValueError(f"effect {id}: expected against one of {AGAINST[1:]}, found {what!r}")
        prior = tuple(prior_sd) if isinstance(prior_sd, list) else prior_sd
        whose = sensors or (id.split("_")[0] if id.split("_")[0] in KINDS else "imu")
        EFFECTS[id] = Effect(id, unit, prior, shape, function, sensors=whose, **fields)
        return function

    return register


def data_effect(id, *, kind, meaning, remedy, left_out=False) -> None:
    """Register an effect of the "readings" themselves or of their "noise"."""
    DATA_EFFECTS[id] = Effect(id, meaning=meaning, kind=kind, remedy=remedy, left_out=left_out)


def known_effect(id) -> Effect:
    """An effect of either registry; for an unknown id, one that says no more than it."""
    return EFFECTS.get(id) or DATA_EFFECTS.get(id) or Effect(id)


def common_mean(shape, axes=None) -> list[np.ndarray]:
    """A gauge: the mean of all parameters of all triads together."""
    return [np.ones(shape, bool)]


def each_mean(shape, axes=None) -> list[np.ndarray]:
    """Gauges: the mean over triads of each parameter."""
    each = np.eye(int(np.prod(shape[1:])), dtype=bool)
    return [np.broadcast_to(row.reshape(shape[1:]), shape) for row in each]


def find_effects(ids) -> tuple[Effect, ...]:
    """Effects by id; InputError names the unknown one and what is known."""
    for name in ids:
        require(name in EFFECTS, "effects", f"any of {', '.join(sorted(EFFECTS))}", name)
    return tuple(EFFECTS[name] for name in ids)


@effect(
    "gyroscope_scale", unit="1", prior_sd=0.02, shape=lambda a, g: (g, 3), gauge=common_mean,
    meaning="the gyroscopes' axes are scaled", shown="%", against="angular rate", resizes=True,
)  # fmt: skip
def gyroscope_scale(scale, instant, predicted):
    """(1 + c_i) omega_i at each gyroscope axis."""
    return predicted._replace(angular_rate=(1.0 + scale) * predicted.angular_rate)


def read_effects(path: str | Path) -> tuple[str, ...]:
    """Run a Python file that registers effects (docs/effects.md); returns their ids.

    The file is code and does what it says: read your own only. Results carry its name and SHA-256
    beside the versions, and chains made with another text of it are not continued. The same text
    is run once; a changed file replaces its effects. InputError with the line where it fails, or
    where it registers nothing; the catalogue is then as before.
    """
    path = Path(path)
    try:
        text = path.read_text(encoding="utf-8")
    except UnicodeDecodeError as error:
        raise InputError(f"{path}: expected a Python file in UTF-8, found {error}") from None
    except OSError as error:
        raise InputError(f"{path}: expected a Python file, found {error.strerror}") from None
    place, known, before = str(path.resolve()), digest(text), dict(EFFECTS)
    former = _READ.get(place, ("", ()))
    if former[0] == known:
        return former[1]
    for name in former[1]:
        EFFECTS.pop(name, None)
    kept = dict(EFFECTS)
    try:
        code = compile(text, str(path), "exec", dont_inherit=True)
        exec(code, {"__name__": path.stem, "__file__": str(path)})  # noqa: S102
        new = tuple(name for name in EFFECTS if name not in kept)
        require(new, str(path), "effects (@effect(...) of docs/effects.md)", "none")
    except BaseException as error:
        EFFECTS.clear()
        EFFECTS.update(before)
        if isinstance(error, InputError | KeyboardInterrupt):
            raise
        raise InputError(f"{path}{_line(error, path)}: {type(error).__name__}: {error}") from None
    add_code(path.name, place, text)
    _READ[place] = known, new
    return new


def own_version(name: str) -> str | None:
    """SHA-256 of the text of the file that an effect was read from, as results carry it."""
    places = [place for place, (_, names) in _READ.items() if name in names]
    return code_version(places[0]) if places else None


def _line(error: BaseException, path: Path) -> str:
    """', line 3': the last of the file's lines that the error went through."""
    if isinstance(error, SyntaxError):
        return f", line {error.lineno}"
    frames = traceback.extract_tb(error.__traceback__)
    lines = [frame.lineno for frame in frames if frame.filename == str(path)]
    return f", line {lines[-1]}" if lines else ""
