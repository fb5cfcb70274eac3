"""Flights against those of RotorPy 3.0.0, stored in calibration/data."""

import csv
import dataclasses
from pathlib import Path

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from calibration.rotorpy_flights import DURATION, EVERY, FLIGHTS, HELD, HOVER, commands
from jblast.vehicle import (
    Each,
    FriedlanderGust,
    NWaveGust,
    State,
    StepGust,
    named,
    simulate,
)

TABLE = Path(__file__).parents[2] / "calibration/data/rotorpy_flights.csv"


class Gusts(eqx.Module):
    """A wind of every kind, of which a flight meets one: the others are still air."""

    parts: tuple[StepGust, NWaveGust, FriedlanderGust]

    def __call__(self, time_s, position_m):
        return sum(part(time_s, position_m) for part in self.parts)


def in_gusts(gust) -> Gusts:
    """One of the table's gusts."""

    def velocity(kind):
        return np.array(gust.velocity) * (gust.kind == kind)

    begin, last = gust.start, gust.duration
    return Gusts(
        (
            StepGust(velocity("step"), begin),
            NWaveGust(velocity("n-wave"), begin, last),
            FriedlanderGust(velocity("friedlander"), begin, last),
        )
    )


def stacked(trees):
    return jax.tree.map(lambda *leaves: jnp.stack(leaves), *trees)


def flown(dtype="float64", step=5e-4):
    """Fly all of the table, a row for each vehicle and a column for each flight."""
    starts, asked, gusts, vehicles = [], [], [], []
    for name, hover in HOVER.items():
        vehicle = dataclasses.replace(named(name), name="")  # or they do not stack
        for start, gust in FLIGHTS.values():
            parts = [np.array(part, dtype) for part in (*start.values(), [hover] * 4)]
            starts.append(State(*parts))
            asked.append(commands(hover))
            gusts.append(in_gusts(gust))
            vehicles.append(vehicle)
    return simulate(
        stacked(vehicles),
        stacked(starts),
        duration_s=DURATION,
        step_s=step,
        commands=np.stack(asked),
        command_step_s=HELD,
        wind=Each(stacked(gusts)),
        store_every=round(EVERY / step),
    )


def table():
    """Positions [m] and quaternions of the stored flights, in the same order."""
    with TABLE.open(encoding="utf-8") as file:
        rows = list(csv.reader(line for line in file if not line.startswith("#")))[1:]
    order = [(name, flight) for name in HOVER for flight in FLIGHTS]
    assert list(dict.fromkeys((row[0], row[1]) for row in rows)) == order
    numbers = np.array([row[2:] for row in rows], float)
    numbers = numbers.reshape(len(order), -1, numbers.shape[1])
    np.testing.assert_allclose(numbers[0, :, 0], np.arange(0, 2.6, EVERY))
    return numbers[..., 1:4], numbers[..., 4:]


def farthest(found, expected):
    """Greatest distance of every flight."""
    return np.linalg.norm(np.asarray(found) - expected, axis=-1).max(axis=1)


SHORT = pytest.param(2.5e-4, marks=pytest.mark.slow)


@pytest.mark.parametrize("step", [5e-4, SHORT])
def test_flights_are_those_of_rotorpy(step):
    found, (places, turns) = flown(step=step), table()
    assert found.position_m.dtype == np.float64
    assert (np.ptp(places, axis=1).max(axis=1) > 1).all()  # they go somewhere
    off = farthest(found.position_m, places)
    assert (off < 1e-5).all(), off
    off = farthest(found.quaternion, turns)
    assert (off < 1e-5).all(), off
