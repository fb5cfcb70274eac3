"""What the solver's decay of a point source is held against: a table, and a law."""

import math
from pathlib import Path

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from jblast.waves.curves import log_sound_fraction
from jblast.waves.euler import Decay
from jblast.waves.laws.point_source import log_overpressure_ratio, point_source_arrival

END = 100.0
r"""$\lambda$ to which the solver runs."""


def hancock(first: float, last: float) -> np.ndarray:
    r"""Return ln lambda, ln p/P0 and ln(lambda - c0 t) of every row of table S1x4.

    Args:
        first: $\lambda$ where they begin [-].
        last: Where they end [-].
    """
    file = Path(__file__).parent / "data" / "point_source_s1x4.csv"
    lines = [line for line in file.read_text().splitlines() if line[:1] != "#"]
    rows = np.genfromtxt(lines, delimiter=",", names=True)
    x = rows["log_lambda"]
    rows = rows[(x >= math.log(first)) & (x <= math.log(last))]
    names = ("log_lambda", "log_overpressure_ratio", "log_lead")
    return np.array([rows[name] for name in names])


def sound_fraction(log_scaled: Array) -> np.ndarray:
    """Return c t / R of the law."""
    return np.exp(np.asarray(log_sound_fraction(log_scaled, point_source_arrival())))


def law_over(limit: Decay) -> tuple[np.ndarray, np.ndarray]:
    """Return how far `point_source` is above the solver: pressure and arrival, of 1."""
    log_scaled = jnp.log(limit.scaled)
    pressure = np.exp(np.asarray(log_overpressure_ratio(log_scaled)))
    arrival = sound_fraction(log_scaled) * limit.scaled
    return pressure / limit.overpressure_ratio - 1.0, arrival / limit.arrival - 1.0
