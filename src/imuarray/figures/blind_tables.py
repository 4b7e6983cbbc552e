"""Tables of the blind study: the acceptance criteria; gain, position error and coverage."""

import pandas as pd

from imuarray.blind import summary
from imuarray.blind.criteria import criteria
from imuarray.blind.measured import grade_added
from imuarray.figures.tables import Column, scale_line

YES_NO = {True: "yes", False: "no"}

CRITERIA = (
    Column("bar", "set and what is counted", "set and what is counted"),
    Column("aim", "bar", "bar"),
    Column("recordings", "recordings", "n"),
    Column("share", "measured (%)", r"measured (\%)", "{:.1f}", 100.0),
    Column("low", "95 % limits: from", "from", "{:.1f}", 100.0),
    Column("high", "to", "to", "{:.1f}", 100.0),
    Column("verdict", "verdict", "verdict"),
    Column("sure", "certain at 95 %", "sure"),
    Column("all_recordings", "all settings: recordings", "n, all"),
    Column("all_share", "all settings: measured (%)", r"all (\%)", "{:.1f}", 100.0),
)

GAIN = (
    Column("kind", "set", "set"),
    Column("effect", "effect", "effect"),
    Column("recordings", "recordings", "n"),
    Column("gain", "held-out gain (nats per sample)", "gain", "{:.3g}"),
    Column("gain_se", "its standard error", "se", "{:.2g}"),
    Column("gain_median", "median", "median", "{:.3g}"),
    Column("gain_over_inflated", "gain over the base model with larger noise", "over", "{:.3g}"),
    Column("gain_over_inflated_se", "its standard error", "se", "{:.2g}"),
    Column("base_position_rmse_m", "position RMSE, base (µm)", r"base ($\mu$m)", "{:.3g}", 1e6),
    Column("inflated_position_rmse_m", "base, larger noise (µm)", "larger noise", "{:.3g}", 1e6),
    Column(
        "extended_position_rmse_m", "extended (µm)", r"extended ($\mu$m)", "{:.3g}", 1e6
    ),
    Column("base_coverage", "95 % intervals cover, base (%)", r"base (\%)", "{:.1f}", 100.0),
    Column(
        "inflated_coverage", "base, larger noise (%)", r"larger noise (\%)", "{:.1f}", 100.0
    ),
    Column("extended_coverage", "extended (%)", r"extended (\%)", "{:.1f}", 100.0),
)  # fmt: skip

ADDED = (
    Column("effect", "added effect", "effect"),
    Column("amplitude", "size", "size", "{:.3g}"),
    Column("unit", "unit", "unit"),
    Column("sensor", "on IMU", "IMU"),
    Column("found", "found", "found"),
    Column("sensors", "named on IMU", "named on"),
    Column("gain_nats", "held-out gain (nats)", "gain", "{:.3g}"),
    Column("others", "other new names", "others"),
)


def table_added(before: dict, truths: list[dict], after: list[dict], name: str):
    """Effects added to the recording ``name``: found on top of what is there?

    ``before``: the diagnosis of the recording as it is; ``truths``, ``after``: what was added, and
    the diagnosis then.
    """
    pairs = zip(truths, after, strict=True)
    table = pd.DataFrame([grade_added(truth, before, found) for truth, found in pairs])
    table["found"] = table.found.map(YES_NO)
    note = (
        f"Recording {name}; each effect alone, of its largest realistic size, added to one IMU's"
        " readings. Found: named, or among what the named one is indistinguishable from; other new"
        " names are causes that the recording as it is does not have."
    )
    return table, ADDED, "Effects added to a measured recording.", [note]


def table_blind_bars(rows: dict, settings: dict):
    """What was asked of the diagnosis and what was measured; ``rows``: graded recordings."""
    found = summary.recordings(rows["rows"])
    table = criteria(found)
    # empty where there is no verdict to be sure of
    table["sure"] = [YES_NO.get(value, "") for value in table.sure]
    notes = [
        f"{scale_line(settings)}; {len(found)} recordings, {int(found.crash.sum())} without an"
        " answer. Measured: on 8 IMUs, 125 Hz, 24 s, for which the bars are set; all settings"
        " beside it. Limits: Clopper and Pearson's; of the coverage, from the spread between"
        " recordings.",
        "Right class: the effect is named, or among those that the named one is said to be"
        " indistinguishable from. A wrong name: in its class there is nothing of the truth. A"
        " crash counts as a miss where a bar is a least share, and has a bar of its own. In a"
        " gauge the array is not determined, and no intervals around one answer can cover.",
    ]
    caption = "Blind study: what was asked of the diagnosis, and what was measured."
    return table, CRITERIA, caption, notes


def table_blind_gain(rows: dict, settings: dict):
    """Gain, position error and coverage before and after, by effect; ``rows``: as graded."""
    table = summary.gain_table(summary.recordings(rows["rows"]))
    note = (
        f"{scale_line(settings)}. Gains over the base model (and over the same with its noise"
        " enlarged to what its residual shows) are means over recordings, their errors those of"
        " the recordings' own. RMSE: pooled over recordings and coordinates. Coverage: mean share"
        " of the intervals of all coordinates; errors between recordings, medians and the rest are"
        " in the CSV file. In a gauge, the array is not determined: no model can cover."
    )
    return table, GAIN, "Blind study: what the extended model gains.", [note]
