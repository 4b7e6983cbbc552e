"""Is an answer to be trusted? Sentences why not; none for a sound one (docs/trust.md).

An answer that fits its own noise can still be wrong: units, signs, exchanged sensors and clocks
leave no residual. What is known besides is the drawing, that rates and forces are of one motion,
and that still poses show gravity.
"""

import re
from collections.abc import Sequence

import numpy as np
import xarray as xr

from imuarray.model.effects import EFFECTS, KINDS
from imuarray.recording import Recording
from imuarray.recording.channels import repeated
from imuarray.trust.checked import effect_names, reasons_in, values_of
from imuarray.trust.drawing import Places, another_size, departures, factor_words, size_of
from imuarray.trust.misfit import LOOSE, changed, is_papers, residuals, rigid, unfitting, unsteady
from imuarray.trust.rigid import Slope, elsewhere, kept, slope, turning
from imuarray.trust.settings import SETTINGS
from imuarray.trust.suspects import MIRRORED, clipped, common, gravity, wrapped

UNIT = re.compile(r"\bin \S+ declared ")  # in a reason that names a unit
AS_READ = (
    "the recording is as read, and was corrected as the calibration's own was: offsets that have"
    " changed since are not seen; correct it by three still poses or more of its own (imuarray"
    " first-order new.nc --with old.nc, the calibration's recording as read)"
)


def reasons_of_calibration(
    recordings: Recording | Sequence[Recording], calibration: xr.Dataset, known: Sequence[str] = ()
) -> list[str]:
    """Why `imuarray.calibrate`'s answer for these recordings is not to be trusted.

    The root first. A unit that is named is the root of the rest, which is left out but for what is
    ``known`` already; else a recording that says little, then what is known, then filters too far
    apart, then what follows. That the search ends nowhere follows from either.
    """
    several = [recordings] if isinstance(recordings, Recording) else list(recordings)
    found: dict[str, list[str]] = {}
    little: list[str] = []
    limit = SETTINGS.residual if is_papers(calibration) else SETTINGS.triad_residual
    filters = _filters(calibration)
    for number, recording in enumerate(several, 1):
        places = _places_of(recording, calibration)
        residual = residuals(recording, calibration, places)
        if len(several) == 1:
            little = _little(recording, places)
        reasons = _judged(recording, places, residual, limit)
        units = [reason for reason in reasons if UNIT.search(reason)]
        reasons += _drifts(recording) if is_papers(calibration) else []
        for reason in [*units, *known] if units else [*little, *known, *filters, *reasons]:
            found.setdefault(reason, []).append(str(number))
    reasons = [
        reason if len(whose) == len(several) else f"recording {', '.join(whose)}: {reason}"
        for reason, whose in found.items()
    ]
    own = not is_papers(calibration)  # what that model misses looks like anything
    if own:
        reasons += _moved_maps(calibration) + changed(calibration)
        reasons += _grows(calibration) + _arms(calibration)
    if own and not reasons:
        corrected = all(one.correction is not None for one in several)
        reasons = unsteady(calibration, corrected, len(several))
    root = little or any(map(UNIT.search, found))
    return reasons + ([] if root else _not_converged(calibration.attrs))


def _filters(calibration: xr.Dataset) -> list[str]:
    """Words on filters too slow, or too far apart, for their first powers of frequency."""
    names = "gyroscope_delay delay", "gyroscope_filter droop", "accelerometer_band spread"
    lag, droop, spread = (
        float(np.mean([*values_of(calibration, name).values()] or 0.0)) for name in names
    )
    lower = int(lag < 0)
    if abs(droop) > SETTINGS.droop:
        what = f"far below the {KINDS[1 - lower]}s'"
        return [_low(f"the {KINDS[lower]}s' low pass", abs(droop), what)]
    if spread / 2 > SETTINGS.droop:
        return [_low("the low pass of all sensors", spread / 2, "too low for this motion")]
    late, droops = (values_of(calibration, f"accelerometer_filter {x}") for x in ("lag", "droop"))
    each = {
        name.partition("_")[2]: x - y**2 / 2
        for (name, x), y in zip(droops.items(), late.values(), strict=True)
    }
    usual = np.median([*each.values()] or 0.0)
    return [
        _low(f"the low pass of accelerometer {k}", float(x - usual), "far below the others'")
        for k, x in each.items() if x - usual > SETTINGS.droop
    ]  # fmt: skip


