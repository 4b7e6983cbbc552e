"""Paper 2021: tuning, chains and posteriors. (Its array: `paper2021_array`.)"""

import numpy as np
import pandas as pd
from matplotlib.lines import Line2D
from matplotlib.ticker import EngFormatter
from scipy.stats import gaussian_kde, norm

from imuarray.pictures.style import BLACK, GREY, PAGE, SKY, logarithmic, look
from imuarray_papers.figures.style import (
    chain_lines,
    drawing,
    legend_items,
    level,
    points,
    scale_line,
    significant,
)

TRACE_POINTS = 1000  # drawn per chain; more would not be seen
BINS = 40
GRID = 160
TRUTH = {"color": BLACK, "linewidth": 0.8, "linestyle": (0, (1, 1)), "label": "truth"}
LINEAR = 5.0  # um, where figure 4's axis turns from linear to logarithmic


def figure_2021_fig2(variances: list[pd.DataFrame], settings: dict):
    """Variance of the log-likelihood estimator over N.

    ``variances``: `tuning/variance_T*.csv`. Markers: estimated variance; solid lines: the fit
    c / N (least squares in the logarithms); level: the variance aimed at.
    """
    constants = [np.exp(np.mean(np.log(sweep.variance * sweep.draws))) for sweep in variances]
    table = pd.concat(
        [sweep.assign(fit=c / sweep.draws) for c, sweep in zip(constants, variances, strict=True)],
        ignore_index=True,
    )
    footer = [scale_line(settings, f"{table.realisations.max()} realisations per point")]
    target = settings["paper2021"]["variance_target"]
    return drawing(_draw_fig2, footer, height=2.9, target=target), table


def _draw_fig2(figure, table, target):
    axes = figure.subplots()
    for index, (samples, rows) in enumerate(table.groupby("samples")):
        alone = {"linestyle": "none", "label": f"$T = {samples}$"}
        points(axes, rows.draws, rows.variance, rows.variance_se, index, **alone)
        axes.plot(rows.draws, rows.fit, "-", color=look(index)["color"], linewidth=0.9)
    axes.plot([], [], "-", color=GREY, linewidth=0.9, label=r"$\sim 1/N$")
    level(axes, target, f"target {target:g}", color="0.3", linestyle=(0, (5, 2)))
    ylabel = r"Variance of $\log\,\hat{p}_N(y^{(a)}_{1:T}|\theta)$ (nat$^2$)"
    logarithmic(axes, "Monte Carlo samples $N$ (count)", ylabel)
    axes.legend(*legend_items(axes, [r"$\sim 1/N$"]), loc="lower left", ncols=2)


def figure_2021_fig3(chains: list, verdict: list[dict], coordinates: list, settings: dict):
    """(a) whole traces, and at the scale of the posterior beside the histogram; (b) their ACF.

    Of the first coordinate, in micrometres. ``chains`` as `posterior.chains.read_chains` gives
    them, ``verdict`` and ``coordinates`` of `posterior/`: one of each.
    """
    (found, tree), verdict = chains[0], verdict[0]
    first = tree["posterior"]["accelerometer"].to_numpy()[0]
    table = chain_panels(
        found.draws[..., 0], verdict["burn_in_draws"], found.thin, coordinates[0].truth_m[0]
    )
    name = f"x of IMU {first}, $T = {verdict['samples']}$"
    table.attrs["digits"] = {"value": 7, "low_um": 7, "high_um": 7}  # far from 0, and narrow
    footer = [scale_line(settings), *chain_lines({verdict["samples"]: verdict})]
    steps = verdict["burn_in_steps"]
    return drawing(_draw_fig3, footer, height=4.6, burn_in_steps=steps, name=name), table


def _draw_fig3(figure, table, burn_in_steps, name):
    mosaic = figure.subplot_mosaic(
        [["whole", "whole"], ["trace", "histogram"], ["correlation", "correlation"]],
        width_ratios=[4, 1], height_ratios=[1, 1.4, 1.2],
    )  # fmt: skip
    mosaic["histogram"].sharey(mosaic["trace"])
    for panel in ("trace", "correlation"):  # steps as 200k, 1M
        mosaic[panel].xaxis.set_major_formatter(EngFormatter(sep=""))
        mosaic[panel].locator_params(axis="x", nbins=6)
    for panel in ("whole", "trace"):
        _traces(mosaic[panel], table, burn_in_steps)
    _histograms(mosaic["histogram"], table)
    for chain, rows in table[table.panel == "autocorrelation"].groupby("chain"):
        mosaic["correlation"].plot(rows.step, rows.value, **_ink(chain), label=f"chain {chain}")
    mosaic["correlation"].axhline(0, color=GREY, linewidth=0.6)
    mosaic["correlation"].set(xlabel="Lag (steps)", ylabel="Autocorrelation (1)", xlim=(0, None))
    mosaic["correlation"].set_title("(b) after burn-in", size=8)
    mosaic["whole"].set_title(f"(a) {name}: whole trace, and zoomed", size=8)
    mosaic["whole"].tick_params(labelbottom=False)
    bins = table[(table.panel == "histogram") & (table.value > 0)]
    margin = 0.15 * (bins.high_um.max() - bins.low_um.min())
    mosaic["trace"].set_ylim(bins.low_um.min() - margin, bins.high_um.max() + margin)
    mosaic["trace"].set_xlabel("Step (count)")
    figure.align_ylabels()
    figure.legend(*legend_items(mosaic["whole"]), loc="outside upper center", ncols=4)


