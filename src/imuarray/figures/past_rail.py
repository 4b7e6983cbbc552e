"""Past the gyroscopes' rail on measured data: the counterpart of paper 2017's figure 3."""

from __future__ import annotations

import pandas as pd

from imuarray.figures.style import PAGE, look, new_figure, styled

SERIES = {
    "clipped": "gyroscopes at the rail",
    "nominal": "papers' model, nominal positions",
    "calibrated": "papers' model, calibrated positions",
    "delayed": "the same and one delay",
    "transferred": "both from another recording",
    "extended": "extended model",
}


@styled
def past_rail_figure(table: pd.DataFrame, rail_dps: float, footer=()):
    """Median error and RMSE of the hidden readings over the angular rate; log-log."""
    figure = new_figure(footer, PAGE, 2.8)
    panels = figure.subplots(1, 2, sharey=True)
    # a normal error of sd 1 has the median 0.674
    columns = (
        ("median_dps", "median |error|", "sd_dps", 0.674),
        ("rmse_dps", "RMSE", "rms_sd_dps", 1),
    )
    for axes, (column, title, claimed, factor) in zip(panels, columns, strict=True):
        for number, (name, label) in enumerate(SERIES.items()):
            rows = table[table.model == name]
            if len(rows):
                axes.plot(rows.rate_dps, rows[column], label=label, **look(number), markersize=4)
        rows = table[table.model == "extended"]
        axes.plot(rows.rate_dps, factor * rows[claimed], color="0.4", linestyle=(0, (1, 1.5)),
                  linewidth=1, label="extended model, as noise alone claims")  # fmt: skip
        axes.axvline(rail_dps, color="0.6", linewidth=0.8)
        axes.set(xscale="log", yscale="log", xlabel="angular rate of the hidden axis (deg/s)")
        axes.set_xticks([250, 500, 1000, 2000], ["250", "500", "1000", "2000"])
        axes.set_xticks([], minor=True)
        axes.set_title(title)
    panels[0].set_ylabel("error of the foretold reading (deg/s)")
    handles, labels = panels[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside upper center", ncols=3)
    return figure
