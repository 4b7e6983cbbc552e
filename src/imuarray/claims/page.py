"""The claims as a page to read."""

import pandas as pd

from imuarray.claims.registry import VERDICTS

TITLES = {
    "2017": "On-the-fly geometric calibration of inertial sensor arrays (2017)",
    "2021": "Quantifying the uncertainty of the relative geometry in inertial sensor arrays (2021)",
}
COLUMNS = {
    "id": "Id", "section": "Section", "claim": "Claim", "paper_value": "Paper",
    "our_value": "Ours", "our_error": "Monte Carlo error", "criterion": "Stands if",
    "verdict": "Verdict", "remark": "Remark",
}  # fmt: skip


def counts(table: pd.DataFrame) -> pd.DataFrame:
    """Number of claims by paper and verdict."""
    return pd.crosstab(table.paper, table.verdict).reindex(columns=VERDICTS, fill_value=0)


def _cell(value) -> str:
    return " ".join(str(value).split()).replace("|", "\\|")


def _rows(frame: pd.DataFrame, header) -> list[str]:
    lines = ["| " + " | ".join(header) + " |", "|" + " --- |" * len(header)]
    cells = frame.to_numpy().tolist()
    return lines + ["| " + " | ".join(map(_cell, row)) + " |" for row in cells]


def markdown(table: pd.DataFrame, settings: dict) -> str:
    """A table for each paper with the counts, the scale and the seed above them."""
    scale, seed = settings["scale"]["name"], settings["seed"]
    clock = ", ".join(table.id[table.rests_on == "clock"])
    lines = [
        "# The papers' claims", "",
        f"Scale `{scale}`, seed {seed}. Every verdict is computed from the result files of this"
        " scale; errors are Monte Carlo standard errors. The tables and the plotted values of the"
        " papers are not in their text, so only what the text says is compared.",
        f"Ratios of clock times, with room for any machine: {clock}.", "",
    ]  # fmt: skip
    lines += _rows(counts(table).reset_index(), ["Paper", *VERDICTS])
    for paper, title in TITLES.items():
        lines += ["", f"## {title}", ""]
        lines += _rows(table.loc[table.paper == paper, list(COLUMNS)], COLUMNS.values())
    return "\n".join(lines) + "\n"
