"""A test that an effect is what it declares: made once, before anything rests on it."""

from functools import partial

import numpy as np

from imuarray.errors import InputError, expecting, require
from imuarray.model.effects import Effect, Instant, Prediction
from imuarray.model.jax64 import jax, jnp
from imuarray.motion.state import Motion

ACCELEROMETERS, GYROSCOPES = 7, 5  # of the array that effects are tried on
running = partial(expecting, most=120)  # somebody else's function: JAX's errors are long


def probe(item: Effect) -> bool:
    """True where a triad's own position is all that matters to an effect.

    InputError, with the effect's id, where declaration and function do not agree.
    Tried on a small array: shapes; no effect at the value zero; no use of omega double dot
    or s dot without ``derivatives=True``, for those would be taken for zero; and parameters, or
    readings that go in, of one triad change that triad's readings alone.
    """
    where = f"effect {item.id}"
    sd = _prior_sd(item, _shape(item, where), where)
    with jax.ensure_compile_time_eval():  # models are looked at while others are traced
        return _probe(item, sd, np.random.default_rng(1), where)


def _probe(item: Effect, sd, rng, where: str) -> bool:
    plain = Prediction(
        jnp.asarray(10 * rng.standard_normal((ACCELEROMETERS, 3))),
        jnp.asarray(5 * rng.standard_normal((GYROSCOPES, 3))),
    )
    positions = jnp.asarray(0.01 * rng.standard_normal((ACCELEROMETERS, 3)))
    fields = [jnp.asarray(scale * rng.standard_normal(3)) for scale in (5, 100, 10, 1e3, 1e2)]

    axes = np.tile(np.eye(3), (ACCELEROMETERS, 1, 1))

    def predicted(parameters, later, plain=plain, positions=positions, time=0.3, axes=axes):
        motion = Motion(*fields[:3], *later)
        instant = Instant(motion, positions, time=time, span=1.0, axes=axes)
        return item.apply(jnp.asarray(parameters), instant, plain)

    later = tuple(fields[3:])
    _require_gauge(item, sd.shape, axes, where)
    function = f"a function of (parameters {sd.shape}, instant, predicted) in jax.numpy"
    with running(where, function):
        nothing = predicted(np.zeros(sd.shape), later)
    right, found = isinstance(nothing, Prediction), type(nothing).__name__
    require(right, where, "predicted._replace(...) returned", found)
    kinds = list(zip(Prediction._fields, plain, nothing, strict=True))
    for kind, old, new in kinds:
        same = np.shape(new) == np.shape(old)
        require(same, where, f"{kind} of shape {np.shape(old)}", np.shape(new))
    for kind, old, new in kinds:
        same = np.allclose(old, new, rtol=1e-9, atol=1e-12)
        require(same, where, f"{kind} left as it is by parameters of zero", "it changed")
    drawn = sd * rng.standard_normal(sd.shape)
    with running(where, function):
        # as it is used: compiled, where numpy's functions and a Python `if` on values fail
        jax.eval_shape(lambda x, r: predicted(x, later, axes=r), drawn, axes)
        values, change = jax.jvp(lambda x: predicted(drawn, x), (later,), (later,))
    finite = all(np.all(np.isfinite(part)) for part in values)
    require(finite, where, "finite readings at parameters within their prior", "NaN or infinite")

    def slopes(parameters, time):
        by = jax.jacrev(lambda x, y, r: predicted(x, later, y, r, time), argnums=(0, 1, 2))
        return by(jnp.asarray(parameters), plain, positions)

    with running(where, f"{function} that is differentiated backwards"):
        jax.eval_shape(slopes, drawn, 0.3)  # time is traced, too
        every = slopes(drawn, 0.3), slopes(drawn, 0.8), slopes(np.zeros(sd.shape), 0.3)
    own = [_require_own(each, where) for each in every]
    declared = item.derivatives or not any(np.any(np.asarray(part) != 0) for part in change)
    expected = "derivatives=True, since it uses omega double dot or s dot"
    require(declared, where, expected, "False")
    return all(own)


def _shape(item: Effect, where: str) -> tuple[int, ...]:
    with running(where, "shape=lambda a, g: a tuple"):
        shape = tuple(int(size) for size in item.shape(ACCELEROMETERS, GYROSCOPES))
    expected = (
        f"a shape whose first axis counts triads, {ACCELEROMETERS} or {GYROSCOPES} for"
        f" {ACCELEROMETERS} accelerometers and {GYROSCOPES} gyroscopes"
    )
    counts = shape and shape[0] in (ACCELEROMETERS, GYROSCOPES)
    require(counts, where, expected, shape)
    # as `unit_of` takes them: commas count along the last axis, bars along the second
    units, axis = item.unit.split("|"), 1
    if "|" not in item.unit:
        units, axis = item.unit.split(","), -1
    each = len(units) == 1 or (len(shape) > 1 and len(units) == shape[axis])
    require(each, where, f"a unit for each of {shape[1:]}", item.unit)
    return shape


def _prior_sd(item: Effect, shape, where: str) -> np.ndarray:
    try:
        sd = np.broadcast_to(np.asarray(item.prior_sd, float), shape)
    except (TypeError, ValueError):
        raise InputError(
            f"{where}: expected a prior_sd that broadcasts to {shape}, found {item.prior_sd}"
        ) from None
    positive = np.all((sd > 0) & np.isfinite(sd))
    require(positive, where, "a positive prior_sd", item.prior_sd)
    return sd


def _require_gauge(item: Effect, shape, axes, where: str) -> None:
    expected = f"gauge(shape, axes) to return arrays of shape {shape}"
    with running(where, expected):
        shapes = {np.shape(own) for own in item.gauge(shape, axes)} if item.gauge else set()
    wrong = shapes - {shape}
    require(not wrong, where, expected, next(iter(wrong), None))


def _require_own(slopes, where: str) -> bool:
    """InputError where a triad's parameters or readings change another triad's readings.

    Returns whether its position does not: effects of the whole board's shape are allowed.
    """
    own = True
    for kind, (rows, readings, places) in zip(Prediction._fields, slopes, strict=True):
        for what, slope in (("parameters", rows), *(("readings", part) for part in readings)):
            for triad, row in _reached(where, slope):
                raise InputError(
                    f"{where}: expected a triad's parameters and readings to change that triad"
                    f" alone, found {what} of triad {row + 1} in the {kind} of triad {triad + 1}"
                )
        own = own and not _reached(where, places)
    return own


def _reached(where: str, slope) -> list[tuple[int, int]]:
    """(triad, other) pairs, the other's row in a derivative (triad, axis, other, ...) not zero."""
    slope = np.asarray(slope)
    expected = "finite derivatives, taken backwards, at zero and within the parameters' prior"
    require(np.isfinite(slope).all(), where, expected, "NaN or infinite")
    pairs = np.argwhere(np.any(slope != 0, (1, *range(3, slope.ndim))))
    return [(int(triad), int(other)) for triad, other in pairs if triad != other]
