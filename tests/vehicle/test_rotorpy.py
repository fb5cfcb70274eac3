"""Flights against those of RotorPy 3.0.0, stored in calibration/data: JAX and Warp."""

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
    Commands,
    Gust,
    State,
    friedlander,
    n_wave,
    named,
    simulate,
)

TABLE = Path(__file__).parents[2] / "calibration/data/rotorpy_flights.csv"
GUSTS = {
    "calm": lambda gust: None,
    "step": lambda gust: Gust(gust.velocity, gust.start),
    "n-wave": lambda gust: Gust(gust.velocity, gust.start, gust.duration, n_wave),
    "friedlander": lambda gust: Gust(
        gust.velocity, gust.start, gust.duration, friedlander
    ),
}


class Gusts(eqx.Module):
    """A wind of every kind, of which a flight meets one: the others are still air."""

    parts: tuple[Gust, Gust, Gust]

    def __call__(self, time_s, position_m):
        return sum(part(time_s, position_m) for part in self.parts)


def in_gusts(gust) -> Gusts:
    """One of the table's gusts."""

    def part(kind):
        own = gust._replace(velocity=np.array(gust.velocity) * (gust.kind == kind))
        return GUSTS[kind](own)

    return Gusts((part("step"), part("n-wave"), part("friedlander")))


def stacked(trees):
    return jax.tree.map(lambda *leaves: jnp.stack(leaves), *trees)


def stored():
    """Positions [m] and quaternions by vehicle, flight and row."""
    with TABLE.open(encoding="utf-8") as file:
        rows = list(csv.reader(line for line in file if not line.startswith("#")))[1:]
    order = [(name, flight) for name in HOVER for flight in FLIGHTS]
    assert list(dict.fromkeys((row[0], row[1]) for row in rows)) == order
    numbers = np.array([row[2:] for row in rows], float)
    numbers = numbers.reshape(len(HOVER), len(FLIGHTS), -1, numbers.shape[1])
    np.testing.assert_allclose(numbers[0, 0, :, 0], np.arange(0, 2.6, EVERY))
    return numbers[..., 1:4], numbers[..., 4:]


def flown(flights, wind, dtype="float64", step=5e-4, **options):
    """Fly each vehicle through each of some flights, one after another."""
    starts, asked, vehicles = [], [], []
    for name, hover in HOVER.items():
        vehicle = dataclasses.replace(named(name), name="")  # or they do not stack
        for flight in flights:
            parts = (*FLIGHTS[flight][0].values(), [hover] * 4)
            starts.append(State(*(np.array(part, dtype) for part in parts)))
            asked.append(commands(hover))
            vehicles.append(vehicle)
    found = simulate(
        stacked(vehicles),
        stacked(starts),
        duration_s=DURATION,
        step_s=step,
        control=Commands(np.stack(asked), np.full(len(asked), HELD)),
        wind=wind,
        store_every=round(EVERY / step),
        **options,
    )
    assert found.position_m.dtype == dtype
    return found


def farthest(flight, dtype, step):
    """Greatest distance of the kernel from the stored places [m]."""
    gust = FLIGHTS[flight][1]
    found = flown([flight], GUSTS[gust.kind](gust), dtype, step, backend="warp:cpu")
    expected = stored()[0][:, list(FLIGHTS).index(flight)]
    return np.linalg.norm(np.asarray(found.position_m) - expected, axis=-1).max()


@pytest.mark.parametrize("flight", FLIGHTS)
def test_flights_are_those_of_rotorpy(flight):
    assert farthest(flight, "float64", 5e-4) < 1e-5


@pytest.mark.slow
@pytest.mark.parametrize("step", [5e-4, 2.5e-4, 1e-4])
@pytest.mark.parametrize("flight", FLIGHTS)
def test_short_steps_do_not_round_away_in_single_precision(flight, step):
    assert farthest(flight, "float32", step) < 1e-3


@pytest.mark.parametrize("step", [5e-4, pytest.param(2.5e-4, marks=pytest.mark.slow)])
def test_flights_by_jax_are_those_of_rotorpy(step):
    winds = [in_gusts(gust) for _ in HOVER for _, gust in FLIGHTS.values()]
    found = flown(FLIGHTS, stacked(winds), step=step)
    places, turns = stored()
    assert (np.ptp(places, axis=2).max(axis=2) > 1).all()  # they go somewhere
    for ours, theirs in ((found.position_m, places), (found.quaternion, turns)):
        off = np.asarray(ours).reshape(theirs.shape) - theirs
        assert (np.linalg.norm(off, axis=-1) < 1e-5).all()
