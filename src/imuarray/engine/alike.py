"""Parameters whose size an estimate finds: what triads of one kind have in common, and drifts."""

from dataclasses import replace

import numpy as np

from imuarray.engine.parameters import Columns
from imuarray.engine.settings import SETTINGS
from imuarray.linear import scaled_inverse
from imuarray.model.array_model import unit_of
from imuarray.model.effects import EFFECTS


def sized_groups(columns: Columns) -> np.ndarray:
    """(m,) str: effect and unit of the columns whose prior sd is to be found, "" for all others."""
    return np.array([
        f"{name} {unit_of(name, place)}" if common > 0 or name in EFFECTS and EFFECTS[name].sized
        else ""
        for name, place, common in zip(
            columns.names, columns.places, columns.common_sd, strict=True
        )
    ])  # fmt: skip


def with_likely_spread(columns: Columns, active, values, information, place) -> Columns:
    """The columns, own prior sds as large as the values are likeliest (MacKay).

    As large as differences between triads are, where they have a part in common.
    ``values`` (n,) and ``information`` (n, n), the prior's with it, of all parameters; ``place``:
    where those ``active`` (N, m) bool are among them.
    """
    sds, column, groups = columns.prior_sd.copy(), np.nonzero(active)[1], sized_groups(columns)
    sized = np.setdiff1d(groups[column], "")
    if len(sized) == 0:
        return columns
    prior = scaled_inverse(columns.prior_precision(active))
    covariance, values = scaled_inverse(information)[np.ix_(place, place)], values[place]
    for group in sized:
        mine = np.flatnonzero(groups[column] == group)
        own = np.eye(len(mine))
        if columns.common_sd[column[mine[0]]] > 0:
            same = column[mine][:, None] == column[mine]
            own -= same / same.sum(axis=1)
        square = np.ix_(mine, mine)
        unit = np.outer(sds[column[mine]], sds[column[mine]])
        told = np.sum(own * (prior - covariance)[square] / unit)
        if told > SETTINGS.least_told:
            off = values[mine] / sds[column[mine]]
            factor = np.sqrt(off @ own @ off / told)
            sds[groups == group] *= np.clip(factor, 1 / SETTINGS.widening, SETTINGS.widening)
    # where the model is far off sizes would grow without end
    least, most = (size * columns.usual_sd for size in (SETTINGS.least_size, SETTINGS.most_size))
    return replace(columns, prior_sd=np.clip(sds, least, most))
