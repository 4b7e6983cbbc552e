"""Names and paths of the measured part: what the configured recordings ask for."""

from imuarray_papers.pipeline.rules import FIGURE, TABLE

DIAGNOSED = ("positions", "parameters", "recordings")  # tables of a board's diagnoses


class Recordings:
    """The recordings of a configuration, the experiment of 2021 and the boards they are of."""

    def __init__(self, config: dict):
        self.entries = config["recordings"]
        self.shown = config["experiment"]["recording"]
        self.samples = config["paper2021"]["samples"]

    def is_first_order(self, name: str) -> bool:
        """True where each triad of a recording is calibrated from still poses first."""
        return self.entries[name].get("first_order", True)

    def recording(self, name: str) -> str:
        """The file of a recording that all that follows reads."""
        folder = "corrected" if self.is_first_order(name) else "recordings"
        return f"results/measured/{folder}/{name}.nc"

    def group(self, name: str) -> str:
        """The board that a recording is of."""
        return self.entries[name].get("group", name)

    def groups(self) -> dict[str, list[str]]:
        """Recordings of one board, where there are two or more."""
        groups = {}
        for name in self.entries:
            groups.setdefault(self.group(name), []).append(name)
        return {group: names for group, names in groups.items() if len(names) > 1}

    def board(self, group: str) -> list[str]:
        """All recordings of a board that went through the first-order calibration."""
        names = filter(self.is_first_order, self.entries)
        return [name for name in names if self.group(name) == group]

    def others(self, name: str) -> list[str]:
        """The other recordings of the same board, the next one first."""
        names = self.board(self.group(name))
        place = names.index(name) if name in names else 0
        return [other for other in names[place:] + names[:place] if other != name]

    def posterior(self, scale: str, kind: str, folder: str, endings) -> list[str]:
        """Files results/<scale>/<folder>/<kind>_T<samples>.<ending>."""
        names = [f"{kind}_T{samples}" for samples in self.samples]
        return [f"results/{scale}/{folder}/{name}.{ending}" for name in names for ending in endings]

    def subsets(self) -> list[str]:
        """The experiment's samples."""
        return [f"results/measured/subsets/{self.shown}_T{samples}.nc" for samples in self.samples]

    def claims(self, scale: str) -> list[str]:
        """Files that the claims on the experiment read."""
        name, group = self.shown, self.group(self.shown)
        made = [f"positions/{name}.csv", f"subsets/{name}_selection.csv"]
        if self.is_first_order(name):
            made.append(f"first_order/{name}_noise.csv")
        if group in self.groups():
            made.append(f"agreement/{group}.csv")
        if self.is_criticised and scale != "quick":
            made += [f"causes_{group}.csv", f"residuals/{name}.csv"]
            made.append(f"diagnosis/{name}/diagnosis.json")
        paths = [f"results/measured/{path}" for path in made]
        for kind in (name, f"simulated_{name}"):
            paths += self.posterior(scale, kind, "posterior", ["csv", "json"])
            paths += self.posterior(scale, kind, "chains", ["nc"])
        return paths

    def targets(self) -> list[str]:
        """Files of the measured data in the default target, for each recording and group."""
        paths = []
        for name in self.entries:
            paths.append(f"results/measured/positions/{name}.csv")
            if self.is_first_order(name):
                paths += [f"results/measured/figures/noise_{name}.{kind}" for kind in FIGURE]
                paths.append(f"results/measured/tables/first_order_{self.group(name)}.md")
        for group in self.groups():
            paths += [f"results/measured/figures/agreement_{group}.{kind}" for kind in FIGURE]
            paths.append(f"results/measured/tables/agreement_{group}.md")
        return sorted(set(paths))

    def diagnoses(self) -> list[str]:
        """Diagnoses of all recordings, their agreement where a board has several."""
        folder = "results/measured"
        paths = [f"{folder}/diagnosis/{name}/diagnosis.json" for name in self.entries]
        return paths + [
            f"{folder}/tables/diagnosis_{part}_{group}.csv"
            for group in self.groups() for part in DIAGNOSED
        ]  # fmt: skip

    def causes(self) -> list[str]:
        """Files on each cause's gain on boards of several recordings, and the experiment anew."""
        folder = "results/measured"
        tables = ("causes_table", "experiment_table", "left_out", "past_rail_table")
        paths = [f"{folder}/tables/{name}_{group}.md" for name in tables for group in self.groups()]
        if self.is_criticised:
            paths += [f"{folder}/figures/experiment_{self.shown}.{kind}" for kind in FIGURE]
        return paths

    def published(self) -> dict[str, str]:
        """Names of the experiment's figures and tables in paper_figures/, and what they copy."""
        name, group = self.shown, self.group(self.shown)
        copies = {}
        if self.is_first_order(name):
            copies["measured_noise"] = f"figures/noise_{name}"
            copies["measured_first_order_table"] = f"tables/first_order_{group}"
        if group in self.groups():
            copies["measured_agreement"] = f"figures/agreement_{group}"
            copies["measured_agreement_table"] = f"tables/agreement_{group}"
        names = [f"criticism{end}" for end in ("", "_hidden") if self.is_criticised or end]
        copies |= {each: f"figures/{each}" for each in names}
        copies |= {f"{each}_table": f"tables/{each}_table" for each in names}
        return copies

    @property
    def is_criticised(self) -> bool:
        """True where the recording shown has others of its board, all of first order."""
        group = self.group(self.shown)
        return group in self.groups() and self.shown in self.board(group)

    def hidden(self) -> list[str]:
        """Recordings in which effects are hidden: simulated ones, and the one that is shown."""
        return ["lever_arms", "drawn", *["measured"] * self.is_criticised]

    def control(self, hidden: str) -> str:
        """The folder of the diagnosis without the hidden effect."""
        return f"diagnosis/{self.shown}" if hidden == "measured" else "hidden/nothing"

    def published_names(self, folder: str) -> list[str]:
        """Names of the published "figures", or "tables"."""
        return [name for name, of in self.published().items() if of.startswith(folder)]

    def studied(self) -> dict[str, tuple[str, ...]]:
        """By name in paper_figures/, endings of what is not in the default target."""
        name, group = self.shown, self.group(self.shown)
        last = self.board(group)[-1]
        kinds = {f"diagnosis_{part}_{group}": ("csv",) for part in DIAGNOSED}
        kinds |= {f"{part}_{name}": FIGURE for part in ("experiment", "past_rail")}
        kinds |= {f"{part}_table_{group}": TABLE for part in ("causes", "experiment", "past_rail")}
        return kinds | {
            f"left_out_{group}": TABLE,
            f"cause_sensor_clock_{last}": FIGURE,
        }  # fmt: skip
