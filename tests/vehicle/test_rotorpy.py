"""Flights against those of RotorPy 3.0.0, stored in calibration/data: JAX and Warp."""

import csv
import dataclasses
from pathlib import Path

import equinox as eqx
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
from tests.vehicle.flights import stacked

TABLE = Path(__file__).parents[2] / "calibration/data/rotorpy_flights.csv"
KINDS = {
    "step": lambda gust: Gust(gust.velocity, gust.start),
    "n-wave": lambda gust: Gust(gust.velocity, gust.start, gust.duration, n_wave),
    "friedlander": lambda gust: Gust(
        gust.velocity, gust.start, gust.duration, friedlander
    ),
}


class Gusts(eqx.Module):
    """A wind of every kind, of which a flight meets one: the others are still air."""

    step: Gust
    n_wave: Gust
    friedlander: Gust

    def __call__(self, time_s, position_m):
        parts = self.step, self.n_wave, self.friedlander
        return sum(part(time_s, position_m) for part in parts)


def in_gusts(gust) -> Gusts:
    """One of the table's gusts."""
    velocity = np.array(gust.velocity)
    return Gusts(
        *(
            made(gust._replace(velocity=velocity * (gust.kind == kind)))
            for kind, made in KINDS.items()
        )
    )


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


def flown(dtype="float64", step=5e-4, backend="jax"):
    """Fly each vehicle through each of the flights."""
    starts, asked, vehicles, winds = [], [], [], []
    for name, hover in HOVER.items():
        vehicle = dataclasses.replace(named(name), name="")  # or they do not stack
        for begins, gust in FLIGHTS.values():
            parts = (*begins.values(), [hover] * 4)
            starts.append(State(*(np.array(part, dtype) for part in parts)))
            asked.append(commands(hover))
            vehicles.append(vehicle)
            winds.append(in_gusts(gust))
    found = simulate(
        stacked(vehicles),
        stacked(starts),
        duration_s=DURATION,
        step_s=step,
        control=Commands(np.stack(asked), np.full(len(asked), HELD)),
        wind=stacked(winds),
        store_every=round(EVERY / step),
        backend=backend,
    )
    assert found.position_m.dtype == dtype
    return found


@pytest.mark.parametrize(
    "backend", ["jax", pytest.param("warp:cpu", marks=pytest.mark.slow)]
)
def test_flights_are_those_of_rotorpy(backend):
    found = flown(backend=backend)
    places, turns = stored()
    assert (np.ptp(places, axis=2).max(axis=2) > 1).all()  # they go somewhere
    for ours, theirs in ((found.position_m, places), (found.quaternion, turns)):
        off = np.asarray(ours).reshape(theirs.shape) - theirs
        assert (np.linalg.norm(off, axis=-1) < 1e-5).all()


@pytest.mark.slow
@pytest.mark.parametrize("step", [5e-4, 1e-4])
def test_short_steps_do_not_round_away_in_single_precision(step):
    found, (places, _) = flown("float32", step, "warp:cpu"), stored()
    off = np.asarray(found.position_m).reshape(places.shape) - places
    assert np.linalg.norm(off, axis=-1).max() < 1e-3
