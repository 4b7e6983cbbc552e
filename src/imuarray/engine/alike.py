"""Parameters that triads of one kind have nearly in common: how much each differs, estimated."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from imuarray.engine.parameters import Columns, prior_precision
from imuarray.engine.settings import SETTINGS
from imuarray.linear import scaled_inverse


def with_likely_spread(columns: Columns, active, values, information, place) -> Columns:
    """The columns, own prior sds as large as differences between triads are likeliest (MacKay).

    ``values`` (n,) and ``information`` (n, n), the prior's with it, of all parameters; ``place``:
    where those ``active`` (N, m) bool are among them.
    """
    sds, column, names = columns.prior_sd.copy(), np.nonzero(active)[1], np.array(columns.names)
    alike = np.unique(names[column][columns.common_sd[column] > 0])
    if len(alike) == 0:
        return columns
    prior = scaled_inverse(prior_precision(columns, active))
    covariance, values = scaled_inverse(information)[np.ix_(place, place)], values[place]
    for name in alike:
        mine = np.flatnonzero(names[column] == name)
        same = column[mine][:, None] == column[mine]
        own = np.eye(len(mine)) - same / same.sum(axis=1)
        square = np.ix_(mine, mine)
        unit = np.outer(sds[column[mine]], sds[column[mine]])
        told = np.sum(own * (prior - covariance)[square] / unit)
        if told > SETTINGS.least_told:
            off = values[mine] / sds[column[mine]]
            factor = np.sqrt(off @ own @ off / told)
            sds[names == name] *= np.clip(factor, 1 / SETTINGS.widening, SETTINGS.widening)
    return replace(columns, prior_sd=sds)