def chain_panels(series, burn_in: int, thin: int, truth: float | None = None) -> pd.DataFrame:
    """Trace, histogram and autocorrelation of chains ``series`` (chains, draws) in metres.

    ``burn_in`` stored draws are left out of histogram and autocorrelation; a stored draw is
    ``thin`` steps. Columns: panel (trace, histogram, autocorrelation, truth), chain (from 1),
    step (of a draw, or the lag), low_um, high_um (of a histogram's bin), value (um, density
    per um, or 1).
    """
    series = np.asarray(series, float) * 1e6
    left = series[:, burn_in:]
    every = max(1, series.shape[1] // TRACE_POINTS)
    edges = np.linspace(left.min(), left.max(), BINS + 1)
    correlation = _autocorrelations(left)
    parts = []
    for chain, draws in enumerate(series, start=1):
        kept = np.arange(0, draws.size, every)
        density = np.histogram(left[chain - 1], edges, density=True)[0]
        function = correlation[chain - 1]
        for name, columns in (
            ("trace", {"step": (kept + 1) * thin, "value": draws[kept]}),
            ("histogram", {"low_um": edges[:-1], "high_um": edges[1:], "value": density}),
            ("autocorrelation", {"step": np.arange(function.size) * thin, "value": function}),
        ):
            parts.append(pd.DataFrame({"panel": name, "chain": chain, **columns}))
    if truth is not None:
        parts.append(pd.DataFrame({"panel": "truth", "chain": 0, "value": [1e6 * truth]}))
    columns = ["panel", "chain", "step", "low_um", "high_um", "value"]
    return pd.concat(parts, ignore_index=True).reindex(columns=columns)


def _autocorrelations(left) -> np.ndarray:
    """Autocorrelations (chains, lags), up to three times the lag where all are below 0.05.

    At most a quarter of the chain: what lies beyond is noise.
    """
    from emcee.autocorr import function_1d

    longest = max(2, left.shape[1] // 4)
    functions = np.array([function_1d(draws)[:longest] for draws in left])
    low = np.flatnonzero((functions < 0.05).all(axis=0))
    return functions[:, : max(20, 3 * low[0]) if low.size else longest]


def _traces(axes, table, burn_in_steps):
    for chain, rows in table[table.panel == "trace"].groupby("chain"):
        axes.plot(rows.step, rows.value, linewidth=0.6, **_ink(chain), label=f"chain {chain}")
    _truth(axes, table)
    axes.axvspan(0, burn_in_steps, color="0.85", zorder=0, label="burn-in")
    axes.set(xlim=(0, table[table.panel == "trace"].step.max()), ylabel="Position (µm)")


def _histograms(axes, table):
    for chain, rows in table[table.panel == "histogram"].groupby("chain"):
        edges = [*rows.low_um, rows.high_um.iloc[-1]]
        axes.stairs(rows.value, edges, orientation="horizontal", linewidth=0.9, **_ink(chain))
    _truth(axes, table)
    axes.tick_params(labelleft=False)
    axes.set(xlabel="Density\n(1/µm)", xlim=(0, None))
    peak = table[table.panel == "histogram"].value.max()
    unit = 10.0 ** np.floor(np.log10(peak))
    tick = unit * np.floor(peak / unit)  # the peak, rounded down to one digit
    axes.set_xticks([0, tick], ["0", significant(tick)])


def _ink(chain: int) -> dict:
    """Colour and dashes of a chain: blue and full, vermillion and dashed, ..."""
    return look({1: 2, 2: 0}.get(int(chain), int(chain)), "marker")


def _truth(axes, table):
    for value in table[table.panel == "truth"].value:
        axes.axhline(value, **TRUTH)


def after_burn_in(chains: list, verdicts: list[dict]) -> tuple[dict, dict]:
    """By T, the positions' draws after burn-in, (chains, draws, A - 1, 3) m; the verdicts by T."""
    draws = {
        verdict["samples"]: tree["posterior"]["position"].to_numpy()[:, verdict["burn_in_draws"] :]
        for (_, tree), verdict in zip(chains, verdicts, strict=True)
    }
    return draws, {verdict["samples"]: verdict for verdict in verdicts}


def prior_of(chains: list) -> list[np.ndarray]:
    """Mean and sd of the positions' prior, (A - 1, 3) m each."""
    prior = chains[-1][1]["prior"]
    return [prior[f"position_{name}"].to_numpy() for name in ("mean", "sd")]


def figure_2021_fig4(chains: list, verdicts: list[dict], coordinates: list, settings: dict):
    """Posterior of IMU 2's position: as wide as the widest one (left), and with the prior (right).

    The right axis is asinh, so that all widths are seen. The peak of each posterior is at 1.
    ``chains`` as `posterior.chains.read_chains` gives them, ``verdicts`` and ``coordinates`` of
    `posterior/`, one for each T.
    """
    draws, verdicts = after_burn_in(chains, verdicts)
    table = densities(
        {samples: values[:, :, 0] for samples, values in draws.items()},
        [part[0] for part in prior_of(chains)], coordinates[0].truth_m[:3].to_numpy(),
    )  # fmt: skip
    name = f"IMU {chains[-1][1]['posterior']['accelerometer'].to_numpy()[0]}"
    footer = [scale_line(settings), *chain_lines(verdicts)]
    return drawing(_draw_fig4, footer, PAGE, 4.9, name=name), table


def _draw_fig4(figure, table, name):
    panels = figure.subplots(3, 2, sharex="col", sharey=True)
    for letter, row, (axis, rows) in zip("abc", panels, table.groupby("axis"), strict=True):
        for axes in row:
            _posteriors(axes, rows)
        truth = f"{1e3 * rows.truth_m.iloc[0]:.4g}".replace("-", "−")
        title = f"({letter}) {axis} of {name}, true value {truth} mm"
        row[0].set(ylabel="Density / peak (1)", ylim=(0, 1.08), title=title)
        sds = rows[rows.samples > 0].groupby("samples").sd_um.first()
        spreads = [f"$T={samples}$: {significant(sd)}" for samples, sd in sds.items()]
        row[1].set_title(f"sd (µm) {', '.join(spreads)}")
    widest = table[table.samples > 0].deviation_um
    near = (widest.min(), widest.max())
    panels[-1, 0].set(xlabel="Deviation from the true value (µm)", xlim=near)
    panels[-1, 1].set_xlabel("Deviation from the true value (µm), asinh scale")
    panels[-1, 1].set_xscale("asinh", linear_width=LINEAR)
    powers = [10.0**k for k in (1, 2, 3, 4)]
    panels[-1, 1].set_xticks(
        [*(-power for power in powers[::-1]), 0, *powers],
        ["$-10^4$", "$-10^3$", "$-100$", "$-10$", "0", "10", "100", "$10^3$", "$10^4$"],
    )
    handles, labels = legend_items(panels[0, 0])
    for number in range(2):
        handles.append(Line2D([], [], color=GREY, linestyle=_dashes(number)))
        labels.append(f"chain {number + 1}")
    figure.legend(handles, labels, loc="outside upper center", ncols=len(labels))


def densities(posteriors: dict[int, np.ndarray], prior, truth) -> pd.DataFrame:
    """Densities of a triad's coordinates around the truth (Gaussian kernels, Scott's rule).

    ``posteriors[T]`` (chains, draws, 3) m after burn-in; ``prior`` mean and sd, each (3,) m;
    ``truth`` (3,) m. Columns: distribution (prior, posterior), samples (0: prior), axis, chain
    (0: prior), deviation_um, density_per_um, sd_um (of all chains together), truth_m.
    """
    parts = []
    for number, axis in enumerate("xyz"):
        centre, spread = (1e6 * (prior[0][number] - truth[number]), 1e6 * prior[1][number])
        grid = centre + spread * np.linspace(-4, 4, GRID)
        made = [("prior", 0, 0, grid, norm.pdf(grid, centre, spread), spread)]
        for samples, draws in posteriors.items():
            values = 1e6 * (draws[..., number] - truth[number])
            for chain, one in enumerate(values, start=1):
                grid = one.mean() + one.std(ddof=1) * np.linspace(-4, 4, GRID)
                density = gaussian_kde(one)(grid)
                made.append(("posterior", samples, chain, grid, density, values.std(ddof=1)))
        for name, samples, chain, grid, density, sd in made:
            parts.append(pd.DataFrame({
                "distribution": name, "samples": samples, "chain": chain, "deviation_um": grid,
                "density_per_um": density, "sd_um": sd, "axis": axis, "truth_m": truth[number],
            }))  # fmt: skip
    return pd.concat(parts, ignore_index=True)


def _posteriors(axes, rows):
    """Prior, posteriors and truth of one coordinate.

    The first chain is full and the others are dashed; the peak of all chains is at 1.
    """
    for index, (samples, some) in enumerate(rows.groupby("samples"), start=-1):
        label = f"$T = {samples}$" if samples else "prior"
        style = look(index, "linestyle") if samples else {"color": SKY, "linestyle": ":"}
        for number, (_, one) in enumerate(some.groupby("chain")):
            axes.plot(
                one.deviation_um, one.density_per_um / some.density_per_um.max(),
                label=label if number == 0 else None, markevery=(8 * number, 16), markersize=3,
                markerfacecolor="none", **({"linestyle": _dashes(number)} | style),
            )  # fmt: skip
    axes.axvline(0, **TRUTH)


def _dashes(number: int):
    return "-" if number == 0 else (0, (4, 2))
