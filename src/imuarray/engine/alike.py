"""Parameters whose size an estimate finds: what triads of one kind have in common, and drifts."""

from dataclasses import replace

import numpy as np

from imuarray.engine.fit import Fit, flat_parameters, prior_means, scaled_solve
from imuarray.engine.parameters import Columns, prior_precision
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
    prior = scaled_inverse(prior_precision(columns, active))
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


def likely_sizes(fit: Fit, equations=None) -> Columns:
    """The columns of a fit, its sized effects as large as is likeliest, all else quadratic.

    ``equations``: information and score of its active parameters, if they are known.
    """
    columns, active = fit.columns, fit.active
    if not np.any(sized_groups(columns)[active.any(axis=0)] != ""):
        return columns
    every = np.arange(active.sum())
    values, means = flat_parameters(columns, fit.state)[active], prior_means(fit.readings, columns)
    inner, score = equations or fit.normal(active)
    right = score + inner @ values
    for _ in range(SETTINGS.iterations):
        precision, last = prior_precision(columns, active), columns.prior_sd
        values, _ = scaled_solve(inner + precision, right + precision @ means[active])
        columns = with_likely_spread(columns, active, values, inner + precision, every)
        if np.allclose(columns.prior_sd, last, rtol=SETTINGS.same_noise):
            break
    return columns
