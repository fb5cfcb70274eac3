"""The default scene as a log of the Earth needs it: free in what that cannot fix."""

from dataclasses import replace

import numpy as np

from jblast.observations.table import CLOCK_TIMES, Observations
from jblast.observations.times.clocks import clocks_apart
from jblast.parameter_table import ALTITUDES, CLOCK_OFFSET
from jblast.scene import UncertainScene, freed, with_values
from jblast.scene.uncertain import NO_SCENE
from jblast.waves.propagation.atmosphere import standard_atmosphere

PLACE = ("charge_east_m", "charge_north_m")
APART = 5.0
"""Flashes so many standard deviations apart were read off clocks that disagree."""


def for_log(uncertain: UncertainScene, observations: Observations) -> UncertainScene:
    """Free in the default scene what a log in degrees, or with dates, cannot fix.

    A charge at the origin means nothing where the origin is the middle of the sensors,
    nor does time zero where that is the second of the first reading. The place is free
    then, the origin time, and clocks that the log tells apart (`clocks_to_free`); the
    air is the standard atmosphere's at the height of the sensors.

    Args:
        uncertain: What was given; only the default scene is changed.
        observations: The log.
    """
    on_earth = observations.frame is not None
    if uncertain.source != NO_SCENE or not (on_earth or observations.epoch):
        return uncertain
    names = []
    ranged = not np.isnan(observations.slant_range).all()
    if on_earth and not ranged and "charge_range_m" not in uncertain.beliefs:
        names += PLACE
    if set(CLOCK_TIMES) & set(observations.quantity):
        names.append("origin_time_s")
    names += [f"{CLOCK_OFFSET}.{name}" for name in clocks_to_free(observations)]
    uncertain = freed(uncertain, [n for n in names if n not in uncertain.beliefs])
    frame = observations.frame
    if frame is None or not frame.alt_m or not ALTITUDES.allows(frame.alt_m):
        return uncertain
    temperature, pressure = standard_atmosphere(frame.alt_m)
    air = {"air_temperature_k": temperature, "air_pressure_pa": pressure}
    known = {
        name: value for name, value in air.items() if name not in uncertain.beliefs
    }
    return replace(uncertain, scene=with_values(uncertain.scene, known))


def clocks_to_free(observations: Observations) -> list[str]:
    """Return the clocks whose offsets a log tells, and that are not said to agree.

    A clock that read a flash and a bang is set by their difference. Recorders that the
    column `clock` names apart are taken to be apart; without that column, sensors share
    the time unless they read the flash at different times.

    Args:
        observations: The log. The clock of its first row is the common one, or that of
            the rows whose `clock` is empty beside others.
    """
    timed = np.isin(observations.quantity, CLOCK_TIMES)
    read: dict[str, set[str]] = {}
    for row in np.flatnonzero(timed):
        clock = observations.clocks()[row]
        read.setdefault(clock, set()).add(observations.quantity[row])
    tied = [clock for clock, quantities in read.items() if len(quantities) > 1]
    if not any(observations.clock):
        return tied[1:] if _flashes_disagree(observations) else []
    apart = clocks_apart(observations)
    return [clock for clock in tied if clock in apart]


def _flashes_disagree(observations: Observations) -> bool:
    """Return whether sensors saw the flash at different times: light takes none."""
    rows = np.isin(observations.quantity, "flash_time_s")
    if rows.sum() < 2:
        return False
    value, sigma = observations.value[rows], np.nan_to_num(observations.sigma[rows])
    first, last = np.argmin(value), np.argmax(value)
    return bool(
        value[last] - value[first] > APART * np.hypot(sigma[first], sigma[last])
    )
