"""The shock solver as a method beside the laws: one run answers for every distance.

Energy of 4.184 MJ/kg at a point. On the surface the ground is taken for a perfect
mirror: the source of twice the charge in free air.
"""

import math
from functools import cache
from typing import TYPE_CHECKING

import numpy as np
from jaxtyping import Array, Bool, Float

from jblast.fidelity.timing import seconds
from jblast.waves.laws.point_source import LENGTH

if TYPE_CHECKING:  # a choice knows what a run costs, and needs none
    from jblast.waves.euler import Decay

METHOD = "euler"
CELLS = 100
"""Enough for 0.1 % (`calibration/results/point_source.txt`)."""

SOLVED = ("air_arrival_s", "peak_overpressure_pa", "shock_speed_m_s")
"""Quantities that it gives."""

LAMBDAS = (0.1, 100.0)
"""Scaled distances R (P0/E)^(1/3) that a run covers."""


def length(burst: str) -> float:
    """Return the scaled distance Z of lambda = 1 [m/kg^(1/3)]."""
    return LENGTH * (2.0 ** (1.0 / 3.0) if burst == "surface" else 1.0)


NODES = np.geomspace(*LAMBDAS, 200)


@cache
def decay(cells: int = CELLS) -> "Decay":
    """Return the decay of the front by a run, at `NODES`."""
    from jblast.waves.euler import decay_at, point_source_march

    return decay_at(NODES, point_source_march(cells, LAMBDAS[1]))


def seconds_of_run(cells: int = CELLS) -> float:
    """Return what a run costs, compiled before [s]."""
    from jblast.waves.euler import point_source_march

    return seconds(lambda: point_source_march(cells, LAMBDAS[1]).history, 1)


def scaled_value(
    quantity: str, z: Float[np.ndarray, " place"], burst: str
) -> Float[np.ndarray, " place"]:
    r"""Return a quantity of 1 kg in standard air: $c_0 t/R$, $p/P_0$ or $U/c_0$.

    Args:
        quantity: One of `SOLVED`.
        z: Scaled distances [m/kg^(1/3)].
        burst: "surface" or "free-air".

    Returns:
        Its logarithm is interpolated; NaN outside the run.
    """
    run = decay()
    lambdas = z / length(burst)
    given = {
        "air_arrival_s": run.arrival / run.scaled,
        "peak_overpressure_pa": run.overpressure_ratio,
        "shock_speed_m_s": np.sqrt(1.0 + 6.0 / 7.0 * run.overpressure_ratio),
    }[quantity]
    value = np.exp(np.interp(np.log(lambdas), np.log(run.scaled), np.log(given)))
    return np.where(holds(z, burst), value, math.nan)


def holds(
    z: Float[Array | np.ndarray, " place"], burst: str
) -> Bool[Array | np.ndarray, " place"]:
    """Return which scaled distances lie within the run."""
    lambdas = z / length(burst)
    return (lambdas >= LAMBDAS[0]) & (lambdas <= LAMBDAS[1])
