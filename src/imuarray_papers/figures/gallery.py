"""`paper_figures/README.md`: every figure and table with its caption and its parameters."""

import re
from collections.abc import Sequence
from types import SimpleNamespace

from jinja2 import Environment, StrictUndefined

HEAD = """# Figures and tables of the two papers

Made by `snakemake` at scale `{scale}`, seed {seed}; do not edit. Every claim of the papers with
our value and a verdict: [claims.md](claims.md), [claims.csv](claims.csv). Figures of `theory` and
`validate` are in [docs/uncertainty.md](../docs/uncertainty.md), of `blind` in
[docs/findings.md](../docs/findings.md#is-the-diagnosis-reliable), of diagnoses in
[docs/measured.md](../docs/measured.md). The JSON file of a figure or table is the configuration
that it was made from.

The chains behind the figures and tables of 2021:

{chains}
"""


GROUPS = {"measured": "Measured data", "criticism": "What the papers' model gets wrong"}


def caption(template: str, settings: dict) -> str:
    """The caption that the report shows too: a template that prints its parameters."""
    environment = Environment(undefined=StrictUndefined, autoescape=False)
    job = SimpleNamespace(params=SimpleNamespace(settings=settings), wildcards=SimpleNamespace())
    return environment.from_string(template).render(snakemake=job).strip()


def title(name: str) -> str:
    """'Paper 2021, figure 4' of '2021_fig4'."""
    year, *words = name.split("_")
    if year in GROUPS:
        return ": ".join(filter(None, [GROUPS[year], " ".join(words)]))
    if found := re.fullmatch(r"(fig|table)(\d+)", words[0]):
        kind, number = found.groups()
        words = ["figure", number] if kind == "fig" else ["table", "I" * int(number)]
    return f"Paper {year}, {' '.join(words)}"


def gallery(
    figures: dict[str, str], tables: dict[str, tuple[str, str]], settings: dict,
    chains: dict[str, Sequence[str]],
) -> str:  # fmt: skip
    """The page. ``figures``: caption by name; ``tables``: caption and Markdown by name.

    ``chains``: lines on how good the chains are, by the data they are of.
    """
    groups = [
        "\n".join([f"{data}:\n", *(f"- {line}" for line in lines)])
        for data, lines in chains.items()
    ]
    name, seed = settings["scale"]["name"], settings["seed"]
    parts = [HEAD.format(scale=name, seed=seed, chains="\n\n".join(groups))]
    for name, text in figures.items():
        links = f"[PDF]({name}.pdf), [PNG]({name}.png), [numbers (CSV)]({name}.csv)"
        picture = f"![{title(name)}]({name}.png)"
        parts.append(f"## {title(name)}\n\n{picture}\n\n{text}\n\n{links}\n")
    for name, (text, body) in tables.items():
        links = f"[LaTeX]({name}.tex), [Markdown]({name}.md), [numbers (CSV)]({name}.csv)"
        parts.append(f"## {title(name)}\n\n{body.strip()}\n\n{text}\n\n{links}\n")
    return "\n".join(parts)
