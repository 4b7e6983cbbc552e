"""Effects in time: delays, clocks, drifts, shifts; ids are those of the catalogue.

A reading taken at t + tau is the ideal one plus tau times its derivative, and the second and third
order where the recording's smooth motion determines them (`Instant`).
"""

import numpy as np

from imuarray.model import kinematics
from imuarray.model.effects import KINDS, Prediction, common_mean, each_mean, effect
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
    """Gain of the angular rate in ``tau`` (n, 1) s.

    Where the angular acceleration seen by the gyroscopes is free, a delay against the
    accelerometers (``common``) is the integral between both, any other has the gyroscopes'.
    """
    turn, own = instant.motion.angular_acceleration, instant.gyroscopes
    if own is not None:
        jerk = own.jerk is not None
        bent = own.jerk - instant.motion.angular_jerk if jerk else 0.0
        if common:
            return tau * ((turn + own.acceleration) / 2 - tau / 12 * bent)
        return tau * (own.acceleration + (tau / 2 * own.jerk if jerk else 0.0))
    second, third = instant.second.angular_rate, instant.third.angular_rate
    if common and instant.slow is not None:  # the rate is theirs: noise would feed on itself
        slow = jnp.abs(tau) > LONG
        second = jnp.where(slow, instant.slow.second.angular_rate, second)
        third = jnp.where(slow, instant.slow.third.angular_rate, third)
    return tau * (turn + tau / 2 * (second + tau / 3 * third))


DELAY = (("delay",),)
# s, a lag of gyroscopes that is a filter's: a low pass droops by half its square, and such a square
# takes derivatives with little noise.
LONG = 2e-3


@effect(
    "sensor_delay", unit="s", prior_sd=1e-3, shape=lambda a, g: (max(a, g),), derivatives=True,
    sampling=True, gauge=common_mean, components=DELAY, against="angular acceleration",
    meaning="whole IMUs are read at instants of their own",
)  # fmt: skip
def sensor_delay(delay, instant, predicted):
    """Both triads of IMU k show the motion at t + tau_k; what is common to all is the motion's."""
    return later(delay, instant, predicted)


@effect(
    "gyroscope_delay", unit="s", prior_sd=2e-3, shape=lambda a, g: (g,), sampling=True,
    components=DELAY, against="angular acceleration",
    meaning="gyroscopes sample at another instant than accelerometers, later for delays > 0",
)  # fmt: skip
def gyroscope_delay(delay, instant, predicted):
    """Gyroscope k shows the motion at t + tau_k, accelerometers at t (their filters differ)."""
    return later(delay, instant, predicted, accelerometers=False)


FILTER = {"derivatives": True, "sampling": True, "smooth": True}


@effect(
    "gyroscope_filter", unit="s2, s3", prior_sd=(3e-6, 2e-8), common_sd=(3e-5, 2e-7),
    shape=lambda a, g: (g, 2), components=(("droop", "skew"),), beside="gyroscope_delay", **FILTER,
    against="angular acceleration",
    meaning="the gyroscopes' filter differs from the accelerometers' by more than a delay",
)  # fmt: skip
def gyroscope_filter(shape, instant, predicted):
    """The rate, with a times its second and b times its third derivative: droop, bent phase.

    The ratio of two filters in powers of s beside the delay: of low passes of first order with
    time constants p of gyroscopes and q of accelerometers a = (p^2 - q^2) / 2.
    """
    slow, own = instant.slow, instant.gyroscopes
    if slow is None:
        jerk = instant.motion.angular_jerk if own is None or own.jerk is None else own.jerk
        return predicted._replace(angular_rate=predicted.angular_rate + shape[:, :1] * jerk)
    bend = shape[:, :1] * slow.second.angular_rate + shape[:, 1:] * slow.third.angular_rate
    return predicted._replace(angular_rate=predicted.angular_rate + bend)


@effect(
    "accelerometer_filter", unit="s, s2, s3", prior_sd=(2e-3, 3e-5, 3e-7),
    shape=lambda a, g: (a, 3), components=(("lag", "droop", "skew"),), gauge=each_mean, **FILTER,
    against="specific force", meaning="accelerometers have filters of their own",
)  # fmt: skip
def accelerometer_filter(shape, instant, predicted):
    """The force, with its derivatives times shares of each triad; the mean is the motion's."""
    bend = shape[:, :1] * kinematics.force_rate(instant.motion, instant.positions)
    if instant.slow is not None:
        second, third = (one.specific_force for one in instant.slow)
        bend += shape[:, 1:2] * second + shape[:, 2:] * third
    return predicted._replace(specific_force=predicted.specific_force + bend)


@effect(
    "accelerometer_band", unit="s2", prior_sd=3e-6, common_sd=5e-5, shape=lambda a, g: (a, 1),
    components=(("spread",),), smooth=True, against="angular acceleration",
    meaning="the sensors' filters average over a time in which the rate changes",
)  # fmt: skip
def accelerometer_band(spread, instant, predicted):
    """u + v omega_dot x (omega_dot x r), v the variance of the filter's delay.

    A filter passes the rate's square, not the square of the rate that it passes, whichever of the
    sensors have it; a low pass of first order with time constant tau has v = tau^2.
    """
    turn = instant.motion.angular_acceleration
    square = jnp.cross(turn, jnp.cross(turn, instant.positions))
    return predicted._replace(specific_force=predicted.specific_force + spread * square)


