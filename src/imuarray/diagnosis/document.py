"""The four answers on one recording: what is wrong, why, the extended model, what it gains."""

import json
from collections.abc import Callable
from dataclasses import dataclass, replace
from itertools import product
from pathlib import Path

import numpy as np

import imuarray
from imuarray import words
from imuarray.diagnosis.fit import Fit, fit, log_scores
from imuarray.diagnosis.noise import observable, per_triad, standardised
from imuarray.diagnosis.noise_effects import COLOURED
from imuarray.diagnosis.procedure import ProcedureResult, run_procedure
from imuarray.diagnosis.reading_effects import Finding
from imuarray.diagnosis.replicates import Discrepancy, discrepancies
from imuarray.diagnosis.scores import Information, information_at
from imuarray.diagnosis.settings import SETTINGS
from imuarray.diagnosis.shocks import SHOCK
from imuarray.diagnosis.special import placebo_gain
from imuarray.diagnosis.state import Cause, Search, heldout_gain, need
from imuarray.engine.estimate import Estimate
from imuarray.engine.forward import resumed
from imuarray.engine.heldout import Scores, gain
from imuarray.engine.parameters import POSITION
from imuarray.engine.settings import SETTINGS as ENGINE
from imuarray.engine.widths import widths
from imuarray.linear import scaled_inverse
from imuarray.model.array_model import component, unit_of
from imuarray.model.effects import DATA_EFFECTS, KINDS, known_effect
from imuarray.recording import Recording
from imuarray.recording.channels import require_live
from imuarray.streams import stream
from imuarray.threads import one_thread

LEAST = -1e6  # log p; JSON has no infinity


@dataclass(frozen=True)
class Fitted:
    """A model of the recording: its fit, its score on held-out time, its positions."""

    fit: Fit
    scores: Scores
    sds: np.ndarray  # (N, m) of the parameters
    discrepancies: tuple[Discrepancy, ...] = ()
    robust: Estimate | None = None  # of the same model, which the positions are taken from

    @property
    def positions(self) -> tuple[np.ndarray, np.ndarray]:
        """(A, 3) m relative to the first triad, and their sds."""
        found = self.fit.state.positions
        if self.robust is None:
            return found, self.sds[: len(found), self.fit.columns.of(POSITION)]
        sds = np.sqrt(np.diag(widths(self.robust)[0]))
        whole = np.zeros(self.robust.active.shape)
        whole[self.robust.active] = sds[self.robust.places[0]]
        return self.robust.positions, whole[: len(found), self.robust.columns.of(POSITION)]

    def section(self) -> dict:
        """Section of `diagnosis.json`."""
        positions, sds = self.positions
        return {
            "heldout_log_score_per_sample": self.scores.per_sample,
            "residual_sd": residual_sd(self.fit),
            "positions_m": positions.tolist(),
            "positions_sd_m": sds.tolist(),
        }


@dataclass(frozen=True)
class Diagnosis:
    """A diagnosis as `imuarray diagnose` writes it and as its figures draw it."""

    document: dict
    recording: Recording
    found: ProcedureResult
    base: Fitted  # the papers' model with the declared noise
    inflated: Fitted  # the same with the noise that its residual shows (paper 2021's way out)
    extended: Fitted  # with the causes

    def to_json(self) -> str:
        """diagnosis.json."""
        return json.dumps(self.document, indent=1, allow_nan=False)


@one_thread()
def diagnose(
    recording: Recording, seed: int = 0, without=(), recording_path: str | Path = "",
    notify: Callable[[str], None] = lambda text: None, replicates: int = SETTINGS.replicates,
) -> Diagnosis:  # fmt: skip
    """Test the papers' model on a recording and extend it.

    ``without``: effects left out of the catalogue. InputError for too few moving samples, for
    constant and for copied channels.
    """
    require_live(recording)
    found = run_procedure(recording, without, notify)
    search = found.search
    notify("fitting the papers' model to the same readings")
    extended = fitted(search.fit, search.given)
    nats = extended.scores.nats + nats_beside(found)
    notify("estimating the extended model's positions")
    robust = resumed(found.whole, search.columns, search.active, search.fit.state)
    extended = replace(extended, scores=extended.scores._replace(nats=nats), robust=robust)
    base, inflated = rivals_of(found)
    rng = stream(seed, "diagnose", "replicates")
    notify("replicating the recording")
    base, extended = (
        replace(m, discrepancies=discrepancies(m.fit, rng, replicates)) for m in (base, extended)
    )
    document = {
        "recording": str(recording_path),
        "seed": int(seed),
        "version": imuarray.__version__,
        "samples": len(search.readings.time),
        "clock": {"origin_s": float(recording.time[0]), "span_s": search.readings.span},
        "base": base.section(),
        "discrepancies": [d._asdict() for d in base.discrepancies],
        "causes": causes_of(found, extended.sds),
        "unexplained": bool(found.unexplained),
        "smooth": smooth_samples(robust, found),
        "remaining": [c.name for c in found.checks if c.log_p < SETTINGS.check],
        "inflated": inflated.section(),
        "extended": extended.section(),
        "discrepancies_after": [d._asdict() for d in extended.discrepancies],
        "noise_sd": noise_of(found),
        "gain": gains(base, inflated, extended),
        "detectable": search.detectable,
    }
    return Diagnosis(document, recording, found, base, inflated, extended)


