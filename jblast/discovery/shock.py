r"""Deceleration of a shock front, from its radius at recorded times.

The search target is $dR/dt$ among powers of $R$. A strong shock of a point source has
$$dR/dt = \tfrac{2}{5} \sqrt{E / (\alpha \rho_0)}\; R^{-3/2}$$
(Sedov 1959, chapter 4), one that has decayed to sound a constant.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float
from scipy.optimize import minimize_scalar

from jblast.discovery.discover import (
    MEMBERS,
    THRESHOLD,
    Discovery,
    basic_interval,
    discover_in,
)
from jblast.discovery.record import Record, Sides, shock_record
from jblast.discovery.sparse_regression import grown_terms, powers

EXPONENTS = (0.0, -0.5, -1.0, -1.5, -2.0, -2.5, -3.0)
"""Powers of R among the candidates; the first is a constant speed."""
STEEPEST, FLATTEST = -6.0, 1.0
"""Bounds of the single exponent, wide about -1.5 (strong shock) and 0 (sound)."""


@dataclass(frozen=True)
class Slowing:
    """Equation of dR/dt of a radius history.

    Attributes:
        discovery: Equation as a sum of powers of R [m, s].
        exponent: Exponent of the best single power, dR/dt = a R^n, a real number.
        low: Lower bound of its interval, with the nominal level of the discovery.
        high: Upper bound.
        misfit: Root mean square residual of the single power relative to dR/dt, noise
            included.
    """

    discovery: Discovery
    exponent: float
    low: float
    high: float
    misfit: float


def shock_slowing(
    time_s: Float[np.ndarray, " row"],
    radius_m: Float[np.ndarray, " row"],
    *,
    threshold: float = THRESHOLD,
    members: int = MEMBERS,
    seed: int = 0,
) -> Slowing:
    """Return the equation of dR/dt of a shock.

    Args:
        time_s: Times since the detonation, positive, increasing [s].
        radius_m: Radii of the front, positive [m].
        threshold: Smallest share of dR/dt that a term must contribute.
        members: Number of members of the ensemble.
        seed: Seed of the ensemble.
    """
    record = shock_record(time_s, radius_m)
    discovery = discover_in(
        record,
        powers("R", EXPONENTS),
        ("R",),
        select=grown_terms,
        threshold=threshold,
        members=members,
        seed=seed,
    )
    rng = np.random.default_rng(seed)
    exponent, misfit = _one_power(record, record.sides)
    # the exponent of the states that the noisy records are made from
    middle, _ = _one_power(record, record.sides_of(record.smooth))
    found = [
        _one_power(record, record.sides_of(record.with_noise(record.smooth, rng)))[0]
        for _ in range(members)
    ]
    low, high = basic_interval(np.array(exponent), np.array(found) - middle)
    return Slowing(discovery, exponent, float(low), float(high), misfit)


def _one_power(record: Record, sides: Sides) -> tuple[float, float]:
    """Return the exponent with the smallest relative residual, and this residual."""
    left = sides.left[:, 0]
    # relative to the first radius: high powers of metres would overflow, and the factor
    # of the power absorbs the unit
    log_radius = np.log(sides.columns[:, 0] / record.smooth[0, 0])

    def residual(exponent: float) -> float:
        term = record.windows.integral @ (record.rate * np.exp(exponent * log_radius))
        factor = np.dot(term, left) / np.dot(term, term)
        return float(np.sqrt(np.mean((left - factor * term) ** 2)))

    best = minimize_scalar(residual, bounds=(STEEPEST, FLATTEST), method="bounded")
    return float(best.x), float(best.fun)
