"""The result files of one scale, read when a claim asks for them."""

import json
from pathlib import Path
from typing import Self

import numpy as np
import pandas as pd

from imuarray.errors import InputError
from imuarray_papers.claims.registry import Missing, Outcome, untested

SEVERAL = untested(
    "several measured recordings with still poses needed, and more than the quick scale"
)


class Results:
    """Tables and summaries below ``root`` (results/<scale>), by path without the root.

    ``settings`` is the effective configuration; ``given`` replaces or adds contents by path.
    The recording that is the experiment is ``measured``, of ``board``.
    """

    def __init__(self, root, settings: dict, given: dict | None = None):
        self.root, self.settings = Path(root), settings
        self._read = dict(given or {})
        self.measured = settings["experiment"]["recording"]
        self.board = settings["recordings"][self.measured].get("group", self.measured)

    def measured_table(self, path: str) -> pd.DataFrame:
        """A CSV file below results/measured, by its path without the ending."""
        return self._cached(f"../measured/{path}", ".csv", pd.read_csv)

    def of_board(self, path: str, otherwise: Outcome = SEVERAL) -> pd.DataFrame:
        """`measured_table` of what only a board of several recordings has.

        Where there is none, the claim has the outcome ``otherwise``.
        """
        try:
            return self.measured_table(path)
        except InputError:
            raise Missing(otherwise) from None

    def replace(self, contents: dict) -> Self:
        """A copy with other ``contents`` by path."""
        return Results(self.root, self.settings, self._read | contents)

    def _cached(self, path: str, suffix: str, reader):
        if path not in self._read:
            place = self.root / f"{path}{suffix}"
            if not place.exists():
                raise InputError(f"{place}: expected a result of this scale, found no file")
            self._read[path] = reader(place)
        return self._read[path]

    def table(self, path: str) -> pd.DataFrame:
        """A CSV file, by its path without the ending."""
        return self._cached(path, ".csv", pd.read_csv)

    def json(self, path: str) -> dict:
        """A JSON file, by its path without the ending."""
        # tables and summaries of one posterior differ only in their ending
        return self._cached(f"{path}.json", "", lambda p: json.loads(p.read_text("utf-8")))

    def source(self, name: str):
        """A `table` by its path, or an entry of a summary: its `json` path, a colon, its name.

        Of a path with {}, which stands for T, those of all `samples`, by T.
        """
        if "{}" in name:
            return {t: self.source(name.format(t)) for t in self.samples}
        path, _, entry = name.partition(":")
        return self.json(path)[entry] if entry else self.table(path)

    def chains(self, name: str) -> np.ndarray:
        """Draws (chains, n, A - 1, 3) m of chains/``name``, the burn-in left out."""

        from imuarray.posterior.chains import read_chains

        chains = self._cached(f"chains/{name}", ".nc", lambda place: read_chains(place)[0].draws)
        left = chains[:, self.json(f"posterior/{name}")["burn_in_draws"] :]
        return left.reshape(*left.shape[:2], left.shape[-1] // 3, 3)

    def draws(self, name: str) -> np.ndarray:
        """`chains` with all chains in one row: (n, A - 1, 3) m."""
        chains = self.chains(name)
        return chains.reshape(-1, *chains.shape[2:])

    @property
    def samples(self) -> list[int]:
        """The T's of paper 2021, increasing."""
        return sorted(self.settings["paper2021"]["samples"])

    def posterior(self, name: str) -> pd.DataFrame:
        """Truth, mean and sd (m) per coordinate: of converged chains, else linearised."""
        converged = self.json(f"posterior/{name}")["converged"]
        return self.table(f"posterior/{name}") if converged else self.linearised(name)

    def linearised(self, name: str) -> pd.DataFrame:
        """The linearised posterior called ``name``, as in `posterior`."""
        table = self.table("claims/linearised")
        return table[table.name == name].reset_index(drop=True)

    def posteriors(self, prefix: str = "") -> dict[int, pd.DataFrame]:
        """By T, what `posterior` gives of ``prefix`` T..."""
        return {t: self.posterior(f"{prefix}T{t}") for t in self.samples}

    def unconverged(self, name: str) -> str:
        """A remark on chains that have not converged."""
        return (
            f"chains {name} not converged (R-hat {self.json(f'posterior/{name}')['rhat_max']:.3g})"
        )

    def sources(self, *prefixes: str) -> str:
        """A remark on where the posteriors of all T with these prefixes come from."""
        names = [f"{prefix}T{t}" for prefix in prefixes or ("",) for t in self.samples]
        worst = {name: self.json(f"posterior/{name}") for name in names}
        short = [f"{n}: R-hat {v['rhat_max']:.3g}" for n, v in worst.items() if not v["converged"]]
        if not short:
            return "from the chains, all converged"
        return (
            f"chains not converged at this scale ({', '.join(short)}): linearised posterior there"
        )