def smooth_samples(robust: Estimate, found: ProcedureResult) -> dict | None:
    """Residual over the declared noise of each triad in the smooth samples of rough motion.

    ``unexplained``: more is left than shocks explain, in the rms over the triads of a kind.
    """
    ratios = robust.smooth_ratio()
    if ratios is None:
        return None
    exists, labels = found.whole.exists, found.whole.labels
    shaken = any(item.effect == SHOCK for item in found.in_noise)
    sizes = [float(np.sqrt(np.mean(ratios[mine, k] ** 2))) for k, mine in enumerate(exists.T)]
    out: dict = {"unexplained": not shaken or max(sizes) > SETTINGS.calm}
    for k, kind in enumerate(KINDS):
        mine = np.flatnonzero(exists[:, k])
        out[kind] = {"residual": sizes[k], "of": {labels[i]: float(ratios[i, k]) for i in mine}}
    return out


def nats_beside(found: ProcedureResult) -> np.ndarray:
    """Nats of each held-out block that the extended fit's own score does not have, (blocks,).

    Outliers are in no model's score, so what a mixture gains on them stands with its cause alone.
    """
    # a fit's score takes noise for white
    beside = [item.blocks for item in found.in_noise if item.effect == COLOURED]
    # nor has any model's score the readings left out; exchanged axes are in the rivals' scores,
    # which take the readings as they are
    beside += [x.blocks for x in found.reading_faults if DATA_EFFECTS[x.effect].left_out]
    return sum((blocks for blocks in beside if np.sum(blocks) > 0), np.zeros(ENGINE.blocks))


def fitted(made: Fit, given: Information | None = None) -> Fitted:
    """A fit with its held-out score and its parameters' sds (the sandwich's in coloured noise).

    ``given``: the information there, if it is known.
    """
    given = information_at(made) if given is None else given
    # gauges are pinned for the fit; what is known of them is what the priors say
    places, ridge = given.places(made.active), np.diag(given.ridge[given.places(made.active)])
    inner = given.information[np.ix_(places, places)]
    covariance = scaled_inverse(inner + ridge)
    if given.meat is not None:
        middle = given.meat[np.ix_(places, places)] + ridge
        covariance = covariance @ middle @ covariance
    sds = np.zeros(made.active.shape)
    sds[made.active] = np.sqrt(np.maximum(np.diag(covariance), 0.0))
    return Fitted(made, log_scores(made), sds)


def rivals_of(found: ProcedureResult) -> tuple[Fitted, Fitted]:
    """The papers' model on the extended model's readings: declared noise, and inflated."""
    search, options = found.search, {"rough": True, "all_columns": False}
    alone = search.columns.mask([POSITION])
    start = found.base.state._replace(parameters=np.zeros_like(found.base.state.parameters))
    # as read: the rivals know neither of rails nor of repeats nor of exchanged axes
    declared_noise = replace(search.readings, sd=search.readings.declared, values=found.raw.values)
    declared = fit(declared_noise, search.columns, alone, start, search.smooth, **options)
    known = observable(declared_noise, declared.basis)[..., None]
    squares = np.where(known, per_triad(standardised(declared)) ** 2, 1.0)
    inflated_sd = declared_noise.declared * np.maximum(np.sqrt(np.nanmean(squares, axis=-1)), 1e-3)
    wide = declared_noise.with_sd(inflated_sd)
    again = fit(wide, search.columns, alone, declared.state, search.smooth, **options)
    return fitted(declared), fitted(again)


def residual_sd(made: Fit) -> dict:
    """rms of the residual in m/s^2 and rad/s, corrected for what the motion takes up."""
    si = standardised(made) * np.repeat(made.readings.sd, 3, axis=1)
    parts = {"specific_force": si[..., :3], "angular_rate": si[..., 3:]}
    return {name: float(np.sqrt(np.nanmean(part**2))) for name, part in parts.items()}


def noise_of(found: ProcedureResult) -> dict:
    """The noise sds of the extended model, by kind and IMU, and their correlation in time."""
    readings, noise = found.search.readings, found.search.noise
    return {
        name: {
            readings.labels[k]: {
                "sd": float(readings.sd[k, kind]), "correlation": float(noise.correlation[k, kind]),
            }
            for k in np.flatnonzero(readings.exists[:, kind])
        }
        for kind, name in enumerate(KINDS)
    }  # fmt: skip