def _arms(calibration: xr.Dataset) -> list[str]:
    """Words on lever arms that no chip has room for: another error was taken for one."""
    arms = values_of(calibration, "size_effect ")
    worst = max(arms, key=lambda name: abs(arms[name]), default="")
    if not worst or abs(arms[worst]) < SETTINGS.package:
        return []
    axis, _, label = worst.partition("_")
    return [
        f"axis {axis[0]} of accelerometer {label} comes out {1e3 * abs(arms[worst]):.2g} mm from"
        " the others', farther than a chip has room for: an error that this model does not know"
    ]


def _low(whose: str, droop: float, what: str) -> str:
    corner = 1 / (2 * np.pi * np.sqrt(2 * droop))
    return (
        f"{whose}, of some {corner:.2g} Hz or less, is {what}: set the chips to filters alike, and"
        " to a larger bandwidth"
    )


def _moved_maps(calibration: xr.Dataset) -> list[str]:
    """Words on maps that still poses gave and the twisting contradicts.

    All others' at once are rather the first accelerometer's, in whose axes they are.
    """
    first, *others = (str(label) for label in calibration["accelerometer"].to_numpy())
    found = []
    for kind in KINDS:
        if not calibration.attrs.get(f"{kind}_maps_hold", 1.0) < SETTINGS.maps_chance:
            continue
        named = calibration.attrs[f"{kind}_maps_farthest"]
        if kind == "accelerometer" and len(others) > 1 and set(named.split(", ")) == {*others}:
            named = f"{first} (in its axes {named} all differ)"
        found.append(
            f"the map that still poses gave {kind} {named} does not hold while the board is"
            " twisted: did it turn or come loose in between, or does its scale change with the"
            " rate, the force or the warmth, or is its filter another one? Record again, poses"
            " before and after"
        )
    return found


def _grows(calibration: xr.Dataset) -> list[str]:
    """Words on an array that does not keep its size: its accelerometers do not move, but for one.

    One IMU that moves explains it where it explains more.
    """
    growth, sd = (calibration.attrs.get(f"size_growth{name}", 0.0) for name in ("", "_sd"))
    if not abs(growth) > SETTINGS.growth * sd:
        return []
    if calibration.attrs.get("farthest_move", 0.0) > (growth / sd) ** 2 + SETTINGS.alone:
        by = f"disagree on the place of IMU {calibration.attrs['farthest_moved']}: "
        return [f"parts of the recording {by}{LOOSE}"]
    grows, change = ("grows", "fall") if growth > 0 else ("shrinks", "rise")
    return [
        f"the array {grows} by {100 * abs(growth):.2g} % while it moves: do the gyroscopes' scales"
        f" {change} with the warmth? Let the board warm up and record again"
    ]


def _drifts(recording: Recording) -> list[str]:
    """Words on drifts that a model with steady offsets leaves out, where first order saw them."""
    if recording.correction is None:
        return []
    walk = float(recording.correction["accelerometer_offset_walk"].max())
    time = recording.time[~recording.still()]
    far = walk * np.sqrt(np.mean(np.abs(time - np.median(time)))) if len(time) else 0.0
    if not far > SETTINGS.drift * recording.accelerometer_noise_sd / np.sqrt(max(len(time), 1)):
        return []
    return [
        f"accelerometers' offsets drift by some {far:.2g} m/s^2 between the samples, and this model"
        " takes them to be steady: take imuarray calibrate without --model papers, or let the board"
        " warm up and record again"
    ]


