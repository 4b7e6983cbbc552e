"""Tables as CSV, LaTeX and Markdown, and the small print under them and under figures."""

from collections.abc import Sequence
from dataclasses import dataclass

import pandas as pd

from imuarray.figures.style import rounded
from imuarray.provenance import write_bytes, write_csv


def scale_line(settings: dict, *more: str) -> str:
    """'Scale quick, seed 1; ...' from a rule's settings."""
    return "; ".join([f"Scale {settings['scale']['name']}, seed {settings['seed']}", *more])


def chain_line(samples: int, verdict: dict) -> str:
    """How the chains of one T ran and how far they got, from `posterior/*.json`.

    R-hat and ESS are the largest and the smallest over all coordinates.
    """
    acceptance = "/".join(f"{share:.2f}" for share in verdict["acceptance"])
    return (
        f"T={samples}: N={verdict['draws_per_sample']}, "
        f"σq={1e6 * verdict['step_length_m']:.3g} µm, {verdict['steps']} steps, "
        f"acc. {acceptance}, R-hat {verdict['rhat_max']:.3f}, "
        f"ESS {verdict['ess_min']:.0f}"
    )


def chain_lines(verdicts: dict[int, dict]) -> list[str]:
    """One line per T; the last says what R-hat is and which chains pass its criterion.

    Only a verdict that says so is called converged.
    """
    lines = [chain_line(samples, verdict) for samples, verdict in verdicts.items()]
    good = [str(samples) for samples, verdict in verdicts.items() if verdict["converged"]]
    bad = [str(samples) for samples, verdict in verdicts.items() if not verdict["converged"]]
    threshold = max(verdict["rhat_threshold"] for verdict in verdicts.values())
    last = "R-hat: the largest, ESS: the smallest over all coordinates."
    if good:
        last += f" R-hat < {threshold:g}, converged: T = {', '.join(good)}."
    if bad:
        last += f" R-hat not below {threshold:g}, preliminary: T = {', '.join(bad)}."
    return [*lines, last]


def unfinished(table, threshold: float) -> list[str]:
    """A note on the rows whose chains fail the criterion; none if there are no such rows."""
    failed = (~table.converged).sum()
    if not failed:
        return []
    return [f"R-hat is not below {threshold:g} in {failed} of {len(table)} rows: preliminary."]


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


def write_table(table, columns, caption: str, notes, csv, tex, md) -> None:
    """``table``, `rounded`, as CSV; the ``columns`` of it as LaTeX and Markdown, with notes."""
    table = rounded(table)
    write_csv(table, csv)
    for path, form in ((tex, latex), (md, markdown)):
        write_bytes(form(table, columns, caption, notes).encode(), path)


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