def gains(base: Fitted, inflated: Fitted, extended: Fitted) -> dict:
    """Held-out nats per sample over both rivals, residual ratios, and the positions' change."""
    over_base, over_inflated = (gain(m.scores, extended.scores) for m in (base, inflated))
    before, after = residual_sd(base.fit), residual_sd(extended.fit)
    (before_m, before_sds), (after_m, _) = base.positions, extended.positions
    owner = base.fit.active[:, base.fit.columns.of(POSITION)][: len(before_m)]
    change, sds = (after_m - before_m)[owner], before_sds[owner]
    return {
        "heldout_log_score_nats_per_sample": over_base[0],
        "heldout_log_score_nats_per_sample_se": over_base[1],
        "over_inflated_noise_nats_per_sample": over_inflated[0],
        "over_inflated_noise_nats_per_sample_se": over_inflated[1],
        "residual_sd_ratio": {name: after[name] / before[name] for name in before},
        "position_change_sd": float(np.sqrt(np.mean((change / sds) ** 2))),
        "position_change_m": float(np.sqrt(np.mean(change**2))),
    }


def causes_of(found: ProcedureResult, sds: np.ndarray) -> list[dict]:
    """All causes: of whole readings, of the means in the order of adoption, of the noise."""
    search, means = found.search, []
    for cause in search.causes:
        statistic, freedom = need(search, cause.effect)
        true, placebo = placebo_gain(search, cause)
        means.append(Finding(
            cause.effect, cause.imus, cause.log_p, parameters_of(search, cause, sds),
            *heldout_gain(search, cause.effect), rivals=found.rivals.get(cause.effect, ()),
            also={"chi_square": statistic, "degrees_of_freedom": freedom,
                  "placebo_gain_nats": placebo, "gain_in_sample_nats": true},
        ))  # fmt: skip
    every = (*found.reading_faults, *means, *found.in_noise)
    return [_entry(item, search.readings.labels) for item in every]


def _entry(item: Finding, labels) -> dict:
    """One cause of `diagnosis.json`."""
    entry = {
        "effect": item.effect,
        "sensors": words.sensors_of(labels, item.imus),
        "parameters": {
            name: {"value": value, "sd": sd, "unit": unit}
            for name, (value, sd, unit) in item.parameters.items()
        },
        "p_value": float(np.exp(item.log_p)),
        "log10_p_value": float(max(item.log_p, LEAST) / np.log(10)),
        "heldout_gain_nats": item.gain,
        "heldout_gain_se": item.gain_se,
        "indistinguishable_from": list(item.rivals),
        **item.also,
    }
    return entry | {"says": cause_in_words(entry, labels, item.says)}


def parameters_of(search: Search, cause: Cause, sds) -> dict:
    """{name: (value, sd, unit)} of a cause; ``sds`` (N, m), of what a scan fixed there is none."""
    values, columns = search.columns.flat(search.fit.state), search.columns
    active, item = search.active, known_effect(cause.effect)
    held = (*item.held, *(item.held_rough if search.fit.state.gyroscopes_free else ()))
    found = {}
    for imu, column in product(cause.imus, columns.of(cause.effect)):
        place = columns.places[column]
        fixed = bool(place) and place[-1] in held
        if active[imu, column] or fixed:
            name = f"{component(cause.effect, place)}_{search.readings.labels[imu]}"
            sd = None if fixed else float(sds[imu, column])
            found[name] = float(values[imu, column]), sd, unit_of(cause.effect, place)
    return found


def cause_in_words(cause: dict, labels, says: str = "") -> str:
    """A cause of `diagnosis.json` with its size, or what was read (``says``), test and class."""
    text = words.in_short(cause, labels, says)
    if stretches := cause.get("stretches_s"):
        first = [f"{a:.4g} to {b:.4g}" for a, b in stretches[: SETTINGS.stretches_stated]]
        text += f"; longest at {', '.join(first)} s"
    gain = words.plus_minus(cause["heldout_gain_nats"], cause["heldout_gain_se"])
    p_value = words.probability(cause["log10_p_value"])
    equals = "" if p_value.startswith("<") else f"={words.NARROW}"
    text += f". Gain on held-out time {gain} nats, p{words.NARROW}{equals}{p_value}."
    true, placebo = cause.get("gain_in_sample_nats", 0.0), cause.get("placebo_gain_nats", 0.0)
    if cause["sensors"] != ["all"] and 0 < SETTINGS.doubtful * true < placebo:
        text += (
            " Its placebo, the same numbers at other IMUs, gains too: it is doubtful whose it is."
        )
    if cause["indistinguishable_from"]:
        rivals = words.joined(words.spelled(name) for name in cause["indistinguishable_from"])
        text += f" On this recording it cannot be distinguished from {rivals}: one class."
    return words.first_up(text)
