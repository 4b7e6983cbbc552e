"""An effect that is not what it declares is refused by name before anything rests on it."""

import numpy as np
import pytest

from imuarray.errors import InputError
from imuarray.geometry import mimu4444_corners
from imuarray.model import EFFECTS, ArrayModel, effect
from imuarray.model.array_model import component, parameter_names
from imuarray.model.jax64 import jax, jnp
from imuarray.model.probe import probe


def scaled(value, instant, predicted):
    return predicted._replace(angular_rate=(1 + value) * predicted.angular_rate)


def late(value, instant, predicted):
    turned = value * instant.motion.force_rate
    return predicted._replace(specific_force=predicted.specific_force + turned)


SOUND = {"unit": "1", "prior_sd": 0.02, "shape": lambda a, g: (g, 3)}
WRONG = {
    "no triads": (scaled, {"shape": lambda a, g: ()}, "first axis counts triads"),
    "one row for all": (scaled, {"shape": lambda a, g: (1, 3)}, r"triads.*found \(1, 3\)"),
    "not a function": (scaled, {"shape": (3, 3)}, "shape=lambda.*not callable"),
    "two columns": (scaled, {"shape": lambda a, g: (g, 2)}, "in jax.numpy, found TypeError"),
    "no prior": (scaled, {"prior_sd": 0.0}, "positive prior_sd, found 0.0"),
    "prior of four": (scaled, {"prior_sd": (1.0,) * 4}, "prior_sd that broadcasts"),
    "two units": (scaled, {"unit": "m, rad"}, r"a unit for each of \(3,\)"),
    "units of another axis": (
        lambda v, i, p: p._replace(angular_rate=p[1] + v[:, 0]),
        {"unit": "m, s", "shape": lambda a, g: (g, 2, 3)},
        r"a unit for each of \(2, 3\)",
    ),
    "nothing back": (lambda v, i, p: None, {}, "predicted._replace.*found NoneType"),
    "an array back": (lambda v, i, p: p.angular_rate, {}, "predicted._replace"),
    "another shape": (lambda v, i, p: p._replace(angular_rate=v[0]), {}, r"\(5, 3\), found \(3,\)"),
    "not zero at zero": (lambda v, i, p: p._replace(angular_rate=v + 1.0), {}, "it changed"),
    "the axes' own": (scaled, {"shape": lambda a, g: (3,)}, r"triads.*found \(3,\)"),
    "not a number": (
        lambda v, i, p: p._replace(angular_rate=p[1] + jnp.sqrt(-(v**2))),
        {},
        "finite",
    ),
    "numpy": (lambda v, i, p: p._replace(angular_rate=np.sin(v) + p[1]), {}, "in jax.numpy"),
    "an if on values": (lambda v, i, p: p if v.sum() > 0 else scaled(v, i, p), {}, "in jax.numpy"),
    "a neighbour's parameters": (
        lambda v, i, p: p._replace(angular_rate=p[1] + jnp.roll(v, 1, axis=0)),
        {},
        "that triad alone, found parameters of triad 5 in the angular_rate of triad 1",
    ),
    "all triads' readings": (
        lambda v, i, p: p._replace(angular_rate=p[1] + v * p[1].mean(axis=0)),
        {},
        "that triad alone, found readings of triad 2 in the angular_rate of triad 1",
    ),
    "an infinite slope": (
        lambda v, i, p: p._replace(angular_rate=p[1] + jnp.sqrt(v * 0.0)),
        {},
        "finite derivatives",
    ),
    "guarded outside": (
        lambda v, i, p: p._replace(angular_rate=p[1] + jnp.where(v > 0, jnp.exp(-1 / v), 0.0)),
        {},
        "finite derivatives, taken backwards",
    ),
    "a loop up to a value": (
        lambda v, i, p: p._replace(
            angular_rate=jax.lax.fori_loop(0, jnp.int32(9 * i.time), lambda _, x: x + v, p[1])
        ),
        {},
        "backwards",
    ),
    "an if on axes": (
        lambda v, i, p: scaled(v, i, p) if np.allclose(i.axes[0], np.eye(3)) else p,
        {},
        "in jax.numpy",
    ),
    "later a neighbour's": (
        lambda v, i, p: p._replace(
            angular_rate=p[1] + jnp.where(i.time > 0.5, jnp.roll(v, 1, axis=0), v)
        ),
        {},
        "that triad alone",
    ),
    "silent derivative": (late, {"shape": lambda a, g: (a, 3)}, "derivatives=True"),
    "declared derivative": (late, {"shape": lambda a, g: (a, 3), "derivatives": True}, None),
}


@pytest.mark.parametrize("name", WRONG)
def test_refused_with_its_name(name):
    function, changes, message = WRONG[name]
    try:
        effect("gyroscope_probed", **{**SOUND, **changes})(function)
        model = ArrayModel.isotropic(mimu4444_corners(), 0.04, 1e-3, ("gyroscope_probed",))
        if message is None:
            assert model.chain
        else:
            with pytest.raises(InputError, match=f"effect gyroscope_probed: expected .*{message}"):
                _ = model.chain
    finally:
        EFFECTS.pop("gyroscope_probed", None)


@pytest.mark.parametrize("name", list(EFFECTS))
def test_the_catalogue_is_sound(name):
    probe(EFFECTS[name])


def test_while_others_are_traced():
    """A model's effects may be asked for first inside compiled code."""

    @jax.jit
    def traced(x):
        probe(EFFECTS["gyroscope_scale"])
        return x + 1

    assert traced(jnp.ones(2))[0] == 2


def test_an_id_with_a_comma_is_refused():
    with pytest.raises(ValueError, match="without commas"):
        effect("a,b", **SOUND)(scaled)


def test_names_are_one_for_each_parameter():
    """Whatever the shape: reports, files and `--diagnosis` match parameters by them."""
    for shape in ((), (3,), (6,), (3, 3), (3, 6), (2,), (3, 3, 3), (4, 2)):

        @effect("test_named", unit="s", prior_sd=1.0, shape=lambda a, g, s=shape: (a, *s))
        def named(value, instant, predicted):
            return predicted

        try:
            places = list(np.ndindex(*shape))
            assert len({component("test_named", place) for place in places}) == len(places)
            model = ArrayModel.isotropic(mimu4444_corners(), 0.04, 1e-3, ("test_named",))
            assert len(set(parameter_names(model))) == model.effect_size == 8 * len(places)
        finally:
            del EFFECTS["test_named"]
    every = ArrayModel.isotropic(mimu4444_corners(), 0.04, 1e-3, tuple(EFFECTS))
    assert len(set(parameter_names(every))) == every.effect_size


def test_where_the_others_are_may_matter():
    """Allowed, and known: the derivative is then taken by each parameter by itself."""

    def stretched(value, instant, predicted):
        away = instant.positions - instant.positions.mean(axis=0)
        return predicted._replace(specific_force=predicted.specific_force + value * away)

    try:
        effect("accelerometer_probed", **{**SOUND, "shape": lambda a, g: (a, 3)})(stretched)
        model = ArrayModel.isotropic(mimu4444_corners(), 0.04, 1e-3, ("accelerometer_probed",))
        assert not model.apart
    finally:
        EFFECTS.pop("accelerometer_probed", None)