def reasons_of_posterior(
    recording: Recording, posterior: xr.DataTree, spread: bool = False
) -> list[str]:
    """Why `imuarray.sample`'s answer for this recording is not to be trusted.

    ``spread``: whether the gyroscopes' disagreement is allowed for.
    """
    draws = np.concatenate(posterior["posterior"]["position"].to_numpy())  # of r_2 ... r_A
    draws = np.insert(draws, 0, 0.0, axis=1)
    covariance = np.cov(draws.reshape(len(draws), -1), rowvar=False)
    places = _places(recording, draws.mean(axis=0), covariance)
    plain = "effect_parameter" not in posterior["posterior"]
    noise = [f"{kind}_noise_sd" for kind in KINDS]
    residual = (
        rigid(recording, places, spread) if plain
        else {"": max(posterior.attrs[name] / getattr(recording, name) for name in noise)}
    )  # fmt: skip
    found = _little(recording, places) + _judged(recording, places, residual) + _drifts(recording)
    return found + _not_converged(posterior.attrs)


def reasons_of_motion(
    recording: Recording, calibration: xr.Dataset, own_clocks: bool = False, as_read: bool = False,
    ratio: float = np.nan,
) -> list[str]:  # fmt: skip
    """Why the motion that `imuarray.apply` gives for this recording is not to be trusted.

    A calibration that is not, or that this recording does not fit, as one of another board.
    ``own_clocks``: whether `imuarray.apply` has found the recording's own; ``as_read``: whether it
    had to correct the readings as the calibration's were; ``ratio``: its residual over noise
    under the calibration's effects.
    """
    said, places = reasons_in(calibration), _places_of(recording, calibration)
    residual = {"": ratio} if effect_names(calibration) else rigid(recording, places)
    found = _judged(recording, places, residual) + elsewhere(kept(recording), places.found)
    found += _of_another_time(recording, calibration, own_clocks)
    found += [AS_READ] if as_read else []
    return [f"the calibration is not to be trusted: {reason}" for reason in said] + [
        reason for reason in found if reason not in said
    ]


def reasons_of_diagnosis(recording: Recording, document: dict) -> list[str]:
    """Why the extended model of a ``diagnosis.json``'s document is not to be trusted.

    What its residual leaves unexplained the diagnosis says itself.
    """
    found, sds = (np.array(document["extended"][f"positions_{name}"]) for name in ("m", "sd_m"))
    places = _places(recording, found, np.diag(sds.ravel() ** 2))
    return _little(recording, places) + _judged(recording, places, {})


def _places_of(recording: Recording, calibration: xr.Dataset) -> Places:
    found, whole = (calibration[f"position{part}"].to_numpy() for part in ("", "_covariance"))
    return _places(recording, found, whole.reshape((found.size,) * 2))


def _places(recording: Recording, found, covariance) -> Places:
    labels, prior = recording.accelerometer_labels, recording.position_prior_sd
    return Places(labels, found, recording.relative_positions(), covariance, prior)


def _not_converged(attrs) -> list[str]:
    return [] if attrs.get("converged", 1) else ["the search or the chains have not converged"]


def _judged(
    recording: Recording, places: Places, residual: dict[str, float],
    limit: float = SETTINGS.residual,
) -> list[str]:  # fmt: skip
    """All tests; where a sensor does not fit the others, its place is no matter.

    ``limit``: of the residual of one triad.
    """
    moving = kept(recording)
    found = repeated(recording) + gravity(recording)
    if len(moving.time) < SETTINGS.few_samples:
        return found + _drawn(places, None)
    found += clipped(moving) + wrapped(moving)
    alike = another_size(places) or common(moving)
    if alike:
        return [*found, alike]
    bad, named = unfitting(residual, moving, limit)
    if named:
        return found + bad
    rate = np.median(moving.angular_rate, axis=1)
    course = slope(moving.time, turning(moving.specific_force, rate, places.found))
    return found + bad + _drawn(places, course)


