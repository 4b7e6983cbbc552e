"""Statements of both papers that a few numbers settle: what accuracy rests on, kinds of motion."""

from dataclasses import replace

import numpy as np
import pandas as pd

from imuarray.engine.parameters import model_of
from imuarray.geometry import sub_array
from imuarray.model import ArrayModel
from imuarray.motion import Motion, hand_twisting, normal_motion, sphere_motion
from imuarray.recording import Recording
from imuarray.simulation.recordings import measure
from imuarray.streams import stream
from imuarray_papers.estimation.collapsed import estimate_motion
from imuarray_papers.estimation.information import information_at
from imuarray_papers.estimation.newton import calibrate_gauss_newton
from imuarray_papers.studies.bound import isotropic, rms_width, widths
from imuarray_papers.studies.checks.identifiability import motion_jacobian

REPEATS = 20  # motions averaged over
OFF = 1e-3  # m, sd by which positions are off at the start
MOVING = np.radians(100.0)  # rad/s, from which a sample is one of twisting
SIZES = "angular rate", "angular acceleration", "specific force"


def dependence(model: ArrayModel, seed, samples: int, sizes) -> pd.DataFrame:
    """Factor on the bound of the positions of one change alone, and its standard error.

    Of half the sensors' accuracy, half an array, half its thickness, half the motion, one
    gyroscope for all.
    ``sizes``: magnitudes (rad/s, rad/s^2, m/s^2) of random motion, the same with each change.
    """
    array = model.array
    flat = array.positions * [1.0, 1.0, 0.5]
    models = {
        "noise of the gyroscopes": isotropic(model, gyroscope=2.0),
        "noise of the accelerometers": isotropic(model, accelerometer=2.0),
        "size": isotropic(model, array=replace(array, positions=array.positions / 2)),
        "thickness": isotropic(model, array=replace(array, positions=flat)),
        "IMUs": isotropic(model, array=sub_array(array, array.accelerometers // 2)),
        "one gyroscope": isotropic(model, array=replace(array, gyroscopes=1)),
    }
    changes = {name: (changed, np.ones(3)) for name, changed in models.items()}
    changes |= {name: (model, 1.0 - np.eye(3)[k] / 2) for k, name in enumerate(SIZES)}

    def found(changed, factors):
        return widths(changed, seed, ("dependence",), samples, sizes * factors, REPEATS)

    plain, rows = found(model, np.ones(3)), []
    for name, change in changes.items():
        factor = found(*change) / plain
        rows.append((name, factor.mean(), factor.std(ddof=1) / np.sqrt(REPEATS)))
    return pd.DataFrame(rows, columns=["change", "factor", "factor_se"])


def any_motion(model: ArrayModel, seed, samples: int, sizes, normal, hand, real: Motion) -> dict:
    """Bound of the positions (m) for so many samples of each kind of motion.

    ``sizes`` as in `dependence`, ``normal`` its sds in paper 2021; ``hand``: bandwidth (Hz) and
    sampling rate (Hz) of smooth twisting; ``real``: what `moving` gives of a recording.
    """
    rng = stream(seed, "any motion")
    twisting = hand_twisting(rng, normal[0], normal[2], hand[0]).at(np.arange(samples) / hand[1])
    drawn = rng.choice(len(real.angular_rate), samples, replace=False)
    kinds = {
        "fixed magnitudes": sphere_motion(rng, (samples,), *sizes),
        "normal": normal_motion(rng, (samples,), *normal),
        "smooth": twisting,
        "by hand": real.select(drawn),
    }
    known = {name: information_at(model, m, model.array.relative) for name, m in kinds.items()}
    return {name: rms_width(each) for name, each in known.items()}


def motion_efficiency(model: ArrayModel, seed, samples: int, sizes) -> dict:
    """Root of the mean of e' I e / 9 over samples: 1 where the motion's error is at its bound.

    The bound knows the positions; the motion is at those that the same samples calibrate.
    """
    rng, positions = stream(seed, "motion efficiency"), model.array.relative
    motion = sphere_motion(rng, (samples,), *sizes)
    force, rate, _ = measure(model, motion, positions, rng)
    start = (
        positions
        + OFF * rng.standard_normal(positions.shape) * (positions != 0).any(axis=1)[:, None]
    )
    found = calibrate_gauss_newton(model, force, rate, start=start).motion.motion
    error = np.hstack([np.asarray(a) - b for a, b in zip(found[:3], motion[:3], strict=True)])
    squares = np.einsum("tri,ti->tr", motion_jacobian(positions, motion.angular_rate), error) ** 2
    mine = np.sum(error[:, :3] ** 2, axis=1) * model.array.gyroscopes / model.noise.gyroscope[0, 0]
    each = (squares.sum(axis=1) / model.noise.accelerometer[0, 0] + mine) / 9
    error = each.std(ddof=1) / np.sqrt(samples) / 2
    return {"ratio": float(np.sqrt(each.mean())), "se": float(error)}


def differentiation(model: ArrayModel, seed, samples: int, normal, bandwidth, rate) -> dict:
    """Rms error of omega_dot (rad/s^2) of one sample and of the gyroscopes' central difference.

    Of smooth twisting at ``rate`` samples a second; ``noise`` is the difference's without motion.
    """
    rng, positions = stream(seed, "differentiation"), model.array.relative
    motion = hand_twisting(rng, normal[0], normal[2], bandwidth).at(np.arange(samples) / rate)
    force, rates, _ = measure(model, motion, positions, rng)
    single = np.asarray(estimate_motion(model, force, rates).motion.angular_acceleration)
    mean = rates.mean(axis=1)
    slope = (mean[2:] - mean[:-2]) * rate / 2
    truth = motion.angular_acceleration
    noise = model.noise.gyroscope[0, 0] ** 0.5 / np.sqrt(model.array.gyroscopes)
    return {
        "one sample": float(np.sqrt(np.mean((single - truth) ** 2))),
        "difference": float(np.sqrt(np.mean((slope - truth[1:-1]) ** 2))),
        "noise": float(noise * rate / np.sqrt(2)),
    }


def moving(recording: Recording) -> Motion:
    """Motion of the samples that turn, by the papers' model at the nominal positions."""
    found = [
        estimate_motion(model_of(p), p.specific_force, p.angular_rate,
                        saturated=p.saturated_gyroscopes()).motion
        for p in recording.select(~recording.still()).parts()
    ]  # fmt: skip
    whole = Motion(*(np.concatenate(field) for field in zip(*found, strict=True)))
    return whole.select(np.linalg.norm(whole.angular_rate, axis=1) > MOVING)


def averaging(recording: Recording) -> dict:
    """Noise of still triads' mean over that of one, times the root of their number, by kind.

    1 where the triads' noises are independent. By differences of neighbours.
    """
    still = recording.select(recording.still()).in_memory()
    one = np.diff(still.time) < 1.5 * np.median(np.diff(still.time))
    found = {}
    for kind in ("specific_force", "angular_rate"):
        steps = np.diff(getattr(still, kind), axis=0)[one]
        own = np.sqrt(np.mean(steps.std(axis=0) ** 2))
        whole = np.sqrt(np.mean(steps.mean(axis=1).std(axis=0) ** 2))
        found[kind] = float(whole / own * np.sqrt(steps.shape[1]))
    return found


def spread_by_rate(recording: Recording) -> dict:
    """Rms difference (rad/s) of gyroscopes from their mean, slow and fast samples of the twisting.

    Fast: the eighth with the largest rates; slow: with the smallest, of those that `moving` takes.
    Samples with a gyroscope at its rail are left out.
    """
    rail = recording.at_rail("gyroscope")
    rate = recording.select(~recording.still() & ~rail).in_memory().angular_rate
    mean = rate.mean(axis=1)
    size = np.linalg.norm(mean, axis=1)
    rms = np.sqrt(np.mean((rate - mean[:, None]) ** 2, axis=(1, 2)))[size > MOVING]
    order = np.argsort(size[size > MOVING], kind="stable")
    eighth = len(order) // 8
    ends = {"slow": order[:eighth], "fast": order[-eighth:]}
    return {name: float(np.sqrt(np.mean(rms[index] ** 2))) for name, index in ends.items()}
