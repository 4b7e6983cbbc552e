"""The report's tables as rows of text."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from imuarray.diagnosis.quantities import (
    number,
    plus_minus,
    probability,
    quantity,
    symbols,
    unit_shown,
)
from imuarray.diagnosis.words import part_in_words, split_name, whose, words
from imuarray.model.effects import KINDS
from imuarray.report.answers import USUAL
from imuarray.report.numbers import (
    imu_labels,
    position_table,
    residual_table,
    score_table,
)

if TYPE_CHECKING:
    from imuarray.diagnosis.document import Diagnosis

MICRO = 1e6


class Row(NamedTuple):
    """Cells, and whether they are to be set off."""

    cells: list[str]
    strong: bool = False


class Table(NamedTuple):
    """A table: its head is (text, whether its cells are numbers) of each column."""

    title: str
    caption: str
    columns: list[tuple[str, bool]]
    rows: list[Row]
    folded: bool = False


def tables(diagnosis: Diagnosis) -> list[Table]:
    """All tables of a report, in its order."""
    causes = diagnosis.document["causes"]
    return [
        checks(diagnosis),
        *([tests_of(causes)] if causes else []),
        *[parameters(cause, imu_labels(diagnosis)) for cause in causes if cause["parameters"]],
        positions(diagnosis),
        noise(diagnosis),
        scores(diagnosis),
    ]


def checks(diagnosis: Diagnosis) -> Table:
    """Every check of both models with its sentence."""
    after = {item.check: item for item in diagnosis.extended.discrepancies}
    rows = []
    for item in diagnosis.base.discrepancies:
        then = after.get(item.check)
        cells = [
            symbols(item.says), number(item.p_value, 2),
            ", ".join(item.sensors),
            number(then.statistic) if then else "",
            number(then.p_value, 2) if then else "",
        ]  # fmt: skip
        rows.append(Row(cells, item.p_value <= USUAL))
    columns = [
        ("papers' model", False), ("p", True), ("IMUs out", False), ("extended model", True),
        ("p", True),
    ]  # fmt: skip
    caption = (
        "Each quantity at its worst sensor, beside what the fitted model simulates; p allows for"
        " the choice of the worst sensor and is 1 / (simulations + 1) at least. In bold: p at most"
        " 0.05."
    )
    return Table("Checks of the residual", caption, columns, rows)


def tests_of(causes) -> Table:
    """Tests, held-out gains and placebos of the causes."""
    rows = []
    for cause in causes:
        tested = "chi_square" in cause
        rows.append(Row([
            f"{words(cause['effect'])} ({whose(cause['sensors'])})",
            number(cause["chi_square"], 4) if tested else "",
            str(cause["degrees_of_freedom"]) if tested else "",
            probability(cause["log10_p_value"]),
            plus_minus(cause["heldout_gain_nats"], cause["heldout_gain_se"]),
            number(cause["gain_in_sample_nats"]) if tested else "",
            number(cause["placebo_gain_nats"]) if tested else "",
        ]))  # fmt: skip
    columns = [
        ("cause", False), ("chi-square", True), ("d.o.f.", True), ("p", True),
        ("held-out gain (nats)", True), ("in-sample gain", True), ("placebo gain", True),
    ]  # fmt: skip
    caption = (
        "The placebo gives each IMU's numbers to the next one; it ought to gain nothing. A clock"
        " that one IMU alone has, has no placebo (0)."
    )
    return Table("Causes: tests, gains, placebos", caption, columns, rows)


def parameters(cause: dict, labels) -> Table:
    """All parameters of a cause."""
    rows = []
    for name, item in cause["parameters"].items():
        part, label = split_name(name, labels)
        unit = unit_shown(cause["effect"], name, item["unit"])
        sd = "scanned" if item["sd"] is None else number(item["sd"])
        unit_in_file = item["unit"] if item["unit"] != "1" else ""
        rows.append(Row([
            label or "all named", part_in_words(part), quantity(item["value"], item["sd"], unit),
            number(item["value"], 5), sd, unit_in_file,
        ]))  # fmt: skip
    columns = [
        ("IMU", False), ("parameter", False), ("value", False), ("SI value", True), ("sd", True),
        ("unit", False),
    ]  # fmt: skip
    title = f"Parameters of {words(cause['effect'])} ({whose(cause['sensors'])})"
    caption = "As fitted beside all other causes; an sd is missing where a scan fixed the value."
    return Table(title, caption, columns, rows, folded=True)


def fixed(value: float, decimals: int) -> str:
    """A number whose column lines up."""
    return f"{value:.{decimals}f}".replace("-", "−")


def positions(diagnosis: Diagnosis) -> Table:
    """Positions of both models with their sds."""
    rows = [
        Row([
            str(row.imu), row.axis, fixed(1e3 * row.base, 4), fixed(MICRO * row.base_sd, 2),
            fixed(1e3 * row.extended, 4), fixed(MICRO * row.extended_sd, 2),
            fixed(MICRO * row.change, 2), fixed(row.change / row.base_sd, 1),
        ])
        for row in position_table(diagnosis).itertuples()
    ]  # fmt: skip
    columns = [
        ("IMU", False), ("axis", False), ("papers' model (mm)", True), ("sd (µm)", True),
        ("extended (mm)", True), ("sd (µm)", True), ("change (µm)", True), ("change / sd", True),
    ]  # fmt: skip
    caption = "Relative to the first accelerometer, in the array frame."
    return Table("Positions", caption, columns, rows, folded=True)


def noise(diagnosis: Diagnosis) -> Table:
    """Noise and residual per triad."""
    readings, memory = diagnosis.found.search.readings, diagnosis.found.search.noise.correlation
    sizes = residual_table(diagnosis).query("axis == 'all'").set_index(["model", "kind", "imu"]).rms
    rows = []
    for kind, name in enumerate(KINDS):
        for imu in np.flatnonzero(readings.exists[:, kind]):
            label, unit = readings.labels[imu], ("m s-2", "rad s-1")[kind]
            rows.append(Row([
                f"{name} {label}", quantity(readings.declared[imu, kind], None, unit),
                quantity(readings.sd[imu, kind], None, unit), number(memory[imu, kind], 2),
                fixed(sizes["base", name, label], 3), fixed(sizes["extended", name, label], 3),
            ]))  # fmt: skip
    columns = [
        ("triad", False), ("declared sd", True), ("extended model's sd", True),
        ("correlation", True), ("residual before", True), ("after", True),
    ]  # fmt: skip
    caption = (
        "Correlation is that of neighbouring samples, 0 where it is not significant; residuals are"
        " rms in declared sds."
    )
    return Table("Noise of each triad", caption, columns, rows, folded=True)


def scores(diagnosis: Diagnosis) -> Table:
    """Every effect's best test at the papers' model."""
    rows = [
        Row([
            f"{words(row.effect)} {row.form}".strip(), row.imus, number(row.statistic, 4),
            str(row.freedom), probability(row.log10_p), probability(row.limit),
            "adopted" if row.adopted else "",
        ], row.adopted)
        for row in score_table(diagnosis).itertuples()
    ]  # fmt: skip
    columns = [
        ("effect", False), ("IMUs", False), ("chi-square", True), ("d.o.f.", True), ("p", True),
        ("critical p", True), ("", False),
    ]  # fmt: skip
    caption = (
        "The most telling test of each effect before any cause is adopted, motion and positions"
        " refitted; p allows for the IMUs and forms tried. One true cause lets others that resemble"
        " it look significant; beside the adopted ones they are not needed."
    )
    return Table("All effects tested at the papers' model", caption, columns, rows, folded=True)
