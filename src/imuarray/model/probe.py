"""A test that an effect is what it declares: made once, before anything rests on it."""

import numpy as np

from imuarray.errors import InputError
from imuarray.model.effects import Effect, Instant, Prediction
from imuarray.model.jax64 import jax, jnp
from imuarray.motion.state import Motion

ACCELEROMETERS, GYROSCOPES = 7, 5  # of the array that effects are tried on


def probe(item: Effect) -> bool:
    """True where a triad's own position is all that matters to an effect.

    InputError, with the effect's id, where declaration and function do not agree.
    Tried on a small array: shapes; no effect at the value zero; no use of omega double dot
    or s dot without ``derivatives=True``, for those would be taken for zero; and parameters, or
    readings that go in, of one triad change that triad's readings alone.
    """
    sd = np.broadcast_to(_prior_sd(item), _shape(item))
    with jax.ensure_compile_time_eval():  # models are looked at while others are traced
        return _probe(item, sd, np.random.default_rng(1))


def _probe(item: Effect, sd, rng) -> bool:
    plain = Prediction(
        jnp.asarray(10 * rng.standard_normal((ACCELEROMETERS, 3))),
        jnp.asarray(5 * rng.standard_normal((GYROSCOPES, 3))),
    )
    positions = jnp.asarray(0.01 * rng.standard_normal((ACCELEROMETERS, 3)))
    fields = [jnp.asarray(scale * rng.standard_normal(3)) for scale in (5, 100, 10, 1e3, 1e2)]

    def predicted(parameters, later, plain=plain, positions=positions, time=0.3):
        motion = Motion(*fields[:3], *later)
        instant = Instant(motion, positions, time=time, span=1.0, axes=axes)
        return item.apply(jnp.asarray(parameters), instant, plain)

    later = tuple(fields[3:])
    axes = np.tile(np.eye(3), (ACCELEROMETERS, 1, 1))
    _require_gauge(item, sd.shape, axes)
    nothing = _tried(item, sd.shape, lambda: predicted(np.zeros(sd.shape), later))
    _require_shapes(item, nothing, plain)
    for kind, old, new in zip(Prediction._fields, plain, nothing, strict=True):
        if not np.allclose(old, new, rtol=1e-9, atol=1e-12):
            raise _wrong(item, f"{kind} left as it is by parameters of zero", "it changed")
    drawn = sd * rng.standard_normal(sd.shape)
    # as it is used: compiled, where numpy's functions and a Python `if` on values fail
    _tried(item, sd.shape, lambda: jax.eval_shape(lambda x: predicted(x, later), drawn))
    values, change = _tried(
        item, sd.shape, lambda: jax.jvp(lambda x: predicted(drawn, x), (later,), (later,))
    )
    if not all(np.all(np.isfinite(part)) for part in values):
        raise _wrong(item, "finite readings at parameters within their prior", "NaN or infinite")

    def slopes(time):
        by = jax.jacfwd(lambda x, y, r: predicted(x, later, y, r, time), argnums=(0, 1, 2))
        return by(jnp.asarray(drawn), plain, positions)

    early, late = (_tried(item, sd.shape, lambda t=t: slopes(t)) for t in (0.3, 0.8))
    own = [_require_own(item, each) for each in (early, late)]
    if not item.derivatives and any(np.any(np.asarray(part) != 0) for part in change):
        raise _wrong(item, "derivatives=True, since it uses omega double dot or s dot", "False")
    return all(own)


def _wrong(item: Effect, expected: str, found) -> InputError:
    return InputError(f"effect {item.id}: expected {expected}, found {found}")


def _shape(item: Effect) -> tuple[int, ...]:
    try:
        shape = tuple(int(size) for size in item.shape(ACCELEROMETERS, GYROSCOPES))
    except Exception as error:
        raise _wrong(item, "shape=lambda a, g: a tuple", _first(error)) from error
    if not shape or shape[0] not in (ACCELEROMETERS, GYROSCOPES):
        expected = (
            f"a shape whose first axis counts triads, {ACCELEROMETERS} or {GYROSCOPES} for"
            f" {ACCELEROMETERS} accelerometers and {GYROSCOPES} gyroscopes"
        )
        raise _wrong(item, expected, shape)
    # as `unit_of` takes them: commas count along the last axis, bars along the second
    units, axis = item.unit.split("|"), 1
    if "|" not in item.unit:
        units, axis = item.unit.split(","), -1
    if len(units) > 1 and (len(shape) < 2 or len(units) != shape[axis]):
        raise _wrong(item, f"a unit for each of {shape[1:]}", item.unit)
    return shape


def _prior_sd(item: Effect) -> np.ndarray:
    shape = _shape(item)
    try:
        sd = np.asarray(item.prior_sd, float)
        np.broadcast_to(sd, shape)
    except (TypeError, ValueError):
        raise _wrong(item, f"a prior_sd that broadcasts to {shape}", item.prior_sd) from None
    if not np.all((sd > 0) & np.isfinite(sd)):
        raise _wrong(item, "a positive prior_sd", item.prior_sd)
    return sd


def _tried(item: Effect, shape, function):
    try:
        return function()
    except Exception as error:
        expected = f"a function of (parameters {shape}, instant, predicted) in jax.numpy"
        raise _wrong(item, expected, _first(error)) from error


def _require_gauge(item: Effect, shape, axes) -> None:
    expected = f"gauge(shape, axes) to return arrays of shape {shape}"
    try:
        shapes = {np.shape(own) for own in item.gauge(shape, axes)} if item.gauge else set()
    except Exception as error:
        raise _wrong(item, expected, _first(error)) from error
    if shapes - {shape}:
        raise _wrong(item, expected, (shapes - {shape}).pop())


def _require_shapes(item: Effect, made, plain) -> None:
    if not isinstance(made, Prediction):
        raise _wrong(item, "predicted._replace(...) returned", type(made).__name__)
    for kind, old, new in zip(Prediction._fields, plain, made, strict=True):
        if np.shape(new) != np.shape(old):
            raise _wrong(item, f"{kind} of shape {np.shape(old)}", np.shape(new))


def _require_own(item: Effect, slopes) -> bool:
    """InputError where a triad's parameters or readings change another triad's readings.

    Returns whether its position does not: effects of the whole board's shape are allowed.
    """
    own = True
    for kind, (rows, readings, places) in zip(Prediction._fields, slopes, strict=True):
        for what, slope in (("parameters", rows), *(("readings", part) for part in readings)):
            for triad, row in _reached(item, slope):
                raise _wrong(
                    item, "a triad's parameters and readings to change that triad alone",
                    f"{what} of triad {row + 1} in the {kind} of triad {triad + 1}",
                )  # fmt: skip
        own = own and not _reached(item, places)
    return own


def _reached(item: Effect, slope) -> list[tuple[int, int]]:
    """(triad, other) pairs, the other's row in a derivative (triad, axis, other, ...) not zero."""
    slope = np.asarray(slope)
    if not np.all(np.isfinite(slope)):
        raise _wrong(item, "finite derivatives at parameters within their prior", "NaN or infinite")
    pairs = np.argwhere(np.any(slope != 0, (1, *range(3, slope.ndim))))
    return [(int(triad), int(other)) for triad, other in pairs if triad != other]


def _first(error: Exception) -> str:
    """A one-line account of somebody else's error."""
    text = str(error).strip().split("\n")[0]
    return f"{type(error).__name__}: {text[:120]}"
