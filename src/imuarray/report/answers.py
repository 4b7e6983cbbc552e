"""The four answers of a diagnosis in plain words, from its document."""

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from imuarray.diagnosis.document import Diagnosis
from imuarray.model.effects import DATA_EFFECTS, EFFECTS, KINDS
from imuarray.report.numbers import in_noise_sds, noise_table, position_table
from imuarray.words import (
    NARROW,
    equation,
    first_up,
    imus_named,
    in_short,
    joined,
    number,
    plus_minus,
    quantity,
    ratio,
    span,
    spelled,
    symbols,
)

BELOW_NOISE = 1.1  # times the assumed noise: a residual that looks like noise
USUAL = 0.05  # p-value of a check that is as expected
FEW = 3  # checks that are quoted, causes that are named with their IMUs
PAPERS = "specific force ω × (ω × r) + dω/dt × r + s, angular rate ω, and white noise"


class Answer(NamedTuple):
    """The answer to a question, details, and what must not be overlooked ("" if nothing)."""

    lead: str
    items: list[str]
    loud: str = ""


def verdict(diagnosis: Diagnosis) -> list[str]:
    """The whole diagnosis: a sentence a cause, what they are worth, what is left."""
    document = diagnosis.document
    causes, labels = document["causes"], diagnosis.found.search.readings.labels
    if not causes:
        if document["unexplained"]:
            return [
                "Unexplained: the plain model differs from the recording, and no known cause does."
            ]
        return ["Nothing: the plain model simulates this recording as far as it can show."]
    parts = [f"{first_up(in_short(cause, labels))}." for cause in causes[:FEW]]
    if len(causes) > FEW:
        others = joined(spelled(cause["effect"]) for cause in causes[FEW:])
        parts.append(f"And {others}.")
    before, after = (in_noise_sds(model) for model in (diagnosis.base, diagnosis.extended))
    worst = max(before, key=before.get)
    moved = quantity(document["gain"]["position_change_m"], None, "m")
    parts.append(
        f"With {'that' if len(causes) == 1 else 'these'} in the model the {worst}s' residual falls"
        f" from {ratio(before[worst])} to {ratio(after[worst])} times the noise, and positions move"
        f" by {moved}."
    )
    if document["unexplained"]:
        parts.append(
            "Unexplained: something is left that no known cause explains."
            if alarming(document)
            else "Smooth samples are explained; what is left is motion faster than the samples."
        )
    return parts


def alarming(document: dict) -> bool:
    """True where something is left that is not motion faster than the samples."""
    # where smooth samples are explained, shocks are what is left
    return (document["smooth"] or document)["unexplained"] and document["unexplained"]


def clean(document: dict) -> bool:
    """Nothing named and nothing left."""
    return not document["causes"] and not document["unexplained"]


def of_noise(sizes: dict[str, float]) -> str:
    """'1.02 times the assumed noise in the accelerometers and ... in the gyroscopes'."""
    first, *rest = sizes.items()
    parts = [f"{ratio(first[1])} times the assumed noise in the {first[0]}s"]
    return joined(parts + [f"{ratio(value)} times in the {kind}s" for kind, value in rest])


def wrong(diagnosis: Diagnosis) -> Answer:
    """Checks of the residual under the plain model that simulations do not give."""
    document = diagnosis.document
    checks = document["discrepancies"]
    out = [check for check in checks if check["p_value"] <= USUAL]
    chance = max(round(USUAL * len(checks)), 1)
    lead = (
        f"Fitted to the recording, the plain model leaves a residual of"
        f" {of_noise(in_noise_sds(diagnosis.base))}. Of {len(checks)} checks of that residual"
        f" {len(out) or 'none'} {'lies' if len(out) == 1 else 'lie'} outside what 95 % of"
        f" simulations give; chance alone puts about {chance} there."
    )
    if clean(document):
        lead = f"Nothing that this recording shows. {lead}"
        if out:
            says = quoted(checks[0])
            lead += f" The most striking, as there always is one: {says[:1].lower()}{says[1:]}"
        lead += " These checks describe. The verdict rests on stricter tests of the residual, which"
        return Answer(f"{lead} all pass.", [])
    if document["causes"] and max(in_noise_sds(diagnosis.base).values()) < BELOW_NOISE:
        lead += " The misfit is smaller than the noise; its pattern shows it."
    return Answer(lead, [quoted(check) for check in out[:FEW]])


