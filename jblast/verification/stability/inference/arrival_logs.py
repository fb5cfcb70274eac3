"""The logs on which failures of fits and of walks are measured.

A surface charge and eight sensors, which record one arrival each, to 0.1 ms; mass and
place are unknown. All logs have the same rows, so what is compiled for one serves all.
"""

import functools
from collections.abc import Mapping
from dataclasses import replace
from typing import NamedTuple

import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from jblast.inference import Solution, solve
from jblast.observations import Observations
from jblast.scene import Scene, Sensor, UncertainScene, freed, with_laws, with_values
from jblast.sensors import simulate
from jblast.sensors.simulate import Noise

SENSORS = 8
FITS = 400
"""Fits in one call, always as many, so that one program serves them all."""
SIGMA = 1e-4
"""Error of an arrival [s]."""
LAWS = {"air_arrival_s": "shock_kinematics"}
START = {"charge_mass_kg": 1.0, "charge_east_m": 0.0, "charge_north_m": 0.0}
"""What is unknown, and what the search is told of it."""
SEED = 1

Places = tuple[tuple[float, float], ...]
"""East and north of each sensor [m]."""


class SolvedLog(NamedTuple):
    """A log, and what jblast makes of it.

    Attributes:
        log: The arrivals.
        uncertain: What was known before.
        solution: What `solve` found.
    """

    log: Observations
    uncertain: UncertainScene
    solution: Solution


def circle(radius: float | Float[np.ndarray, " sensor"]) -> Places:
    """Place sensors about the origin, a radius for all or one for each [m]."""
    angle = np.arange(SENSORS) * 2 * np.pi / SENSORS
    east, north = radius * np.cos(angle), radius * np.sin(angle)
    return tuple(zip(east.tolist(), north.tolist(), strict=True))


def ring() -> Places:
    """Place sensors on all sides, 60 to 140 m from the origin."""
    return circle(np.array([60.0, 140.0, 80.0, 120.0, 70.0, 130.0, 90.0, 110.0]))


def line(bent: float = 0.0) -> Places:
    """Place sensors 30 m apart from west to east, the last so far off the line [m]."""
    east = (-60.0 + 30.0 * np.arange(SENSORS)).tolist()
    return (*((x, 0.0) for x in east[:-1]), (east[-1], bent))


def scene_with(
    places: Places,
    values: Mapping[str, float],
    laws: Mapping[str, str],
    sigma: float = SIGMA,
) -> UncertainScene:
    """Return a scene of sensors on the ground that record what there are laws for."""
    sensors = tuple(
        Sensor(
            f"s{i}",
            jnp.array([*place, 0.0]),
            records=tuple((quantity, sigma) for quantity in laws),
        )
        for i, place in enumerate(places)
    )
    empty = replace(Scene(), scatter=False, sensors=sensors)
    return with_laws(UncertainScene(with_values(empty, values)), laws)


@functools.cache
def solved_log(
    places: Places,
    mass: float,
    east: float,
    north: float,
    noise: Noise = "gaussian",
) -> SolvedLog:
    """Simulate a log with normal errors, and solve it.

    Args:
        places: Of the sensors.
        mass: Of the charge [kg].
        east: Of the charge [m].
        north: Of the charge [m].
        noise: What `solve` takes the errors to be.
    """
    truth = dict(zip(START, (mass, east, north), strict=True))
    log = simulate(scene_with(places, truth, LAWS), SEED, noise="gaussian")
    asked = freed(scene_with(places, START, LAWS), list(START))
    return SolvedLog(log, asked, solve(log, asked, noise=noise))
