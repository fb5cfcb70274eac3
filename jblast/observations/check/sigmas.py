"""Doubts about errors: finer than any instrument, or larger than what was read."""

import numpy as np

from jblast.observations.check.doubt import Doubt
from jblast.observations.table import Observations
from jblast.quantities import ADDITIVE

FINEST = 1e-6
"""A relative sigma below this is none: it is of the primary standards of pressure
(piston gauges state some 1e-6, as in the key comparisons of the BIPM)."""


def sigmas_doubted(observations: Observations) -> list[Doubt]:
    """Return rows whose sigma cannot be what was meant."""
    value, sigma = observations.value, observations.sigma
    in_ln = ~np.isin(observations.quantity, ADDITIVE)
    stated = in_ln & ~np.isnan(sigma) & (value > 0)
    share = np.full(len(value), np.nan)
    share[stated] = sigma[stated] / value[stated]
    found = []
    for kind, odd in (("sigma_too_fine", share < FINEST), ("sigma_large", share > 1)):
        for row in np.flatnonzero(odd):
            found.append(Doubt(kind, (int(row),), {"share": float(share[row])}))
    return found
