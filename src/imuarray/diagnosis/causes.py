"""Causes as `diagnosis.json` has them: parameters, tests, held-out gain, a sentence each."""

from dataclasses import replace

import numpy as np

from imuarray.diagnosis.fit import at
from imuarray.diagnosis.noise_effects import held_out
from imuarray.diagnosis.procedure import ProcedureResult
from imuarray.diagnosis.settings import SETTINGS
from imuarray.diagnosis.special import placebo_gain
from imuarray.diagnosis.state import Cause, Search, heldout_gain, need
from imuarray.model.array_model import component, unit_of
from imuarray.model.effects import DATA_EFFECTS, known_effect
from imuarray.words import (
    NARROW,
    first_up,
    in_short,
    joined,
    plus_minus,
    probability,
    sensors_of,
    spelled,
)

LEAST = -1e6  # log p; JSON has no infinity


def causes_of(found: ProcedureResult, sds: np.ndarray) -> list[dict]:
    """All causes: of whole readings, of the means in the order of adoption, of the noise."""
    search, labels = found.search, found.search.readings.labels
    causes = []
    for item in found.structural:
        nats = structural_gain(found, item)[:2]
        if not item.doubtful or nats[0] > 0:
            causes.append(_entry(item, labels, item.parameters, nats, says=item.says))
    for cause in search.causes:
        statistic, freedom = need(search, cause.effect)
        true, placebo = placebo_gain(search, cause)
        causes.append(_entry(
            cause, labels, parameters_of(search, cause, sds),
            heldout_gain(search, cause.effect), found.rivals.get(cause.effect, ()),
            chi_square=statistic, degrees_of_freedom=freedom, placebo_gain_nats=placebo,
            gain_in_sample_nats=true,
        ))  # fmt: skip
    for item in found.in_noise:
        where = {"stretches_s": [list(pair) for pair in item.where]} if item.where else {}
        nats = item.gain, item.gain_se
        causes.append(_entry(item, labels, item.parameters, nats, **where))
    return causes


def _entry(item, labels, parameters, nats, rivals=(), says="", **tests) -> dict:
    """One cause of `diagnosis.json`; parameters are dicts or (value, sd, unit)."""
    plain = {
        name: value if isinstance(value, dict)
        else {"value": value[0], "sd": value[1], "unit": value[2]}
        for name, value in parameters.items()
    }  # fmt: skip
    entry = {
        "effect": item.effect,
        "sensors": sensors_of(labels, item.imus),
        "parameters": plain,
        "p_value": float(np.exp(item.log_p)),
        "log10_p_value": float(max(item.log_p, LEAST) / np.log(10)),
        "heldout_gain_nats": nats[0],
        "heldout_gain_se": nats[1],
        "indistinguishable_from": list(rivals),
        **tests,
    }
    return entry | {"says": cause_in_words(entry, labels, says)}


def structural_gain(found: ProcedureResult, item) -> tuple[float, float, np.ndarray]:
    """Nats by which the readings, as recorded, miss the extended model's prediction, as `held_out`.

    Nothing was fitted to the readings that were left out, so this is held out as it stands.
    What the other effects of whole readings did stays mended: theirs is not counted here.
    """
    search, raw = found.search, found.raw
    touched, values = raw.keep & ~search.allowed, search.readings.values
    if not DATA_EFFECTS[item.effect].left_out:  # it is mended
        touched, values = raw.keep & (raw.values != values), raw.values
    mine = np.zeros_like(touched)
    mine[:, list(item.imus)] = touched[:, list(item.imus)]
    readings = replace(search.readings, values=values, keep=search.readings.keep | mine)
    seen = at(readings, search.columns, search.active, search.fit.state, all_columns=False)
    return held_out((seen.misfits - search.fit.misfits - mine.sum(axis=(1, 2))) / 2)


def parameters_of(search: Search, cause: Cause, sds) -> dict:
    """{name: {value, sd, unit}} of a cause; ``sds`` (N, m), of what a scan fixed there is none."""
    values, columns = search.columns.flat(search.fit.state), search.columns
    active, item = search.active, known_effect(cause.effect)
    held = (*item.held, *(item.held_rough if search.fit.state.gyroscopes_free else ()))
    found = {}
    for imu in cause.imus:
        for column in columns.of(cause.effect):
            place = columns.places[column]
            fixed = bool(place) and place[-1] in held
            if not (active[imu, column] or fixed):
                continue
            name = f"{component(cause.effect, place)}_{search.readings.labels[imu]}"
            found[name] = {
                "value": float(values[imu, column]),
                "sd": None if fixed else float(sds[imu, column]),
                "unit": unit_of(cause.effect, place),
            }
    return found


def cause_in_words(cause: dict, labels, says: str = "") -> str:
    """A cause of `diagnosis.json` with its size, or what was read (``says``), test and class."""
    text = in_short(cause, labels, says)
    if stretches := cause.get("stretches_s"):
        first = [f"{a:.4g} to {b:.4g}" for a, b in stretches[: SETTINGS.stretches_stated]]
        text += f"; longest at {', '.join(first)} s"
    gain = plus_minus(cause["heldout_gain_nats"], cause["heldout_gain_se"])
    p_value = probability(cause["log10_p_value"])
    equals = "" if p_value.startswith("<") else f"={NARROW}"
    text += f". Gain on held-out time {gain} nats, p{NARROW}{equals}{p_value}."
    true, placebo = cause.get("gain_in_sample_nats", 0.0), cause.get("placebo_gain_nats", 0.0)
    if cause["sensors"] != ["all"] and 0 < SETTINGS.doubtful * true < placebo:
        text += (
            " Its placebo, the same numbers at other IMUs, gains too: it is doubtful whose it is."
        )
    if cause["indistinguishable_from"]:
        rivals = joined(spelled(name) for name in cause["indistinguishable_from"])
        text += f" On this recording it cannot be distinguished from {rivals}: one class."
    return first_up(text)
