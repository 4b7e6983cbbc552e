"""House style of figures and tables: sizes, colours, footers, files of the same bytes each time."""

import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas as pd
import yaml
from matplotlib.figure import Figure

from imuarray.pictures.style import COLUMN, look, new_figure, saved, styled
from imuarray.provenance import write_bytes, write_csv

DIGITS, ERROR_DIGITS = 5, 3  # significant, of a published number and of its standard error
TABLES = yaml.safe_load(Path(__file__).with_name("tables.yaml").read_text(encoding="utf-8"))


def drawing(draw: Callable, footer=(), width=COLUMN, height=2.8, **given) -> Callable:
    """The function of a table that gives its figure, in inches, with ``footer`` lines below.

    ``draw(figure, table, **given)`` fills the empty figure.
    """

    @styled
    def drawn(table: pd.DataFrame) -> Figure:
        figure = new_figure(footer, width, height)
        draw(figure, table, **given)
        return figure

    return drawn


def legend_items(axes, last=()):
    """Handles and labels of ``axes`` in the order drawn, those labelled as in ``last`` at the end.

    Matplotlib puts error bars after plain lines.
    """
    handles, labels = axes.get_legend_handles_labels()
    order = sorted(range(len(labels)), key=lambda i: (labels[i] in last, i))
    return [handles[i] for i in order], [labels[i] for i in order]


def points(axes, x, y, error, index: int, **options) -> None:
    """Hollow markers with error bars, in the look of series ``index``."""
    axes.errorbar(x, y, error, markerfacecolor="none", **(look(index) | options))


def marks(index: int, **options) -> dict:
    """The look of series ``index`` without a line."""
    return look(index, "linestyle") | {"linestyle": "", **options}


def level(axes, value: float, text: str, **options) -> None:
    """A thin horizontal line with a small text above its right end."""
    axes.axhline(value, linewidth=0.8, **options)
    axes.annotate(
        text, (0.99, value), xycoords=("axes fraction", "data"), xytext=(0, 2),
        textcoords="offset points", ha="right", size=7, color="0.3",
    )  # fmt: skip


def significant(value: float) -> str:
    """Three significant digits without an exponent: '2100', '31.4', '0.412'."""
    return f"{float(f'{value:.3g}'):.10g}"


def rounded(table: pd.DataFrame) -> pd.DataFrame:
    """A table as it is published: `DIGITS` significant, `ERROR_DIGITS` of standard errors.

    Other numbers of digits are in ``table.attrs["digits"]``, by column. More would differ between
    processors, whose instructions round differently.
    """
    worth = table.attrs.get("digits", {})
    columns = {}
    for name in table.columns[[kind.kind == "f" for kind in table.dtypes]]:
        count = worth.get(name, ERROR_DIGITS if re.search("_(se|error)($|_)", name) else DIGITS)
        columns[name] = [float(f"{value:.{count}g}") for value in table[name]]
    return table.assign(**columns)


def rms(values) -> float:
    """Root of the mean square."""
    return float(np.sqrt(np.mean(np.square(values))))


def panels(**tables: pd.DataFrame) -> pd.DataFrame:
    """Tables one below the other, their names in the column ``panel``."""
    named = [
        table.assign(panel=name).astype(  # integers stay so where another table has no such column
            {column: "Int64" for column, kind in table.dtypes.items() if kind.kind in "iu"}
        )
        for name, table in tables.items()
    ]
    table = pd.concat(named, ignore_index=True)
    return table[["panel", *table.columns.drop("panel")]]


def write_figure(draw: Callable[[pd.DataFrame], Figure], table: pd.DataFrame, pdf, png, csv):
    """Write a table, `rounded`, and what ``draw`` makes of it; its bytes follow from these."""
    table = rounded(table)
    figure = draw(table)
    write_csv(table, csv)
    write_bytes(saved(figure, "pdf"), pdf)
    write_bytes(saved(figure, "png"), png)


def scale_line(settings: dict, *more: str) -> str:
    """'Scale quick, seed 1; ...' from a rule's settings."""
    return "; ".join([f"Scale {settings['scale']['name']}, seed {settings['seed']}", *more])


def chain_lines(verdicts: dict[int, dict]) -> list[str]:
    """Course and end of the chains of each T; last what R-hat is and which pass its criterion.

    ``verdicts``: `posterior/*.json`. R-hat and ESS are the largest and the smallest over all
    coordinates. Only a verdict that says so is called converged.
    """
    lines, passed = [], {True: [], False: []}
    for samples, verdict in verdicts.items():
        acceptance = "/".join(f"{share:.2f}" for share in verdict["acceptance"])
        lines.append(
            f"T={samples}: N={verdict['draws_per_sample']}, "
            f"σq={1e6 * verdict['step_length_m']:.3g} µm, {verdict['steps']} steps, "
            f"acc. {acceptance}, R-hat {verdict['rhat_max']:.3f}, "
            f"ESS {verdict['ess_min']:.0f}"
        )
        passed[verdict["converged"]].append(str(samples))
    threshold = max(verdict["rhat_threshold"] for verdict in verdicts.values())
    last = "R-hat: the largest, ESS: the smallest over all coordinates."
    if passed[True]:
        last += f" R-hat < {threshold:g}, converged: T = {', '.join(passed[True])}."
    if passed[False]:
        last += f" R-hat not below {threshold:g}, preliminary: T = {', '.join(passed[False])}."
    return [*lines, last]


def unfinished(table, threshold: float) -> str:
    """A note on the rows whose chains fail the criterion; empty if there are no such rows."""
    failed = (~table.converged).sum()
    said = f"R-hat is not below {threshold:g} in {failed} of {len(table)} rows: preliminary."
    return said if failed else ""


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


def columns(name: str) -> list[Column]:
    """The columns that readers see of the published table ``name``."""
    return [Column(*given) for given in TABLES[name]["columns"]]


def notes(name: str, words: dict) -> list[str]:
    """The notes on the published table ``name``; none that is empty."""
    filled = (note.format(**words) for note in TABLES[name].get("notes", ()))
    return [note for note in filled if note]


def write_table(name: str, table, words: dict, csv, tex, md) -> None:
    """``table``, `rounded`, as CSV; those of its `columns` that it has as LaTeX and Markdown.

    ``words`` of its `notes`.
    """
    table, caption, below = rounded(table), TABLES[name]["caption"], notes(name, words)
    write_csv(table, csv)
    shown = [column for column in columns(name) if column.name in table]
    for path, form in ((tex, latex), (md, markdown)):
        write_bytes(form(table, shown, caption, below).encode(), path)


def _cells(table, columns) -> pd.DataFrame:
    return pd.DataFrame({one.name: [one.text(x) for x in table[one.name]] for one in columns})


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
