"""The kernel of Warp against the stored flights of RotorPy, in both precisions."""

import csv
import dataclasses
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from calibration.rotorpy_flights import DURATION, EVERY, FLIGHTS, HELD, HOVER, commands
from jblast.vehicle import FriedlanderGust, NWaveGust, State, StepGust, named, simulate

TABLE = Path(__file__).parents[3] / "calibration/data/rotorpy_flights.csv"
GUSTS = {
    "calm": lambda gust: None,
    "step": lambda gust: StepGust(gust.velocity, gust.start),
    "n-wave": lambda gust: NWaveGust(gust.velocity, gust.start, gust.duration),
    "friedlander": lambda gust: FriedlanderGust(
        gust.velocity, gust.start, gust.duration
    ),
}


def stacked(trees):
    return jax.tree.map(lambda *leaves: jnp.stack(leaves), *trees)


def stored(flight):
    """Places of a flight of both vehicles [m]."""
    with TABLE.open(encoding="utf-8") as file:
        rows = csv.DictReader(line for line in file if not line.startswith("#"))
        places = [
            [float(row[name]) for name in ("east_m", "north_m", "up_m")]
            for row in rows
            if row["flight"] == flight
        ]
    return np.array(places).reshape(len(HOVER), -1, 3)


def farthest(flight, dtype, step):
    """Greatest distance from the stored places [m]."""
    start, gust = FLIGHTS[flight]
    starts = [
        State(*(np.array(x, dtype) for x in (*start.values(), [hover] * 4)))
        for hover in HOVER.values()
    ]
    flown = simulate(
        stacked([dataclasses.replace(named(name), name="") for name in HOVER]),
        stacked(starts),
        duration_s=DURATION,
        step_s=step,
        commands=np.stack([commands(hover) for hover in HOVER.values()]),
        command_step_s=HELD,
        wind=GUSTS[gust.kind](gust),
        store_every=round(EVERY / step),
        backend="warp:cpu",
    )
    assert flown.position_m.dtype == dtype
    return np.linalg.norm(np.asarray(flown.position_m) - stored(flight), axis=-1).max()


@pytest.mark.parametrize("flight", FLIGHTS)
def test_flights_are_those_of_rotorpy(flight):
    assert farthest(flight, "float64", 5e-4) < 1e-5


@pytest.mark.slow
@pytest.mark.parametrize("step", [5e-4, 2.5e-4, 1e-4])
@pytest.mark.parametrize("flight", FLIGHTS)
def test_short_steps_do_not_round_away_in_single_precision(flight, step):
    assert farthest(flight, "float32", step) < 1e-3
