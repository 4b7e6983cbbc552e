"""`paper_figures/README.md`: every figure and table with its caption and its parameters."""

import re
from collections.abc import Sequence
from types import SimpleNamespace

from jinja2 import Environment, PackageLoader, StrictUndefined

GROUPS = {"measured": "Measured data", "criticism": "What the papers' model gets wrong"}
ENVIRONMENT = Environment(
    loader=PackageLoader("imuarray_papers.figures", "."), undefined=StrictUndefined,
    autoescape=False, trim_blocks=True,
)  # fmt: skip


def caption(template: str, settings: dict) -> str:
    """The caption that the report shows too: a template that prints its parameters."""
    job = SimpleNamespace(params=SimpleNamespace(settings=settings), wildcards=SimpleNamespace())
    return ENVIRONMENT.from_string(template).render(snakemake=job).strip()


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
    page = ENVIRONMENT.get_template("gallery.md.j2").render(
        figures=figures, tables=tables, chains=chains, title=title,
        scale=settings["scale"]["name"], seed=settings["seed"],
    )  # fmt: skip
    return page.rstrip() + "\n"
