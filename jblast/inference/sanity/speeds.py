r"""Arrivals that no wave in air explains: too slow between two places, or too fast.

The front runs at the speed of sound or faster. So a wave from anywhere comes to two
places no more than $d / (c - w)$ apart in time, $d$ their distance, $c$ the speed of
sound in the coldest air and $w$ a wind against it; from a known charge it takes no
longer than that, and no less than a law gives next to the charge.
"""

import numpy as np
from jaxtyping import Float

from jblast.constants import AIR_HEAT_CAPACITY_RATIO, DRY_AIR_GAS_CONSTANT
from jblast.inference.sanity.readings import CLOCK_STEP, FAR, Readings
from jblast.inference.sanity.scaled_laws import ScaledLaws
from jblast.observations.check import Doubt

COLDEST = 222.15
"""Severe cold [K]: -51 C, climatic category C3 of MIL-STD-810."""
GALE = 20.7
"""Wind in which nobody measures blasts [m/s]: the upper end of Beaufort 8 (WMO)."""
SLOWEST = float(
    np.sqrt(AIR_HEAT_CAPACITY_RATIO * DRY_AIR_GAS_CONSTANT * COLDEST) - GALE
)
"""Of a wave in air near the ground [m/s]: 278."""
SLOWEST_FAR = 180.0
"""Past `FAR`, through the thermosphere [m/s]: the least celerity of infrasound
(Negraru et al., J. Geophys. Res. 115, D15110, 2010; read second-hand)."""
MOST = 1000
"""Arrivals that are compared, each with each."""


def slow_between(readings: Readings) -> list[Doubt]:
    """Return arrivals that are too far apart in time for their places.

    Of those that contradict most others, one after another.
    """
    air = np.array([q == "air_arrival_s" for q in readings.quantity], bool)
    here = np.flatnonzero(air & ~np.isnan(readings.position).any(axis=1))[:MOST]
    if len(here) < 2:
        return []
    place, time = readings.position[here], readings.value[here]
    apart = np.linalg.norm(place[:, None] - place[None], axis=-1)
    late = np.abs(time[:, None] - time[None])
    error = np.hypot(readings.error[here][:, None], readings.error[here][None])
    slowest = np.where(apart > FAR, SLOWEST_FAR, SLOWEST)
    bad = late > apart / slowest + error + CLOCK_STEP
    bad &= readings.clock[here][:, None] == readings.clock[here][None]
    found = []
    while bad.any():
        worst = int(np.argmax(bad.sum(axis=1)))
        # of two that contradict each other alone, the later is named first
        partners = np.flatnonzero(bad[worst])
        other = int(partners[np.argmax(late[worst, partners])])
        rows = int(readings.row[here[worst]]), int(readings.row[here[other]])
        numbers = {
            "late_s": float(late[worst, other]),
            "apart_m": float(apart[worst, other]),
            "slowest_m_s": float(slowest[worst, other]),
        }
        found.append(Doubt("too_slow_between", rows, numbers))
        bad[worst] = bad[:, worst] = False
    return found


def speeds_doubted(
    readings: Readings,
    laws: ScaledLaws,
    distance: Float[np.ndarray, " n"],
    origin: float | None,
) -> list[Doubt]:
    """Return arrivals that are too late or too early for their distances.

    Args:
        readings: The rows of a shot.
        laws: Of a kilogram.
        distance: From the charge of each [m].
        origin: Time of the shot on the common clock [s], where no flash tells it; None:
            not known.
    """
    seen = {
        int(readings.clock[i]): float(readings.value[i])
        for i, quantity in enumerate(readings.quantity)
        if quantity == "flash_time_s"
    }
    start = seen if origin is None else {0: origin} | seen
    fastest = laws.fastest()
    found: list[Doubt] = []
    for i, quantity in enumerate(readings.quantity):
        begun = start.get(int(readings.clock[i]))
        if quantity != "air_arrival_s" or begun is None or not distance[i] > 0:
            continue
        if seen.get(int(readings.clock[i]), -np.inf) > readings.value[i]:
            continue  # before the flash: that is said already
        took, error = readings.value[i] - begun, readings.error[i] + CLOCK_STEP
        slowest = SLOWEST_FAR if distance[i] > FAR else SLOWEST
        kind = ""
        if took - error > distance[i] / slowest:
            kind = "too_slow"
        elif took + error < distance[i] / fastest:
            kind = "too_fast"
        if kind:
            numbers = {
                "took_s": float(took),
                "distance_m": float(distance[i]),
                "slowest_m_s": slowest,
                "fastest_m_s": fastest,
            }
            found.append(Doubt(kind, (int(readings.row[i]),), numbers))
    return found
