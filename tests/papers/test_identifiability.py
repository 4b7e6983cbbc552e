"""Which motions and arrays determine the positions, by Fisher information; what BCD refuses."""

import numpy as np
import pytest

from imuarray.errors import IdentifiabilityError
from imuarray.geometry import Array
from imuarray.model import ArrayModel
from imuarray.motion import Motion
from imuarray.motion.state import directions
from imuarray_papers.estimation.bcd import calibrate_bcd
from tests import oracles
from tests.cases import measure, small_array

SAMPLES = 40


def motions(kind, seed=1) -> Motion:
    """Motions of SAMPLES instants, by where omega and omega_dot point."""
    rng = np.random.default_rng(seed)
    axis = directions(rng, ())
    rate, acceleration = (
        10 * rng.standard_normal((SAMPLES, 1)),
        300 * rng.standard_normal((SAMPLES, 1)),
    )
    varying = directions(rng, (SAMPLES,))
    free = 300 * rng.standard_normal((SAMPLES, 3))
    nothing = np.zeros((SAMPLES, 3))
    force = 20 * rng.standard_normal((SAMPLES, 3))
    pairs = {
        "general": (rate * varying, free),
        "parallel, axes vary": (rate * varying, acceleration * varying),
        "one axis of omega, free omega_dot": (rate * axis, free),
        "omega_dot zero, axes vary": (rate * varying, nothing),
        "one axis": (rate * axis, acceleration * axis),
        "one axis, steady": (10.0 + 0 * rate * axis, nothing),
        "no rotation": (nothing, nothing),
        "omega zero": (nothing, free),
    }
    return Motion.of(*pairs[kind], force)


IDENTIFIABLE = [
    "general",
    "parallel, axes vary",
    "one axis of omega, free omega_dot",
    "omega_dot zero, axes vary",
]
NOT = ["one axis", "one axis, steady", "no rotation", "omega zero"]


def problem(kind, start_error=1e-3, seed=2):
    """Noisy measurements, and a model whose nominal positions are wrong."""
    rng = np.random.default_rng(seed)
    array = small_array(5, 4)
    model = ArrayModel.isotropic(array, 0.04, 0.02)
    motion = motions(kind)
    off = array.relative + start_error * rng.standard_normal((5, 3))
    nominal = ArrayModel(Array(off, array.labels, 4, "off"), model.noise)
    return nominal, array.relative, motion, *measure(rng, model, motion)


@pytest.mark.parametrize("kind", IDENTIFIABLE)
def test_calibrates(kind):
    """Within six sds of the Cramer-Rao bound (12 unknowns: false alarm 1e-7 each kind).

    Lemma 1 of paper 2017 needs one axis for all samples: omega and omega_dot parallel in each
    sample do determine the positions as long as the axes vary.
    """
    model, truth, motion, force, rate = problem(kind)
    found = calibrate_bcd(model, force, rate, tolerance=1e-12, limit=200_000)
    jacobian = oracles.joint_jacobian(np.hstack(motion[:3]), truth, 4, 0.04, 0.02)
    sd = np.sqrt(np.diag(np.linalg.inv(oracles.position_information(jacobian, 12))))
    assert found.converged
    assert np.all(np.abs((found.positions - truth)[1:].ravel()) < 6 * sd)


@pytest.mark.parametrize("kind", NOT)
@pytest.mark.parametrize("start_error", [0.0, 1e-3])
def test_refuses_motion(kind, start_error):
    """The last (omega zero, omega_dot not) leaves the array's scale free."""
    model, _, _, force, rate = problem(kind, start_error)
    with pytest.raises(IdentifiabilityError):
        calibrate_bcd(model, force, rate)


@pytest.mark.parametrize("seed", range(10))
def test_refuses_one_axis_whatever_the_noise(seed):
    model, _, _, force, rate = problem("one axis", 1e-3, seed)
    with pytest.raises(IdentifiabilityError, match="axis"):
        calibrate_bcd(model, force, rate)


def test_gyroscopes_at_their_rails_give_no_scale():
    """All of them throughout: said so; in most samples: the rest give it."""
    model, truth, _, force, rate = problem("general", 1e-3)
    lost = np.ones(rate.shape, bool)
    with pytest.raises(IdentifiabilityError, match="off their rails, found all"):
        calibrate_bcd(model, force, rate, saturated=lost)
    lost[::3] = False
    found = calibrate_bcd(model, force, rate, saturated=lost, limit=200_000)
    assert np.max(np.abs(found.positions - truth)) < 1e-3


def test_one_sample_is_not_enough():
    model, _, _, force, rate = problem("general")
    with pytest.raises(IdentifiabilityError, match="at least 2"):
        calibrate_bcd(model, force[:1], rate[:1])


@pytest.mark.parametrize("wrong", ["two triads", "collinear"])
def test_refuses_arrays(wrong):
    rng = np.random.default_rng(3)
    count = 2 if wrong == "two triads" else 5
    positions = np.arange(count)[:, None] * [0.01, 0.005, 0.002]
    array = Array(positions, tuple("abcde"[:count]), 4, wrong)
    model = ArrayModel.isotropic(array, 0.04, 0.02)
    data = measure(rng, model, motions("general"))
    with pytest.raises(IdentifiabilityError, match="at least 3" if count == 2 else "collinear"):
        calibrate_bcd(model, *data)
