"""Paper 2021, tables I and II, as CSV, LaTeX and Markdown."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import pandas as pd

from imuarray.figures.notes import SOURCES
from imuarray.provenance import atomic_write, write_csv

NOT_IN_TEXT = "The paper's values are not in the extracted text; these are ours."


@dataclass(frozen=True)
class Column:
    """A column as readers see it: headings in Markdown and LaTeX, and a format with a factor."""

    name: str
    markdown: str
    latex: str
    form: str = "{}"
    factor: float = 1.0

    def text(self, value) -> str:
        """The cell's text; an empty one for NaN."""
        if pd.isna(value):
            return ""
        return self.form.format(value * self.factor if self.factor != 1.0 else value)


TABLE1 = (
    Column("samples", "T", "$T$"),
    Column("draws", "N", "$N$"),
    Column("variance", "variance of log p-hat", r"$\mathrm{var}\log\hat p_N$", "{:.3f}"),
    Column("step_length_m", "σq (µm)", r"$\sigma_q$ ($\mu$m)", "{:.3g}", 1e6),
    Column("acceptance_1", "acceptance, chain 1", "acc. 1", "{:.3f}"),
    Column("acceptance_2", "acceptance, chain 2", "acc. 2", "{:.3f}"),
    Column("steps", "steps per chain", "steps"),
    Column("burn_in_steps", "burn-in (steps)", "burn-in"),
    Column("rhat_max", "max R-hat", r"max $\hat R$", "{:.3f}"),
    Column("ess_min", "min ESS", "min ESS", "{:.0f}"),
    Column("ess_median", "median ESS", "med. ESS", "{:.0f}"),
)

TABLE2 = (
    Column("samples", "T", "$T$"),
    Column("source", "data", "data"),
    Column("accelerometer_sd", "assumed σa (m/s²)", r"$\sigma_a$ (m/s$^2$)", "{:g}"),
    Column("sd_x_m", "sd x (µm)", r"$x$ ($\mu$m)", "{:.3g}", 1e6),
    Column("sd_y_m", "sd y (µm)", r"$y$ ($\mu$m)", "{:.3g}", 1e6),
    Column("sd_z_m", "sd z (µm)", r"$z$ ($\mu$m)", "{:.3g}", 1e6),
    Column("sd_median_m", "sd, median of all (µm)", r"median ($\mu$m)", "{:.3g}", 1e6),
    Column("sd_mean_m", "sd, mean of all (µm)", r"mean ($\mu$m)", "{:.3g}", 1e6),
    Column("ratio", "median / that of section IV-A", "ratio", "{:.3g}"),
    Column("rhat_max", "max R-hat", r"max $\hat R$", "{:.3f}"),
    Column("ess_min", "min ESS", "min ESS", "{:.0f}"),
)


def table1(tunings: Sequence[dict], verdicts: Sequence[dict]) -> pd.DataFrame:
    """Tuning parameters and what came of them, one row for each T.

    ``tunings``: `tuning/T*.json`; ``verdicts``: `posterior/T*.json`, in the same order. The
    variance is that of the nearest N of the sweep at the prior mean. Units as in the names.
    """
    rows = []
    for tuning, verdict in zip(tunings, verdicts, strict=True):
        row = {name: tuning[name] for name in ("samples", "draws", "step_length_m")}
        row["variance"] = tuning["variance"]
        for number, share in enumerate(verdict["acceptance"], start=1):
            row[f"acceptance_{number}"] = share
        for name in ("steps", "burn_in_steps", "rhat_max", "ess_min", "ess_median", "converged"):
            row[name] = verdict[name]
        rows.append(row)
    return pd.DataFrame(rows)[[column.name for column in TABLE1] + ["converged"]]


