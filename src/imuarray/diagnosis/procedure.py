"""The whole procedure on one recording: readings, means, noise, what is left, who else it is."""

from collections.abc import Callable
from dataclasses import dataclass, field, replace

import numpy as np

from imuarray.diagnosis import noise_effects
from imuarray.diagnosis.adoption import adopt, proposals, rivals
from imuarray.diagnosis.final_checks import (
    beside_left,
    final_checks,
    leave_out_clips,
    with_gains,
    within_tolerance,
)
from imuarray.diagnosis.fit import Fit, fit
from imuarray.diagnosis.noise_effects import COLOURED, SCALES, TAILS
from imuarray.diagnosis.reading_effects import Finding, find_reading_faults
from imuarray.diagnosis.residual_checks import Check, all_checks
from imuarray.diagnosis.scores import Score
from imuarray.diagnosis.settings import SETTINGS
from imuarray.diagnosis.shocks import SHOCK, find_shocks, with_neighbours
from imuarray.diagnosis.state import Search, eliminate
from imuarray.engine.clocks import DELAY
from imuarray.engine.estimate import Recorded
from imuarray.engine.parameters import catalogue_effects, columns_of
from imuarray.engine.readings import Readings, arrange, determined, few_at_once, part_of
from imuarray.errors import InputError
from imuarray.model.effects import EFFECTS
from imuarray.recording import Recording
from imuarray.tails import log_poisson


@dataclass(frozen=True)
class ProcedureResult:
    """A diagnosis' end: its last `Search`, the base model's fit, tests, checks, all causes."""

    search: Search
    base: Fit
    base_scores: list[Score]
    reading_faults: list[Finding]
    in_noise: list[Finding]
    checks: list[Check]
    explained: float  # share of the base model's excess misfit
    unexplained: bool  # whether checks fail beyond tolerance
    raw: Readings  # the search's as recorded
    whole: Readings  # all, put right
    rivals: dict = field(default_factory=dict)  # {effect: ids of its class}


def run_procedure(
    recording: Recording, without=(), notify: Callable[[str], None] = lambda text: None
) -> ProcedureResult:
    """Find what the papers' model gets wrong; effects in ``without`` are not in the catalogue.

    InputError where a recording has too few moving samples.
    """
    raw, faults, whole, corrected = prepared(recording, without)
    if whole.pair:  # what it is held against, the rates' change, is alike from sample to sample
        without = (*without, COLOURED)
    most = SETTINGS.searched // max(len(whole.labels) // SETTINGS.large, 1)
    raw, readings = part_of(raw, most), part_of(whole, most)
    no_effects = columns_of(readings.array, (), readings.position_prior_sd)
    effects = catalogue_effects(without, Recorded.of(readings, no_effects).smooth)
    # clocks are scanned for by what a delay would gain, whether or not it is a candidate
    described = effects if DELAY in effects else (*effects, DELAY)
    columns = columns_of(readings.array, described, readings.position_prior_sd)
    notify("fitting the papers' model, then looking for causes")
    search = Search(readings, columns, effects, notify).fitted()
    base, scores = search.fit.only_active(), proposals(search)
    if not corrected:
        checks = all_checks(search.fit, search.given, search.noise)
        search, faults = search.with_sizes(), with_gains(search, raw, faults)
        return ProcedureResult(search, base, scores, faults, [], checks, 0.0, True, raw, whole)
    before, search = search.fit, drop_outliers(search)
    first = scores if search.fit is before else None
    del before  # it has derivatives of its own
    search = adopt(search, first).light()
    notify("fitting to the end")
    search = eliminate(search.refit(rough=False))
    search, faults = leave_out_clips(search, faults, without)
    notify("judging the noise")
    search = search.light()
    search = with_outliers(search)  # among which a clipped reading may be
    search, faults = leave_out_clips(search, faults, without)
    shock, used = unshaken(search, without)
    if not used.all():
        raw = raw.select(used)
        search, base = without_shocks(search, used)
    search, tailed, in_noise = fit_heavy_tails(search, without)
    if tailed:  # whose outliers may have hidden them
        search, faults = leave_out_clips(search, faults, without)
    notify("testing what is left")
    found, checks, named = ended(search, without, tailed)
    fewer = eliminate(found, [*in_noise, *shock, *named])
    if fewer is not found:
        found, checks, named = ended(fewer, without, tailed)
    search, in_noise = found, [*in_noise, *shock, *named]
    in_noise = [item for item in in_noise if gains(search, item)]
    explained, failing = within_tolerance(search, checks, in_noise)
    beside = len(in_noise) + len(search.causes) > 1
    in_noise = [x for x in in_noise if x.log_p <= SETTINGS.limit(x.effect, beside)]
    notify("looking for what cannot be distinguished")
    classes = {cause.effect: rivals(search, cause) for cause in search.causes}
    return ProcedureResult(
        search, base, scores, with_gains(search, raw, faults), in_noise, checks, explained,
        failing, raw, whole, classes,
    )  # fmt: skip


