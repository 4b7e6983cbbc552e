"""Effects in time: delays, clocks, drifts, shifts; ids are those of the catalogue.

A reading taken at t + tau is the ideal one plus tau times its derivative, and the second and third
order where the recording's smooth motion tells them (`Instant`).
"""

from __future__ import annotations

from imuarray.model import kinematics
from imuarray.model.effects import Prediction, effect
from imuarray.model.jax64 import jnp


def later(delay, instant, predicted, accelerometers=True):
    """``predicted`` with the IMUs' readings taken ``delay`` (n,) s later."""
    count, gyroscopes = len(predicted.specific_force), len(predicted.angular_rate)
    rate = _rate_later(delay[:gyroscopes, None], instant, common=not accelerometers)
    if not accelerometers:
        return predicted._replace(angular_rate=predicted.angular_rate + rate)
    tau = delay[:count, None]
    force = tau * (
        kinematics.force_rate(instant.motion, instant.positions)
        + tau / 2 * (instant.second.specific_force + tau / 3 * instant.third.specific_force)
    )
    return Prediction(predicted.specific_force + force, predicted.angular_rate + rate)


def _rate_later(tau, instant, common):
    """What the angular rate gains in ``tau`` (n, 1) s.

    Where the gyroscopes' own turning is free, a delay against the accelerometers (``common``) has
    the mean of both turnings, any other its own.
    """
    turn, own = instant.motion.angular_acceleration, instant.gyroscope_turn
    if own is not None:
        return tau * (turn + own) / 2 if common else tau * own
    return tau * (
        turn + tau / 2 * (instant.second.angular_rate + tau / 3 * instant.third.angular_rate)
    )


@effect(
    "sensor_delay", unit="s", prior_sd=1e-3, shape=lambda a, g: (max(a, g),), derivatives=True,
    sampling=True,
)  # fmt: skip
def sensor_delay(delay, instant, predicted):
    """Both triads of IMU k sampled tau_k late; a delay common to all is the motion's."""
    return later(delay, instant, predicted)


@effect("gyroscope_delay", unit="s", prior_sd=2e-3, shape=lambda a, g: (g,), sampling=True)
def gyroscope_delay(delay, instant, predicted):
    """Gyroscope k sampled tau_k late, accelerometers in time (their filters differ)."""
    return later(delay, instant, predicted, accelerometers=False)


@effect(
    "sensor_clock", unit="s, Hz, 1, s, Hz/s", prior_sd=(1e-3, 50.0, 1.0, 1e-3, 1e-3),
    shape=lambda a, g: (max(a, g), 5), derivatives=True, sampling=True,
)  # fmt: skip
def sensor_clock(clock, instant, predicted):
    """IMU k's newest sample has age c + P (frac(n) - 1/2), n = f t + phi + g t'^2 / 2 turns.

    P, f, phi, c, g; t' is counted from the middle of the recording.
    """
    period, _, _, offset, _ = clock.T
    turns = clock_turns(clock.T, instant.time, instant.span)
    age = offset + period * (turns - jnp.floor(turns) - 0.5)
    return later(-age, instant, predicted)


def clock_turns(clock, time, span):
    """Turns of clocks (P, f, phi, c, g) against the host's, whose frequencies f drift by g."""
    _, frequency, phase, _, drift = clock
    return frequency * time + phase + drift / 2 * (time - span / 2) ** 2


DRIFT_SD = (((0.1,) * 4,) * 3, ((0.005,) * 4,) * 3)


@effect(
    "bias_drift", unit="m s-2 | rad s-1", prior_sd=DRIFT_SD,
    shape=lambda a, g: (max(a, g), 2, 3, 4),
)  # fmt: skip
def bias_drift(drift, instant, predicted):
    """Biases that are cubic polynomials of time: (accelerometer | gyroscope, axis, degree)."""
    x = 2.0 * instant.time / instant.span - 1.0
    legendre = jnp.stack([jnp.ones_like(x), x, 1.5 * x**2 - 0.5, 2.5 * x**3 - 1.5 * x])
    bias = drift @ legendre
    return Prediction(
        predicted.specific_force + bias[: len(predicted.specific_force), 0],
        predicted.angular_rate + bias[: len(predicted.angular_rate), 1],
    )


@effect(
    "position_shift", unit="m, m, m, s", prior_sd=(1e-3, 1e-3, 1e-3, 1e3),
    shape=lambda a, g: (a, 4), sensors="accelerometer", sampling=True,
)  # fmt: skip
def position_shift(shift, instant, predicted):
    """Triad k sits at r_k + d_k from the instant t_k on: d_k, t_k."""
    moved = jnp.where(instant.time >= shift[:, 3:], shift[:, :3], 0.0)
    here = kinematics.specific_force(instant.motion, instant.positions)
    there = kinematics.specific_force(instant.motion, instant.positions + moved)
    return predicted._replace(specific_force=predicted.specific_force + there - here)