def _drawn(places: Places, course: Slope | None) -> list[str]:
    """Positions against the drawing, rates against accelerometers."""
    if course is None:
        said = [departures(places)]
    else:
        known = abs(course.correlation) >= SETTINGS.coherent
        hand = int(np.sign(course.correlation)) if known else 0
        change = _turning_words(course, places) if course.off else None
        lost = (
            f"samples were dropped: {course.skipped} steps or more between rows are twice as long,"
            " by the motion, as their stamps or the declared rate say; log the sensors' own stamps"
        )
        said = [lost * bool(course.skipped), departures(places._replace(hand=hand)), change]
    return [sentence for sentence in said if sentence]


def _little(recording: Recording, places: Places) -> list[str]:
    """One sentence where the positions are hardly known from the recording.

    By their sds, and by what centrifugal forces alone could tell: what noise is taken for
    angular acceleration makes sds that are too small.
    """
    rates = [np.median(part.angular_rate, axis=1) for part in recording.parts()]
    speed = np.linalg.norm(np.concatenate(rates), axis=1)
    bound = recording.accelerometer_noise_sd / np.sqrt(max(np.sum(speed**4), 1e-300))
    size, prior = 3 * (len(places.found) - 1), places.prior_sd
    rms = max(np.sqrt(np.trace(places.covariance) / size), bound)
    if rms < SETTINGS.learnt * prior:
        return []
    seconds, more = float(np.ptp(recording.time)), "turn the array faster, and about all axes"
    if seconds < SETTINGS.short:
        more = f"{seconds:.2g} s are too short: record a dozen still poses and a minute of twisting"
    return [
        f"the recording says little of the positions: they are known to {1e3 * rms:.2g} mm by it,"
        f" to {1e3 * prior:.2g} mm by the drawing; {more}"
    ]


def _of_another_time(recording: Recording, calibration: xr.Dataset, own_clocks: bool) -> list[str]:
    """One sentence where clocks and drifts of the calibration are those of another recording."""
    known = [name for name in effect_names(calibration) if name in EFFECTS]
    # a recording's own effect whose function reads the time differs between instants
    own = [(name, EFFECTS[name].apply) for name in known if EFFECTS[name].own]
    effects = [name for name, apply in own if apply and "time" in apply.__code__.co_names]
    if own_clocks:
        effects = [n for n in effects if not (EFFECTS[n].scanned and EFFECTS[n].shifts_time)]
    if not effects or _is_of(recording, calibration):
        return []
    return [
        f"the calibration has {', '.join(effects)}, at the instants of its own (first) recording:"
        " calibrate this one, too, and apply that"
    ]


def _is_of(recording: Recording, calibration: xr.Dataset) -> bool:
    """True where the calibration is of this recording, or of one that this is a part of."""
    if "angular_rate" not in calibration:
        return False
    time = calibration["time"].to_numpy()
    inside = (time >= recording.time[0]) & (time <= recording.time[-1])
    if inside.sum() < min(SETTINGS.few_samples, len(recording.time)):
        return False
    rate, there = np.median(recording.angular_rate, axis=1), calibration["angular_rate"].to_numpy()
    here = np.stack([np.interp(time[inside], recording.time, axis) for axis in rate.T], axis=1)
    off, size = (np.median(np.abs(x)) for x in (here - there[inside], there[inside]))
    return bool(off < SETTINGS.same_rate * size)


def _turning_words(course: Slope, places: Places) -> str:
    """A slope that is not 1 is the clock's or the gyroscopes'; the array's size may tell them."""
    if course.correlation < 0:
        return f"{MIRRORED}?"
    value = course.low if course.low > 1 else course.high
    size, sd = size_of(places)
    causes = []
    if abs(size - value**2) < SETTINGS.far * sd:
        causes.append(f"gyroscopes {factor_words(1 / value)}")
    if abs(1000 * value - 1) < SETTINGS.far * SETTINGS.slope:
        causes.append("time in ms declared s")
    elif abs(size - 1) < SETTINGS.far * sd or not causes:
        causes.append(f"steps of time {factor_words(1 / value)}")
    return (
        f"the rates change {value:.4g} times as fast as the accelerometers' angular acceleration"
        f" says: {' or '.join(causes)}?"
    )
