"""Logs of six stations around a charge, with the least cost that each can have.

The unknowns are ln Q, east, north and origin time; Wu and Hao's air and ground arrivals
at six stations 40 to 160 m from the charge, each with 0.1 ms of normal error; float64.
Masses are log-uniform from 5 to 200 kg, places uniform in a disc of 20 m, seed 0.
The laws are written here anew, so that nothing of the fit is trusted to judge it.
"""

import dataclasses
import importlib.util
import math
import time
from typing import Any, NamedTuple

import jax.numpy as jnp
import numpy as np

from jblast.scene import Scene, Sensor, UncertainScene, freed, with_values
from jblast.sensors import Layout

SIGMA = 1e-4
DISTANCES = (60.0, 140.0, 80.0, 120.0, 70.0, 130.0)
LAWS = {"air_arrival_s": "wu_hao", "ground_arrival_s": "wu_hao"}
FREE = ["charge_mass_kg", "charge_east_m", "charge_north_m", "origin_time_s"]
SOUND, ROCK = 340.0, 5660.0


class Problem(NamedTuple):
    """Logs whose truth is known.

    Attributes:
        stations: East and north of each.
        truth: ln mass, east, north, origin time of each log.
        readings: Air arrivals at all stations, then ground arrivals.
    """

    stations: np.ndarray
    truth: np.ndarray
    readings: np.ndarray


def draw(count: int) -> Problem:
    """Draw logs."""
    rng = np.random.default_rng(0)
    angle = np.arange(6) * math.pi / 3
    stations = np.array(DISTANCES)[:, None] * np.column_stack(
        [np.cos(angle), np.sin(angle)]
    )
    distance, way = 20 * np.sqrt(rng.random(count)), 2 * math.pi * rng.random(count)
    truth = np.column_stack(
        [
            rng.uniform(math.log(5), math.log(200), count),
            distance * np.cos(way),
            distance * np.sin(way),
            rng.uniform(-1, 1, count),
        ]
    )
    exact, _ = predict(stations, truth)
    return Problem(stations, truth, exact + SIGMA * rng.standard_normal(exact.shape))


def predict(stations: np.ndarray, z: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return readings, and their slopes to each unknown, in plain NumPy."""
    apart = z[..., None, 1:3] - stations
    r = np.sqrt((apart**2).sum(-1))
    ln_q = z[..., :1]
    air = 34 * z.dtype.type(1) / 100 * r ** (z.dtype.type(14) / 10)
    air = air * np.exp(-ln_q / 5) / SOUND
    ground = 91 * z.dtype.type(1) / 100 * r ** (z.dtype.type(103) / 100)
    ground = ground * np.exp(-ln_q / 50) / ROCK
    along = np.moveaxis(apart / r[..., None] ** 2, -1, 0)
    slopes = [
        np.stack([-power * t, b * t * along[0], b * t * along[1], np.ones_like(t)], -1)
        for t, power, b in (
            (air, z.dtype.type(1) / 5, z.dtype.type(14) / 10),
            (ground, z.dtype.type(1) / 50, z.dtype.type(103) / 100),
        )
    ]
    times = np.concatenate([air, ground], axis=-1) + z[..., 3:]
    return times, np.concatenate(slopes, axis=-2)


def cost_of(problem: Problem, z: np.ndarray) -> np.ndarray:
    """Return the cost in long double."""
    times, _ = predict(problem.stations.astype(np.longdouble), z.astype(np.longdouble))
    return 0.5 * (((problem.readings - times) / SIGMA) ** 2).sum(-1)


def least_known(problem: Problem) -> np.ndarray:
    """Return the cost that Gauss-Newton steps from the truth lead to."""
    z = problem.truth.astype(np.longdouble)
    for _ in range(20):
        times, slopes = predict(problem.stations.astype(np.longdouble), z)
        gradient = np.einsum("nik,ni->nk", slopes, problem.readings - times)
        j = slopes.astype(float)
        size = np.sqrt((j**2).sum(1))
        j = j / size[:, None, :]
        step = np.linalg.solve(
            np.einsum("nik,nil->nkl", j, j), (gradient / size).astype(float)[..., None]
        )
        z = z + step[..., 0] / size
    return cost_of(problem, z)


def scene_of(problem: Problem) -> UncertainScene:
    """Return the scene as a user would write it."""
    records = tuple((quantity, SIGMA) for quantity in LAWS)
    sensors = tuple(
        Sensor(f"s{i}", jnp.array([*place, 0.0]), records=records)
        for i, place in enumerate(problem.stations)
    )
    scene = dataclasses.replace(Scene(), scatter=False, sensors=sensors)
    fixed = {"air_sound_speed_m_s": SOUND, "ground_p_speed_m_s": ROCK}
    return freed(UncertainScene(with_values(scene, fixed)), FREE)


def columns_of(layout: Layout) -> list[int]:
    """Return which column of `readings` each row of the scene's layout is."""
    return [
        6 * (q == "ground_arrival_s") + int(s[1:])
        for q, s in zip(layout.quantity, layout.clock, strict=True)
    ]


def scipy_ends(problem: Problem, starts: np.ndarray) -> tuple[float, np.ndarray] | None:
    """Return scipy's fits a second, and where they end; nothing without scipy."""
    if importlib.util.find_spec("scipy") is None:
        return None
    from scipy.optimize import least_squares

    ends = []
    begin = time.perf_counter()
    for readings, start in zip(problem.readings, starts, strict=True):
        slopes: Any = lambda z: -predict(problem.stations, z)[1] / SIGMA  # noqa: E731
        found = least_squares(
            lambda z, r=readings: (r - predict(problem.stations, z)[0]) / SIGMA,
            start,
            jac=slopes,
            method="lm",
            x_scale="jac",
        )
        ends.append(found.x)
    return len(ends) / (time.perf_counter() - begin), np.array(ends)
