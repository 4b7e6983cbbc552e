"""Which measured recordings there are, once they have been fetched."""

import json
import re
from pathlib import Path

STANDIN = "standin"
FIGURE = ("pdf", "png", "csv")  # endings of what a drawing rule writes
TABLE = ("csv", "tex", "md")
DIAGNOSED = ("positions", "parameters", "recordings")  # tables of a board's diagnoses

# By pattern of its name, what a file of paper_figures/ copies; the first that fits counts.
PLACES = {
    r"\d{4}_fig\d+|theory_(efficiency|convergence|size)|validation_ranks": "{scale}/figures/{name}",
    r"\d{4}_table\d|theory_ranks|validation_(coverage|joint)": "{scale}/tables/{name}",
    "claims": "{scale}/claims/claims",
    "claims_paper": "paper/claims/claims",
    "blind_confusion": "blind/{scale}/figures/{name}",
    "blind_bars": "blind/{scale}/tables/{name}",
    "diagnosis_(positions|parameters|recordings)_.*": "measured/tables/{name}",
    "added_.*|(causes|experiment|past_rail)_table_.*|left_out_.*": "measured/tables/{name}",
    "diagnosis_.*|past_rail_.*|causes_.*|experiment_.*": "measured/figures/{name}",
}


class Measured:
    """Names and paths that depend on what the checkpoint `fetch_recordings` could get."""

    def __init__(self, config, checkpoints):
        self.config, self.checkpoints = config, checkpoints

    def available(self) -> dict:
        """By name, the files of each recording that is here."""
        path = self.checkpoints.fetch_recordings.get().output[0]
        return json.loads(Path(path).read_text(encoding="utf-8"))["available"]

    def is_first_order(self, name: str) -> bool:
        """Whether each triad of a recording is calibrated from still poses first."""
        return self.config["recordings"][name].get("first_order", True)

    def recording(self, name: str) -> str:
        """The file of a recording that all that follows reads."""
        folder = "corrected" if self.is_first_order(name) else "recordings"
        return f"results/measured/{folder}/{name}.nc"

    def board(self, group: str) -> list[str]:
        """All recordings of a board that went through the first-order calibration."""
        entries = self.config["recordings"]
        return [
            name
            for name in self.available()
            if entries[name].get("group", name) == group and self.is_first_order(name)
        ]

    def others(self, name: str) -> list[str]:
        """The other recordings of the same board, the next one first."""
        names = self.board(self.config["recordings"][name].get("group", name))
        place = names.index(name) if name in names else 0
        return [other for other in names[place:] + names[:place] if other != name]

    def groups(self) -> dict[str, list[str]]:
        """Recordings of one board, where there are two or more."""
        groups = {}
        for name in self.available():
            groups.setdefault(self.config["recordings"][name].get("group", name), []).append(name)
        return {group: names for group, names in groups.items() if len(names) > 1}

    def experiment(self, scale: str) -> str:
        """The recording drawn as the experiment, or the stand-in for it."""
        name = self.config["experiment"]["recording"]
        if scale == "quick" or name not in self.config["recordings"]:
            return STANDIN
        return name if name in self.available() else STANDIN

    def is_measured(self, scale: str) -> bool:
        """Whether the experiment's figures come from measured data."""
        return self.experiment(scale) != STANDIN

    def source(self, scale: str) -> str:
        """What the experiment's data are, as `imuarray.figures.notes.SOURCES` calls it."""
        return "measured" if self.is_measured(scale) else STANDIN

    def label(self, scale: str, sources: dict[str, str]) -> str:
        """The same in words, with the recording's name."""
        words = sources[self.source(scale)]
        return f"{words}, {self.experiment(scale)}" if self.is_measured(scale) else words

    def recordings(self, scale: str) -> list[str]:
        """The experiment's recordings, if they are measured: the array's geometry."""
        if not self.is_measured(scale):
            return []
        samples = self.config["paper2021"]["samples"]
        return [f"results/measured/subsets/{self.experiment(scale)}_T{t}.nc" for t in samples]

    def simulation(self, scale: str) -> str:
        """The simulation that goes with the experiment."""
        name = self.experiment(scale)
        return "simulation" if name == STANDIN else f"simulated_{name}"

    def posterior(self, scale: str, kind: str, folder: str, endings) -> list[str]:
        """Files results/<scale>/<folder>/<kind>_T<samples>.<ending>."""
        return [
            f"results/{scale}/{folder}/{kind}_T{samples}.{ending}"
            for samples in self.config["paper2021"]["samples"]
            for ending in endings
        ]

    def claims(self, scale: str) -> list[str]:
        """What the claims on the experiment read, if it is measured."""
        if not self.is_measured(scale):
            return []
        name = self.experiment(scale)
        group = self.config["recordings"][name].get("group", name)
        paths = [f"results/measured/positions/{name}.csv"]
        if self.is_first_order(name):
            paths.append(f"results/measured/first_order/{name}_noise.csv")
        if group in self.groups():
            paths.append(f"results/measured/agreement/{group}.csv")
        for kind in (name, self.simulation(scale)):
            paths += self.posterior(scale, kind, "posterior", ["csv", "json"])
            paths += self.posterior(scale, kind, "chains", ["nc"])
        return paths

    def targets(self) -> list[str]:
        """What the default target asks of the measured data, for each recording and group."""
        entries, paths = self.config["recordings"], []
        for name in self.available():
            paths += [f"results/measured/figures/residuals_{name}.{kind}" for kind in FIGURE]
            paths.append(f"results/measured/positions/{name}.csv")
            if self.is_first_order(name):
                paths += [f"results/measured/figures/noise_{name}.{kind}" for kind in FIGURE]
                group = entries[name].get("group", name)
                paths.append(f"results/measured/tables/first_order_{group}.md")
        for group in self.groups():
            paths += [f"results/measured/figures/agreement_{group}.{kind}" for kind in FIGURE]
            paths.append(f"results/measured/tables/agreement_{group}.md")
        return sorted(set(paths))

    def diagnoses(self) -> list[str]:
        """Diagnoses of all recordings, their agreement where a board has several."""
        folder = "results/measured"
        paths = [f"{folder}/diagnosis/{name}/diagnosis.json" for name in self.available()]
        for group in self.groups():
            paths += [f"{folder}/figures/diagnosis_{group}.{k}" for k in FIGURE]
        return paths

    def causes(self) -> list[str]:
        """What each cause buys on each board with several recordings, and the experiment anew."""
        folder = "results/measured"
        paths = [f"{folder}/figures/causes_{group}.{k}" for group in self.groups() for k in FIGURE]
        names = [
            f"{name}_{group}.md"
            for name in ("causes_table", "experiment_table", "left_out", "past_rail_table")
            for group in self.groups()
        ]
        shown = self.config["experiment"]["recording"]
        if any(shown in self.board(group) for group in self.groups()):
            paths += [f"{folder}/figures/experiment_{shown}.{kind}" for kind in FIGURE]
        return paths + [f"{folder}/tables/{name}" for name in names]

    def published(self, scale: str) -> dict[str, str]:
        """Names of the measured figures and tables in paper_figures/, and what they copy."""
        name = self.experiment(scale)
        if name == STANDIN:
            return {}
        group = self.config["recordings"][name].get("group", name)
        copies = {"measured_residuals": f"figures/residuals_{name}"}
        if self.is_first_order(name):
            copies["measured_noise"] = f"figures/noise_{name}"
        if self.board(group):
            copies["measured_first_order_table"] = f"tables/first_order_{group}"
        if group in self.groups():
            copies["measured_agreement"] = f"figures/agreement_{group}"
            copies["measured_agreement_table"] = f"tables/agreement_{group}"
        return copies

    def published_names(self, scale: str, folder: str) -> list[str]:
        """Those of them that are "figures", or "tables"."""
        return [name for name, of in self.published(scale).items() if of.startswith(folder)]

    def published_files(self, scale: str) -> list[str]:
        """Their files in paper_figures/."""
        return [
            f"paper_figures/{name}.{kind}"
            for folder, kinds in (("figures", FIGURE), ("tables", TABLE))
            for name in self.published_names(scale, folder)
            for kind in kinds
        ]

    def studied(self) -> list[str]:
        """Files in paper_figures/ of what is not in the default target: diagnoses and causes."""
        name = self.config["experiment"]["recording"]
        if name not in self.available():
            return []
        group = self.config["recordings"][name].get("group", name)
        last = self.board(group)[-1]
        kinds = {f"diagnosis_{part}_{group}": ["csv"] for part in DIAGNOSED}
        kinds |= {f"{part}_{group}": FIGURE for part in ("causes", "diagnosis")}
        kinds |= {f"{part}_{name}": FIGURE for part in ("experiment", "past_rail")}
        kinds |= {f"{part}_table_{group}": TABLE for part in ("causes", "experiment", "past_rail")}
        kinds |= {f"left_out_{group}": TABLE, f"added_{last}": TABLE}
        kinds |= {f"cause_sensor_clock_{last}": FIGURE}
        return [f"paper_figures/{stem}.{kind}" for stem, ends in kinds.items() for kind in ends]

    def origin(self, name: str) -> str:
        """What paper_figures/<name> copies, but for the ending."""
        scale = self.config["scale"]
        for pattern, place in PLACES.items():
            if re.fullmatch(pattern, name):
                return f"results/{place.format(scale=scale, name=name)}"
        return f"results/measured/{self.published(scale)[name]}"