def quoted(check: dict) -> str:
    """A check's sentence with its p-value."""
    p_value = number(check["p_value"], 2)
    return f"{symbols(check['says'])[:-1]} (p{NARROW}={NARROW}{p_value})."


def why(diagnosis: Diagnosis) -> Answer:
    """The causes in their order; what is left is said loudly."""
    document = diagnosis.document
    items = [cause["says"] for cause in document["causes"]]
    loud = ""
    if alarming(document):
        loud = (
            "Something is left that no known cause explains. Checks that still fail:"
            f" {some(document['remaining'])}. Take the causes named here with caution: an unknown"
            " effect can pass for a known one."
        )
    if clean(document):
        lead = "There is nothing to explain: no effect of the catalogue is significant, and no test"
        return Answer(f"{lead} of the residual fails.", [])
    if not items:
        return Answer("No effect of the catalogue explains it.", [], loud)
    lead = f"{len(items)} causes, in the order in which they were found:"
    lead = lead if len(items) > 1 else "One cause:"
    if document["smooth"]:
        sizes = {kind: document["smooth"][kind]["residual"] for kind in KINDS}
        smooth = f"In smooth samples that turn fast the residual is {of_noise(sizes)}."
        if document["unexplained"] and not loud:
            smooth += (
                " What is left elsewhere is motion faster than the samples:"
                f" {some(document['remaining'])}."
            )
        lead = f"{smooth} {lead}"
    if not document["unexplained"] and document["remaining"] and not loud:
        left = number(100 * max(1 - diagnosis.found.explained, 0.0), 2)
        lead = (
            f"The causes below leave {left} % of the excess misfit: within tolerance, though it"
            f" still shows in {some(document['remaining'])}. {lead}"
        )
    return Answer(lead, items, loud)


def some(checks, most=8) -> str:
    """Names of checks, the first few of many."""
    names = [symbols(name) for name in checks]
    more = [f"{len(names) - most} more (diagnosis.json has all)"] * (len(names) > most)
    return joined([*names[:most], *more])


def extended(diagnosis: Diagnosis) -> Answer:
    """The extended model: its effects, parameters and noise."""
    document = diagnosis.document
    parts = []
    for (kind, unit), rows in noise_table(diagnosis).groupby(["kind", "unit"], sort=False):
        size, declared = (span(sd.min(), sd.max(), unit) for sd in (rows.sd, rows.declared))
        parts.append(f"{kind}s {size}, declared {declared}")
    noise = f"noise sd of the triads, as the residual shows it: {'; '.join(parts)}"
    if not document["causes"]:
        lead = f"It is the plain model as it stands, {PAPERS}."
        return Answer(lead, [noise])
    items = [
        f"{spelled(cause['effect'])} ({imus_named(cause['sensors'])}): {equation(cause['effect'])}"
        for cause in document["causes"]
    ]
    fits = diagnosis.base.fit, diagnosis.extended.fit
    more = int(fits[1].active.sum()) - int(fits[0].active.sum())
    lead = (
        f"The plain model, {PAPERS}, and {more or 'no'} more parameter{'s' * (more != 1)} beside"
        f" the {int(fits[0].active.sum())} of the positions. u is the true specific force at a"
        " triad:"
    )
    return Answer(lead, [*items, noise])


def gained(diagnosis: Diagnosis) -> Answer:
    """Gains of the extended model: prediction, residual, positions and their widths."""
    document, gain = diagnosis.document, diagnosis.document["gain"]
    samples = document["samples"]
    over_base, over_inflated = (
        plus_minus(gain[key], gain[f"{key}_se"])
        for key in ("heldout_log_score_nats_per_sample", "over_inflated_noise_nats_per_sample")
    )
    if clean(document):
        lead = "Nothing, and there was nothing to gain."
        items = [
            "On held-out time, estimating each triad's noise gains"
            f" {over_base} nats per sample over the declared noise, {over_inflated} over noise of"
            " the residual's size."
        ]
        return Answer(lead, [*items, positions_in_words(diagnosis)])
    total = number(samples * gain["over_inflated_noise_nats_per_sample"])
    lead = (
        f"Each of the {samples} samples, predicted from the other stretches of time, is"
        f" {over_base} nats more likely than under the plain model, and {over_inflated} nats more"
        f" than under its rival, the plain model with noise inflated to its residual"
        f" ({total} nats in all). Readings that were left out as outliers are in no score."
    )
    items = [residual_in_words(diagnosis), positions_in_words(diagnosis)]
    items += readings_in_words(document["causes"])
    loud = ""
    if alarming(document):
        loud = "Widths are those of the extended model: what is unexplained is not in them."
    return Answer(lead, items, loud)


