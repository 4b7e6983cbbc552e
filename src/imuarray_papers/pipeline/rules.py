"""Parts that the rules share: settings they depend on, outputs, cores, files from elsewhere."""

import hashlib
import re
from pathlib import Path

FIGURE = ("pdf", "png", "csv")  # endings of what a drawing rule writes
TABLE = ("csv", "tex", "md")
SIZES = {  # the sizes of a scale that a section of the configuration goes with
    "paper2017": ("realisations", "rate_points"),
    "paper2021": ("variance_realisations", "acceptance_steps", "draws", "transitions"),
    "experiment": ("experiment_transitions", "measured_transitions"),
    "theory": ("theory_realisations", "theory_repeats"),
    "validation": ("validation_replicates",),
}
ALWAYS = ("seed", "array", "noise")


def effective(config: dict, scale: str, *sections: str) -> dict:
    """The part of the configuration a rule depends on, with the sizes of one scale.

    Of a section such as "paper2017.fig4" the keys that begin with another figure are left out.
    The numbers of threads and parts are never there: no result depends on them. Without a
    ``scale`` nothing of it is, for results that all scales share.
    """
    found = {name: config[name] for name in ALWAYS}
    if "file" in config["array"]:  # results rest on what is in it
        file = Path(config["array"]["file"])
        digest = hashlib.sha256(file.read_bytes()).hexdigest() if file.is_file() else ""
        found["array_contents"] = [digest]
    sizes = {}
    for section in sections:
        name, _, figure = section.partition(".")
        others = re.compile(rf"fig(?!{figure.removeprefix('fig')}_)\d_" if figure else "$")
        found[name] = {key: x for key, x in config[name].items() if not others.match(key)}
        sizes |= {key: config["scales"][scale][key] for key in SIZES.get(name, ()) if scale}
    return {**found, "scale": {"name": scale, **sizes}} if scale else found


def blind_settings(config: dict, scale: str) -> dict:
    """The part of the configuration that the blind study depends on: it has scenes of its own."""
    cases = config["scales"][scale]["blind_cases"]
    return {"seed": config["seed"], "scale": {"name": scale, "cases": cases}}


def drawn(
    kind: str, name: str, category: str = "", caption: str = "", folder: str = "results/{scale}"
) -> dict:
    """Outputs, by ending, of a rule that makes a "figure" or a "table".

    A figure's PNG or a table's CSV is in the report, if that has a ``category`` for it.
    """
    from snakemake.io import report

    endings, shown = {"figure": (FIGURE, "png"), "table": (TABLE, "csv")}[kind]
    files = {ending: f"{folder}/{kind}s/{name}.{ending}" for ending in endings}
    if category:
        caption = f"../report/{caption or name}.rst"
        files[shown] = report(files[shown], caption=caption, category=category)
    return files


class CoreBudget:
    """Shares of the work: among ``cores`` of this machine, or a cluster's (None)."""

    def __init__(self, config: dict, cores: int | None):
        self.scales, self.cores = config["scales"], cores

    def threads(self, scale: str) -> int:
        """Threads of a heavy job: half of the cores, or others wait through its serial parts."""
        wanted = self.scales[scale]["threads"]
        return wanted if self.cores is None else max(1, min(wanted, self.cores // 2))

    def parts(self, scale: str, study: str = "samples") -> int:
        """Jobs that the realisations of a study are dealt to; those but "samples" are small."""
        return self.scales[scale]["parts"] if study == "samples" else 1


def read_by(page: str) -> list[str]:
    """Names of the published files that the text of a Typst page reads."""
    return sorted(set(re.findall(r'"(\w+\.(?:csv|pdf))"', page)))