def ended(search: Search, without, tailed) -> tuple[Search, list[Check], list[Finding]]:
    """The search with the colour of its noise, the checks of what is left, causes in the noise."""
    search = fit_coloured_noise(search, without)
    checks = final_checks(search, tailed)
    untied = untied_by(checks)
    named = named_noise(search, without, tailed, untied)
    # slow noise looks tied to the motion, too, until it is known to be slow
    if search.smooth and not untied and COLOURED not in without:
        other = fit_coloured_noise(search, without, suspected=True)
        others = checks if other is search else final_checks(other, tailed)
        found = named_noise(other, without, tailed, True) if untied_by(others) else []
        limit = SETTINGS.limit(COLOURED, search.causes)
        if any(x.effect == COLOURED and x.log_p <= limit and gains(other, x) for x in found):
            return other, others, found
    return search, checks, named


def gains(search: Search, item: Finding) -> bool:
    """True of a clear gain on held-out time; a shock is in little of it."""
    return item.effect == SHOCK or item.gain > search.least_z * item.gain_se


def untied_by(checks: list[Check]) -> bool:
    """True where no check ties the residual to the motion."""
    return all(c.log_p >= SETTINGS.check for c in checks if c.name.startswith("residual"))


def prepared(recording: Recording, without):
    """(readings as recorded, causes in them, readings put right, whether they could be)."""
    raw = arrange(recording)
    reading_faults, readings, corrected = find_reading_faults(raw, without)
    used = determined(readings)
    if not used.all():
        raw, readings = raw.select(used), readings.select(used)
    return raw, reading_faults, readings, corrected


def with_outliers(search: Search) -> Search:
    """Refitted to all readings that count, once the means are known."""
    return replace(search, readings=replace(search.readings, keep=search.allowed)).refit()


def unshaken(search: Search, without) -> tuple[list, np.ndarray]:
    """Shocks, if there are any, and the samples (T,) bool to go on with."""
    every = np.ones(len(search.readings.time), bool)
    if SHOCK in without:
        return [], every
    shock, shaken = find_shocks(search.fit, SETTINGS.limit(SHOCK))
    if shock is None or not search.smooth:  # in rough motion clocks and lags show when shaken, too
        return [shock] if shock else [], every
    left = with_neighbours(shaken, search.readings.run, SETTINGS.beside_shocks)
    try:
        return [shock], determined(search.readings.without(left[:, None, None]))
    except InputError:  # too few are left
        return [shock], every


def without_shocks(search: Search, used) -> tuple[Search, Fit]:
    """The search gone on with in the samples ``used`` (T,) bool, and the base model's fit there."""
    search.notify(f"going on without shocks, in {used.sum()} of {used.size} samples")
    readings = replace(search.readings, keep=search.allowed).select(used)
    readings = readings.with_sd(readings.declared)
    fresh = Search(readings, search.columns, search.effects, search.notify)
    fresh = fresh.fitted()
    former = {name: getattr(search.fit.state, name) for name in ("positions", "parameters")}
    found = replace(fresh, causes=search.causes, trace=search.trace)
    found = adopt(drop_outliers(found.refit(fresh.fit.state._replace(**former))))
    return with_outliers(eliminate(found)), fresh.fit.only_active()


def drop_outliers(search: Search) -> Search:
    """Leave out isolated outliers while means are looked for, whatever their cause is."""
    if np.min(log_poisson(search.noise.outliers, search.noise.expected)) >= SETTINGS.limit(TAILS):
        return search
    far = np.repeat(search.noise.far, 3, axis=2)
    return replace(search, readings=search.readings.without(far)).refit()


