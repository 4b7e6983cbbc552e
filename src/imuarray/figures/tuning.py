"""Paper 2021, figure 2: variance of the log-likelihood estimator over N."""

from __future__ import annotations

import numpy as np
import pandas as pd

from imuarray.figures.style import GREY, legend_items, look, new_figure, styled


def fig2_table(sweeps: list[pd.DataFrame]) -> pd.DataFrame:
    """All `tuning/variance_T*.csv`, with the fit c / N (least squares in the logarithms)."""
    tables = []
    for sweep in sweeps:
        constant = np.exp(np.mean(np.log(sweep.variance * sweep.draws)))
        tables.append(sweep.assign(fit=constant / sweep.draws))
    return pd.concat(tables, ignore_index=True)


@styled
def fig2(table: pd.DataFrame, target: float, footer=()):
    """Markers: estimated variance; solid lines: ~ 1/N; level: the variance aimed at."""
    figure = new_figure(footer, height=2.9)
    axes = figure.subplots()
    for index, (samples, rows) in enumerate(table.groupby("samples")):
        style = look(index, "linestyle")
        axes.errorbar(
            rows.draws, rows.variance, rows.variance_se, linestyle="none", label=f"$T = {samples}$",
            markerfacecolor="none", **style,
        )  # fmt: skip
        axes.plot(rows.draws, rows.fit, "-", color=style["color"], linewidth=0.9)
    axes.plot([], [], "-", color=GREY, linewidth=0.9, label=r"$\sim 1/N$")
    axes.axhline(target, color="0.3", linestyle=(0, (5, 2)), linewidth=0.8)
    axes.annotate(
        f"target {target:g}", (0.99, target), xycoords=("axes fraction", "data"), xytext=(0, 2),
        textcoords="offset points", ha="right", size=7, color="0.3",
    )  # fmt: skip
    axes.set(
        xscale="log", yscale="log", xlabel="Monte Carlo samples $N$ (count)",
        ylabel=r"Variance of $\log\,\hat{p}_N(y^{(a)}_{1:T}|\theta)$ (nat$^2$)",
    )  # fmt: skip
    axes.legend(*legend_items(axes, [r"$\sim 1/N$"]), loc="lower left", ncols=2)
    return figure
