"""The report of a diagnosis: diagnosis.json, report.html and the figures, in one folder."""

from functools import partial
from pathlib import Path

import numpy as np
import xarray as xr

from imuarray.diagnosis.document import Diagnosis
from imuarray.engine.dataset import diagnosed
from imuarray.provenance import atomic_folder, write_bytes, write_netcdf
from imuarray.report import drawings as drawn
from imuarray.report import numbers
from imuarray.report.answers import ANSWERS, USUAL, alarming, verdict
from imuarray.report.page import SUFFIXES, Drawing, files, pictured, rendered
from imuarray.report.panels import cause_table, panels_of
from imuarray.words import imus_named, sensors_of, spelled

# Figures by name: table, drawing, title, caption. First what the models leave and gain.
FIT = {
    "discrepancies": (
        numbers.discrepancy_table, drawn.discrepancy_figure, "Measured against simulated",
        "Each check of the residual at its worst sensor, in sds of the band that simulations of the"
        " fitted model give there; the grey band is where the worst sensor is in 95 % of"
        " simulations, if sensors are independent. Filled: p at most 0.05, the choice of the sensor"
        " allowed for.",
    ),
    "residual": (
        numbers.residual_table, drawn.residual_figure, "Residual before and after",
        "rms residual of each triad in units of the declared noise, corrected for what the fitted"
        " motion takes up: 1 is what the declared noise gives.",
    ),
    "gain": (
        numbers.gain_table, drawn.gain_figure, "What each cause gains",
        "Nats gained on blocks of time that the model was not trained on; above the line by each"
        " cause, in the order of adoption, below it by the extended model over the plain model"
        " with declared and with inflated noise. A placebo ought to gain nothing.",
    ),
}  # fmt: skip
LIMITS = {  # what the recording can tell, after the causes
    "separability": (
        numbers.separability_table, drawn.separability_figure,
        "What this recording can distinguish",
        "Squared canonical correlation of the effects' signals, each on all IMUs, motion and"
        f" positions projected out. Framed: above {drawn.ALIKE}, one class. Below the diagonal the"
        " two most alike forms of two effects, above it the mean over the forms of the smaller"
        " effect: 1 below and little above means that a single form is a gauge.",
    ),
    "detectable": (
        numbers.detectable_table, drawn.detectable_figure, "How small an effect would have shown",
        "Size from which an effect of one IMU passes the test with a chance of 80 %, from the IMU"
        " that shows it best to the one that shows it worst, over the prior sd of a common chip."
        " In rough motion the gain on held-out time asks more: up to twice that size."
        " Dots: what was found. Steps and clocks, which a scan looks for, are left out.",
    ),
    "positions": (
        numbers.position_table, drawn.position_figure, "Positions",
        "Where the extended model puts each triad, relative to the plain model; bars are 95 %"
        " intervals as each model claims them.",
    ),
}  # fmt: skip
LONGEST = 70  # characters of a path
CAUSE_CAPTION = (
    "What would be back in the residual without this cause, motion and all else refitted (points:"
    " means of bins with two standard errors), and what the cause predicts (lines); where points"
    " leave the lines, the cause does not fit. Left: all readings that it touches. Right: {}."
)


def write_report(diagnosis: Diagnosis, folder: str | Path) -> None:
    """Write figures (PDF, PNG, the numbers as CSV), report.html, cal.nc, and last diagnosis.json.

    cal.nc is `imuarray.diagnosed`. An error leaves the folder as it was; it is made if it does not
    exist.
    """
    calibration = diagnosed(diagnosis)
    drawings = draw(diagnosis, calibration)
    page, document = html(diagnosis, drawings), diagnosis.to_json() + "\n"
    with atomic_folder(folder, last="diagnosis.json") as made:
        for drawing in drawings:
            for suffix, content in drawing.files.items():
                write_bytes(content, made / f"{drawing.name}.{suffix}")
        write_netcdf(calibration, made / "cal.nc")
        write_bytes(page.encode(), made / "report.html")
        write_bytes(document.encode(), made / "diagnosis.json")
    # figures of a former report that this one does not have
    folder, names = Path(folder), {drawing.name for drawing in drawings}
    for suffix in SUFFIXES:
        for path in [*folder.glob(f"cause_[0-9][0-9]_*.{suffix}"), folder / f"gain.{suffix}"]:
            if path.stem not in names:
                path.unlink(missing_ok=True)


def draw(diagnosis: Diagnosis, calibration: xr.Dataset) -> list[Drawing]:
    """All figures in the report's order; those of causes only where there are any."""
    document, search = diagnosis.document, diagnosis.found.search
    said, labels, found = footer(document), search.readings.labels, []
    causes = {
        f"cause_{number:02d}_{cause.effect}": (
            partial(cause_table, cause=cause), drawn.cause_figure,
            f"Cause: {spelled(cause.effect)}, {imus_named(sensors_of(labels, cause.imus))}",
            CAUSE_CAPTION.format(panels_of(cause.effect)[1]),
        )
        for number, cause in enumerate(search.causes, 1)
    }  # fmt: skip
    for name, (make_table, make_figure, *texts) in (FIT | causes | LIMITS).items():
        if name != "gain" or document["causes"]:
            table = make_table(diagnosis)
            found.append(Drawing(name, *texts, files(make_figure(table, said), table)))
    alike = "board", "timeline", "sphere", "course"
    return found + pictured(diagnosis.recording, calibration, alike, said)


def footer(document: dict) -> list[str]:
    """The small print under a diagnosis' figures; of a long path its end."""
    path = " ".join(document["recording"].split()) or "a recording"
    path = path if len(path) <= LONGEST else f"…{path[1 - LONGEST :]}"
    return [
        f"{drawn.plain(path)}; {document['samples']} samples,"
        f" seed {document['seed']}, imuarray {document['version']}"
    ]


def html(diagnosis: Diagnosis, drawings: list[Drawing]) -> str:
    """report.html, every text escaped."""
    document = diagnosis.document
    return rendered(
        "report.html.j2", document=document, facts=facts(diagnosis), verdict=verdict(diagnosis),
        alarming=alarming(document), figures=drawings, usual=USUAL,
        answers={question: answer(diagnosis) for question, answer in ANSWERS.items()},
        checks=diagnosis.base.discrepancies,
        after={item.check: item for item in diagnosis.extended.discrepancies},
        labels=diagnosis.found.search.readings.labels, positions=numbers.position_table(diagnosis),
        noise=numbers.noise_table(diagnosis), scores=numbers.score_table(diagnosis),
    )  # fmt: skip


def facts(diagnosis: Diagnosis) -> str:
    """Samples, duration and sensors in a line."""
    readings = diagnosis.found.raw
    accelerometers, gyroscopes = (int(n) for n in readings.exists.sum(axis=0))
    rate = 1.0 / np.median(np.diff(readings.time))
    return (
        f"{len(readings.time)} moving samples within {readings.span:.1f} s at {rate:.4g} Hz;"
        f" {accelerometers} accelerometer triads, {gyroscopes} gyroscope triads"
        f" ({', '.join(readings.labels)})."
    )