CLOCK = ("period", "frequency", "phase", "offset", "drift")


# A sawtooth jumps, so a scan fixes its frequency, phase and drift. So many sawtooths are tried that
# its test has a tail of its own (`benchmarks/thresholds.py`). Where the motion is rough a period
# and the fast angular acceleration that it multiplies are one. The mean age of all IMUs is the
# motion's.
@effect(
    "sensor_clock", unit="s, Hz, 1, s, Hz/s", prior_sd=(1e-3, 50.0, 1.0, 1e-3, 1e-3),
    shape=lambda a, g: (max(a, g), 5), derivatives=True, sampling=True, scanned=True,
    held=(1, 2, 4), held_rough=(0,), critical=-12.0, components=(CLOCK,),
    gauge=lambda shape, axes: [np.broadcast_to(np.array(CLOCK) == "offset", shape)],
    contains=("sensor_delay",), resembles=("gyroscope_delay",), against="age", own=True,
    meaning="the IMUs sample on clocks of their own, so that a reading's age is a sawtooth",
)  # fmt: skip
def sensor_clock(clock, instant, predicted):
    """IMU k's newest sample has age c + P (frac(n) - 1/2), n = f t + phi + g t'^2 / 2 turns.

    P, f, phi, c, g; t' is counted from the middle of the recording.
    """
    period, _, _, offset, _ = clock.T
    turns = clock_turns(clock.T, instant.time, instant.span)
    age = offset + period * (turns - jnp.floor(turns) - 0.5 + instant.clock_deviation)
    return later(-age, instant, predicted)


def clock_turns(clock, time, span):
    """Turns of clocks (P, f, phi, c, g) against the host's, whose frequencies f drift by g."""
    _, frequency, phase, _, drift = clock
    return frequency * time + phase + drift / 2 * (time - span / 2) ** 2


DRIFT_SD = (((0.1,) * 4,) * 3, ((0.005,) * 4,) * 3)


def _drift_form(kind, highest):
    """True of a parameter of a kind of sensor, and of no higher degree."""
    return lambda place: place[0] == kind and place[2] <= highest


@effect(
    "bias_drift", unit="m s-2 | rad s-1", prior_sd=DRIFT_SD,
    shape=lambda a, g: (max(a, g), 2, 3, 4), contains=("accelerometer_bias", "gyroscope_bias"),
    components=(KINDS, ("x", "y", "z"), tuple(f"degree{degree}" for degree in range(4))),
    forms=tuple(
        (f"{name} {form}", _drift_form(kind, highest))
        for kind, name in enumerate(KINDS) for form, highest in (("linear", 1), ("cubic", 3))
    ),
    meaning="an offset changes through the recording", against="time", own=True, sized=True,
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
    "warm_up", unit="m s-2, m s-2, m s-2, rad s-1, rad s-1, rad s-1, s-1, 1",
    prior_sd=(0.05, 0.05, 0.05, 0.005, 0.005, 0.005, 0.01, 1.0), shape=lambda a, g: (max(a, g), 8),
    scanned=True, held=(6, 7), against="time", own=True,
    resembles=("bias_drift", "accelerometer_bias", "gyroscope_bias"),
    components=((*(f"{kind}_{axis}" for kind in KINDS for axis in "xyz"), "pace", "zero"),),
    meaning="the offsets of all sensors follow one temperature",
)  # fmt: skip
def warm_up(values, instant, predicted):
    """Biases c (f - z) in all triads, f = (1 - e^(-p t)) / (1 - e^(-p T)) from 0 to 1: c, p, z."""
    warmth = warming(values[:, 6:7], instant.time, instant.span) - values[:, 7:]
    force, rate = predicted
    bias = warmth * values[:, :6]
    return Prediction(force + bias[: len(force), :3], rate + bias[: len(rate), 3:])


def warming(pace, time, span):
    """The course f of a warm-up at a ``pace`` (1/s): from 0 to 1, straight at 0, late below it."""
    steady = jnp.abs(pace * span) < 1e-6
    bent = jnp.where(steady, 1.0, pace)
    return jnp.where(steady, time / span, jnp.expm1(-bent * time) / jnp.expm1(-bent * span))


@effect(
    "position_shift", unit="m, m, m, s", prior_sd=(1e-3, 1e-3, 1e-3, 1e3),
    shape=lambda a, g: (a, 4), sensors="accelerometer", sampling=True, scanned=True, held=(3,),
    components=(("x", "y", "z", "time"),), against="place",
    meaning="a triad moved on the board during the recording", own=True,
)  # fmt: skip
def position_shift(shift, instant, predicted):
    """Triad k sits at r_k + d_k from the instant t_k on: d_k, t_k."""
    moved = jnp.where(instant.time >= shift[:, 3:], shift[:, :3], 0.0)
    here = kinematics.specific_force(instant.motion, instant.positions)
    there = kinematics.specific_force(instant.motion, instant.positions + moved)
    return predicted._replace(specific_force=predicted.specific_force + there - here)