def table2(sources: dict[str, dict[int, tuple[pd.DataFrame, dict, float]]]) -> pd.DataFrame:
    """Estimated standard deviations of the positions, one row for each T and source.

    ``sources[name][T]``: per-coordinate table and verdict of `posterior/`, and the assumed
    sigma_a (m/s^2). Axes: medians over the triads; ``ratio``: the median over all coordinates
    by that of the last source at the same T.
    """
    last = list(sources)[-1]
    rows = []
    for samples in sources[last]:
        reference = sources[last][samples][0].sd_m.median()
        for source, results in sources.items():
            coordinates, verdict, accelerometer_sd = results[samples]
            axes = coordinates.groupby("axis").sd_m.median()
            rows.append(
                {
                    "samples": samples,
                    "source": source,
                    "accelerometers": len(coordinates) // 3 + 1,
                    "accelerometer_sd": accelerometer_sd,
                    **{f"sd_{axis}_m": axes[axis] for axis in "xyz"},
                    "sd_median_m": coordinates.sd_m.median(),
                    "sd_mean_m": coordinates.sd_m.mean(),
                    "ratio": coordinates.sd_m.median() / reference,
                    **{name: verdict[name] for name in ("rhat_max", "ess_min", "converged")},
                }  # fmt: skip
            )
    return pd.DataFrame(rows)


def source_names(kind: str) -> tuple[str, str, str]:
    """Table II's sources: the experiment (``kind``), its simulation, and section IV-A's."""
    return (
        f"experiment ({SOURCES[kind]})",
        "simulation, experiment's noise",
        "simulation, section IV-A",
    )


def sizes(table: pd.DataFrame) -> str:
    """A note on how many IMUs each source has, as widths depend on it."""
    counts = table.groupby("source", sort=False).accelerometers.first()
    return "IMUs: " + ", ".join(f"{count} ({source})" for source, count in counts.items()) + "."


def unfinished(table: pd.DataFrame, threshold: float) -> list[str]:
    """A note on the rows whose chains fail the criterion; none if there are no such rows."""
    failed = (~table.converged).sum()
    if not failed:
        return []
    return [f"R-hat is not below {threshold:g} in {failed} of {len(table)} rows: preliminary."]


def write_table(table, columns, caption: str, notes, csv, tex, md) -> None:
    """``table`` in full as CSV; the ``columns`` of it as LaTeX and Markdown, with notes."""
    write_csv(table, csv)
    for path, text in (
        (tex, latex(table, columns, caption, notes)),
        (md, markdown(table, columns, caption, notes)),
    ):
        with atomic_write(path) as temporary:
            temporary.write_text(text, encoding="utf-8", newline="\n")


def _cells(table, columns) -> pd.DataFrame:
    return pd.DataFrame(
        {column.name: [column.text(value) for value in table[column.name]] for column in columns}
    )


def markdown(table, columns: Sequence[Column], caption: str, notes) -> str:
    """Caption, table and notes as GitHub's Markdown."""
    rows = [[column.markdown for column in columns], ["---"] * len(columns)]
    rows += _cells(table, columns).to_numpy().tolist()
    body = "\n".join(f"| {' | '.join(row)} |" for row in rows)
    return "\n\n".join([f"**{caption}**", body, *notes]) + "\n"


def latex(table, columns: Sequence[Column], caption: str, notes) -> str:
    """A table environment (booktabs); notes follow the tabular."""
    cells = _cells(table, columns)
    cells.columns = [column.latex for column in columns]
    style = cells.style.format(escape="latex").hide(axis="index")
    numbers = [pd.api.types.is_numeric_dtype(table[column.name]) for column in columns]
    text = style.to_latex(
        hrules=True, caption=_escape(caption), position="htbp", position_float="centering",
        column_format="".join("r" if number else "l" for number in numbers),
    )  # fmt: skip
    closing = "\\end{table}"
    small = "".join(f"\\par\\footnotesize {_escape(note)}\n" for note in notes)
    return text.replace(closing, small + closing)


def _escape(text: str) -> str:
    for plain, escaped in (("\\", r"\textbackslash{}"), ("&", r"\&"), ("%", r"\%"), ("#", r"\#"),
                           ("_", r"\_"), ("σq", r"$\sigma_q$"), ("σa", r"$\sigma_a$"),
                           ("m/s²", r"m/s$^2$"), ("µm", r"$\mu$m")):  # fmt: skip
        text = text.replace(plain, escaped)
    return text