def fit_heavy_tails(search: Search, without) -> tuple[Search, list, list]:
    """Heavy tails, left out of the fit: (search, triads as `heavy_tails` has them, causes)."""
    if TAILS in without:
        return search, [], []
    limit = SETTINGS.limit(TAILS)
    named, hits, others = noise_effects.heavy_tails(beside_left(search)[0], search.noise, limit)
    if named is None:
        return search, [], []
    left, before, search = hits, len(search.causes), search.light()
    for _ in range(SETTINGS.rounds if search.smooth else 1):
        far = (search.allowed & ~search.readings.keep & ~search.jumps)[..., ::3]
        for imu, kind, mix in left:
            far[:, imu, kind] |= mix.outlier > 0.5
        lost = np.repeat(few_at_once(far), 3, axis=2)
        search = replace(search, readings=search.readings.without(lost)).refit()
        # the farthest hide others, whose motion they have moved
        left = noise_effects.heavy_tails(beside_left(search)[0], search.noise, limit)[1]
        if not left:
            break
    if search.smooth:  # what is left of rough motion is faster than the samples, and no cause
        search = adopt(search)
    if len(search.causes) > before:
        search = eliminate(search)
    made = beside_left(search)[0]
    tailed = [(i, k, noise_effects.mixture(made, i, k)) for i, k, _ in hits + others]
    return search, tailed, [named]


def fit_coloured_noise(search: Search, without, suspected=False) -> Search:
    """Where the spectrum shows coloured noise, take its size and correlation from all of it.

    Or, if it is ``suspected``, where neighbours are alike and the spectrum does not contradict it.
    """
    if COLOURED in without:
        return search
    made = beside_left(search)[0]
    found = noise_effects.colours(made, search.noise)
    coloured = search.noise.correlation[tuple(found.triads.T)] != 0
    if noise_effects.pooled_autocorrelation(found) < SETTINGS.limit(COLOURED):
        coloured |= found.square > SETTINGS.clear**2
    if suspected:
        coloured |= noise_effects.neighbours_alike(found) < SETTINGS.limit(COLOURED)
    if not coloured.any():
        return search
    correlation, sd = search.noise.correlation.copy(), search.readings.sd.copy()
    own = tuple(found.triads[coloured].T)
    correlation[own] = found.rho[coloured]
    sd[own] *= np.sqrt(found.power[coloured])
    readings = search.readings.with_sd(sd)
    made = fit(readings, search.columns, search.active, search.fit.state, search.smooth)
    noise = search.noise._replace(correlation=correlation, sd=sd)
    return replace(search, readings=readings).ending(made, noise)


def named_noise(search: Search, without, tailed, untied: bool) -> list[Finding]:
    """Scale and colour of the noise, where they depart from what is declared."""
    found, made, readings = [], beside_left(search)[0], search.readings
    for kind, name in enumerate(SCALES):
        if name not in without:
            limit, least = SETTINGS.limit(name), least_ratios(search)
            # the mixture's core is the noise of a triad with heavy tails
            for imu, _, mix in (item for item in tailed if item[1] == kind):
                core = mix.core * readings.sd[imu, kind] / readings.declared[imu, kind]
                least[imu] = np.inf if abs(np.log(core)) < SETTINGS.tailed else least[imu]
            found.append(noise_effects.noise_scale(made, search.noise, kind, limit, least, untied))
    if COLOURED not in without:
        limit = SETTINGS.limit(COLOURED)
        found.append(noise_effects.coloured(made, search.noise, limit, untied))
    return sorted(filter(None, found), key=lambda item: item.log_p)


def least_ratios(search: Search) -> np.ndarray:
    """Log ratios of noise not to be believed (N,): delays carry the derivatives' own noise."""
    least = np.zeros(len(search.readings.labels))
    sizes = np.abs(search.columns.flat(search.fit.state)) / search.columns.prior_sd
    for cause in search.causes:
        if EFFECTS[cause.effect].shifts_time:
            delay, imus = search.columns.of(cause.effect)[0], list(cause.imus)
            own = SETTINGS.delayed * np.minimum(sizes[imus, delay], 1.0)
            least[imus] = np.maximum(least[imus], own)
    return least