def readings_in_words(causes) -> Iterator[str]:
    """Where readings count that were left out or turned back."""
    gaining = [DATA_EFFECTS.get(c["effect"]) for c in causes if c["heldout_gain_nats"] > 0]
    corrected = [item for item in gaining if item and item.kind == "readings"]
    if any(item.left_out for item in corrected):
        yield (
            "Readings that are left out count in the nats, by how far they miss what the extended"
            " model predicts; neither the residuals nor the positions have them."
        )
    if not all(item.left_out for item in corrected):
        yield (
            "Axes that are turned back count in all of these numbers: the plain model takes the"
            " readings as they were recorded."
        )


def residual_in_words(diagnosis: Diagnosis) -> str:
    """By how much the residual shrank."""
    shrunk = diagnosis.document["gain"]["residual_sd_ratio"]
    after = in_noise_sds(diagnosis.extended)
    names = {"specific_force": "accelerometer", "angular_rate": "gyroscope"}
    parts = [
        f"to {number(100 * shrunk[key])} % in the {kind}s (now {ratio(after[kind])} times the"
        " assumed noise)"
        for key, kind in names.items() if kind in after
    ]  # fmt: skip
    return f"The residual's sd went {joined(parts)}."


def positions_in_words(diagnosis: Diagnosis) -> str:
    """Words on how far the positions moved, and their widths before and after."""
    gain, table = diagnosis.document["gain"], position_table(diagnosis)
    inflated = diagnosis.document["inflated"]["positions_sd_m"][1:]
    sds = (np.square(x).mean() for x in (table.base_sd, table.extended_sd, inflated))
    widths = [quantity(float(np.sqrt(square)), None, "m") for square in sds]
    if clean(diagnosis.document):
        return f"The positions stay; their sds are {widths[1]} (rms)."
    largest = table.loc[table.change.abs().idxmax()]
    moved = quantity(gain["position_change_m"], None, "m")
    return (
        f"The positions moved by {moved} (rms), {number(gain['position_change_sd'], 2)} of the sds"
        f" that the plain model claims for them; most: {largest['axis']} of IMU {largest.imu}, by"
        f" {quantity(float(largest.change), None, 'm')}. Claimed sds were {widths[0]} (rms),"
        f" {widths[2]} with inflated noise, now {widths[1]}."
    )


def onward(diagnosis: Diagnosis) -> Answer:
    """The next steps after the diagnosis."""
    document, named = diagnosis.document, [c["effect"] for c in diagnosis.document["causes"]]
    items = [f"Mend this first: {reason}" for reason in document.get("reasons", [])[:1]]
    data = [DATA_EFFECTS[name] for name in named if name in DATA_EFFECTS]
    if any(item.kind == "readings" and not item.left_out for item in data):
        items.append(
            "Give the axes in columns.yaml, convert the log again and calibrate that: here they"
            " were turned back in memory only."
        )
    elif named:
        own = [spelled(name) for name in named if name in EFFECTS and EFFECTS[name].own]
        less = f" Without {joined(own)}: that is of this recording alone." if own else ""
        items.append(
            "Use the model that has the causes, cal.nc beside this page: `imuarray apply cal.nc"
            f" RECORDING --out motion.nc` makes one sensor of the array.{less}"
        )
    if alarming(document):
        items.append(
            "Look for what no effect of the catalogue is: the pictures of the residual say in which"
            " IMU and with what motion it grows. Ten lines make an effect of your own"
            " (docs/effects.md)."
        )
    items.append(
        "Diagnose a second recording of the board: what a sensor does comes back with the same"
        " size, what happened once does not."
    )
    lead = "" if named or alarming(document) else "The plain model is enough for this recording."
    return Answer(lead, items)


ANSWERS = {  # of a diagnosis, by question
    "What does the simulation get wrong?": wrong,
    "Why?": why,
    "What does the extended model look like?": extended,
    "What did it gain?": gained,
    "What to do next?": onward,
}
