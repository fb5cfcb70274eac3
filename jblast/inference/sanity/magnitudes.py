"""Readings that no blast gives where they were taken, whatever its mass."""

from itertools import pairwise

import numpy as np
from jaxtyping import Float

from jblast.inference.sanity.readings import Readings
from jblast.inference.sanity.scaled_laws import LARGEST, SMALLEST, WITH_MASS, ScaledLaws
from jblast.observations import Observations
from jblast.observations.check import Doubt
from jblast.quantities import TIMED
from jblast.waves.fireball import LARGEST_RADIUS

IN_THE_FIREBALL = 1e4
"""Within the fireball of more than this [kg] nobody sets a gauge (declared)."""
RISES = 2.0
"""A radius this much smaller later is no scatter of records (10 to 20 %)."""
SCATTER = 0.17
"""Scatter of one recorded peak about the level of its shot, up to Z = 200 [ln]:
Student-t with 4 degrees of freedom, scale 0.12 (`calibration/far_pressure.py`)."""
BEYOND = 3.0
"""Standard deviations of a difference of two peaks past which it is no scatter."""
FARTHER = 1.3
"""Ranges nearer to each other than this ratio are not compared."""


def magnitudes_doubted(
    readings: Readings, laws: ScaledLaws, distance: Float[np.ndarray, " n"]
) -> list[Doubt]:
    """Return readings that need a charge that there is not, or one they stand in.

    Args:
        readings: The rows of a shot.
        laws: Of a kilogram.
        distance: From the charge of each [m]; NaN where it is not known.
    """
    found, timed = [], readings.timed
    for i, quantity in enumerate(readings.quantity):
        if timed[i] or readings.bound[i]:
            continue
        at, value = float(distance[i]), float(np.exp(readings.value[i]))
        row = (int(readings.row[i]),)
        if not at > 0:  # of an unknown place: what a law gives next to the charge
            if quantity not in WITH_MASS and value > laws.largest(quantity, 1.0):
                numbers = {"value": value, "largest": laws.largest(quantity, 1.0)}
                found.append(Doubt("no_mass_gives_it", row, numbers, (quantity,)))
            continue
        masses = laws.masses(quantity, value, at)
        numbers = {"value": value, "distance_m": at}
        if not masses.size:
            numbers["largest"] = laws.largest(quantity, at)
            found.append(Doubt("no_mass_gives_it", row, numbers, (quantity,)))
            continue
        mass = float(masses.min())
        reach = LARGEST_RADIUS * float(np.cbrt(mass))
        numbers |= {"mass_kg": mass, "fireball_m": reach}
        if mass > LARGEST or masses.max() < SMALLEST:
            found.append(Doubt("mass_of_no_blast", row, numbers, (quantity,)))
        elif reach > at and mass > IN_THE_FIREBALL:
            found.append(Doubt("in_the_fireball", row, numbers, (quantity,)))
    return found


def rising_peaks(readings: Readings, distance: Float[np.ndarray, " n"]) -> list[Doubt]:
    """Return peaks that are larger than one taken nearer to the charge, one a kind.

    A peak falls at least as 1/R, as sound does; a shock falls faster. So what has to be
    explained by scatter is the rise of peak times distance. A reflected reading is 2 to
    8 times an incident one.
    """
    found = []
    for quantity in ("peak_overpressure_pa", "reflected_pressure_pa"):
        kind = np.array([q == quantity for q in readings.quantity], bool)
        here = np.flatnonzero(kind & ~readings.bound & ~np.isnan(distance))
        here = here[np.argsort(distance[here], kind="stable")]
        if not here.size:
            continue
        far, value, error = distance[here], readings.value[here], readings.error[here]
        spread = value + np.log(np.maximum(far, np.finfo(float).tiny))
        least = np.minimum.accumulate(spread)  # of all that are nearer, and its place
        at = np.maximum.accumulate(np.where(spread == least, np.arange(len(here)), 0))
        nearer = np.searchsorted(far, far / FARTHER, side="left") - 1
        low = at[np.maximum(nearer, 0)]
        allowed = BEYOND * np.sqrt(2.0) * SCATTER + np.hypot(error, error[low])
        rises = (value > value[low]) & (spread - spread[low] > allowed)
        rising = np.flatnonzero((nearer >= 0) & rises)
        if rising.size:
            j, i = int(rising[0]), int(low[rising[0]])
            numbers = {
                "value": float(np.exp(value[j])),
                "distance_m": float(far[j]),
                "nearer": float(np.exp(value[i])),
                "nearer_m": float(far[i]),
            }
            rows = int(readings.row[here[j]]), int(readings.row[here[i]])
            found.append(Doubt("peak_rises", rows, numbers, (quantity,)))
    return found


def radii_doubted(observations: Observations) -> list[Doubt]:
    """Return radii of one sensor that shrink while time goes on."""
    found = []
    rows: dict[tuple[str, str, str], list[int]] = {}
    for row, quantity in enumerate(observations.quantity):
        if quantity == "shock_radius_m" and quantity in TIMED:
            key = observations.sensor[row], quantity, observations.shot[row]
            rows.setdefault(key, []).append(row)
    for its in rows.values():
        its.sort(key=lambda row: observations.time[row])
        for early, late in pairwise(its):
            if RISES * observations.value[late] < observations.value[early]:
                numbers = {
                    "value": float(observations.value[late]),
                    "before": float(observations.value[early]),
                }
                found.append(Doubt("radius_shrinks", (late, early), numbers))
                break
    return found
