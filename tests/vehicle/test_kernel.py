"""The Warp kernel against JAX, and both against flights of RotorPy."""

import csv
import dataclasses
import sys
from pathlib import Path
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from calibration.rotorpy_flights import DURATION, EVERY, FLIGHTS, HELD, HOVER, commands
from jblast.errors import InputError
from jblast.scene import Charge, Scene
from jblast.vehicle import (
    Commands,
    Gust,
    PositionHold,
    State,
    blast_load,
    friedlander,
    n_wave,
    named,
    named_gains,
    simulate,
)
from tests.vehicle.flights import at_hover, stacked

CRAFT = named("hummingbird")
BATCH = 5
PLACES = np.array([5.0, 0.0, 4.0]) + np.linspace(-1, 1, BATCH)[:, None] * [1, 2, 0.5]
FIELDS = (
    *("position_m", "velocity_m_s", "quaternion", "body_rate_rad_s"),
    *("rotor_speed_rad_s", "force_n", "moment_n_m"),
)
ROUNDING = {"float64": 1e-10, "float32": 1e-4}
"""Of the largest number of a field: a load is the difference of impulses over a step,
which loses some digits, and the hold multiplies what is lost."""


def start(dtype="float64") -> State:
    """Return a batch that flies and turns."""
    ones = np.ones((BATCH, 1))
    rest = at_hover(CRAFT)
    state = State(
        PLACES,
        ones * [1.0, -2.0, 0.5],
        ones * [0.1, -0.2, 0.1, 0.9],
        ones * [0.5, -0.3, 0.8],
        ones * np.asarray(rest.rotor_speed_rad_s),
    )
    return jax.tree.map(lambda x: x.astype(dtype), state)


def everything(*others: Charge) -> dict:
    """Return a flight of which each vehicle has its own hold, gust and blasts."""
    gains = named_gains("hummingbird", integral=True)
    many = jax.tree.map(
        lambda x: jnp.stack([x * (1 + n / 50) for n in range(BATCH)]), gains
    )
    push = jnp.tile(jnp.array([8.0, 3.0, -2.0]), (BATCH, 1))
    when = jnp.linspace(0.01, 0.02, BATCH)

    def loads(mass):
        return blast_load(Scene(charges=(Charge(mass_kg=mass, name="a"), *others)))

    return {
        "control": PositionHold(jnp.asarray(PLACES), many, jnp.zeros(BATCH) + 0.3),
        "wind": Gust(push, when, 0.02 + 0.01 * when, friedlander),
        "loads": (jax.vmap(loads)(jnp.linspace(0.5, 2.0, BATCH)),),
        "control_period_s": 2e-3,
        "ground_up_m": 0.0,
        "store_every": 7,
    }


def agree(vehicle, state, *, duration_s=0.05, **options) -> None:
    """Hold both to the same flight, and a flight it must be."""
    ours = simulate(
        vehicle, state, duration_s=duration_s, backend="warp:cpu", **options
    )
    jaxs = simulate(vehicle, state, duration_s=duration_s, backend="jax", **options)
    assert float(jnp.abs(jaxs.position_m[..., -1, :] - state.position_m).max()) > 0.01
    np.testing.assert_array_equal(ours.time_s, jaxs.time_s)
    assert ours.position_m.dtype == jaxs.position_m.dtype
    for name in FIELDS:
        there, here = np.asarray(getattr(jaxs, name)), np.asarray(getattr(ours, name))
        assert here.shape == there.shape
        scale = np.abs(there).max()
        rounding = ROUNDING[there.dtype.name] * scale
        np.testing.assert_allclose(here, there, atol=rounding, rtol=0, err_msg=name)
    assert not ours.lost.any()


@pytest.mark.slow
@pytest.mark.parametrize("dtype", ["float64", "float32"])
def test_same_flights_with_everything_at_once(dtype):
    agree(CRAFT, start(dtype), **everything())


class Nudge(eqx.Module):
    """A user's controller: a table of speeds, a counter, a loop, and lost numbers."""

    speeds: jax.Array

    def start(self) -> Any:
        return jnp.zeros(()), jnp.zeros((), int)

    def __call__(self, time_s, state, vehicle, memory, period_s):
        level, count = memory
        up = jnp.cos(jnp.linalg.norm(state.quaternion)) + state.velocity_m_s[2]
        level = jax.lax.cond(up > 0, lambda x: x - 1, lambda x: x + period_s, level)
        summed = jax.lax.fori_loop(0, 3, lambda n, x: x + self.speeds[n, 0], 0.0)
        unknown = jnp.log(-1 - jnp.square(up))
        lost = (
            *(jnp.maximum(unknown, 0), jnp.maximum(0, unknown), jnp.sign(unknown)),
            *(jnp.minimum(unknown, 0), jnp.minimum(0, unknown), jnp.arccos(unknown)),
            *(jax.lax.clamp(0.0, unknown, 1.0), jnp.arcsin(2 + jnp.square(up))),
        )
        kept = jnp.isnan(jnp.stack(lost)).astype(up.dtype)
        case = (count % 3).astype("int32")
        one_of_three = jax.lax.select_n(case, up, 2 * up, 3 * up)
        inverted = (~count % 5).astype(up.dtype)
        added = one_of_three + inverted + jnp.arange(1.0, 9.0) @ kept
        return self.speeds[count % 3] + level + summed / 3e3 + added, (level, count + 1)


def spring(time_s, state, vehicle):
    """A user's load."""
    pull = jnp.array([0.1, 0.2, 0.3]) - 0.01 * state.position_m
    return vehicle.mass_kg * pull, jnp.array([1e-4, 0.0, 0.0]) * jnp.sin(time_s)


def shear(time_s, position_m):
    """A user's wind."""
    height, wind = jnp.array([0.0, 3.0, 5.0]), jnp.array([0.0, 2.0, 9.0])
    return jnp.array([1.0, 0.5, 0.0]) * jnp.interp(position_m[2], height, wind)


@pytest.mark.slow  # a program of each
def test_same_flights_of_a_users_controller_wind_and_load():
    hover = jnp.asarray(at_hover(CRAFT).rotor_speed_rad_s)
    speeds = jnp.stack([hover, hover + 9.0, hover - 5.0])
    agree(
        CRAFT,
        start(),
        control=Nudge(speeds),
        control_period_s=2e-3,
        wind=shear,
        loads=(spring,),
        store_every=7,
    )


def test_a_device_that_is_not_there():
    with pytest.raises(InputError, match="of warp:DEVICE among cpu"):
        simulate(CRAFT, start(), duration_s=0.01, backend="warp:cuda:9")


class Sorted(Nudge):
    """A controller with an operation that has no C code."""

    def __call__(self, time_s, state, vehicle, memory, period_s):
        return self.speeds[0] + jnp.sort(state.position_m)[0], memory


class Taking(Nudge):
    """A controller that reads NaN outside of its table."""

    def __call__(self, time_s, state, vehicle, memory, period_s):
        level, count = memory
        return jnp.take(self.speeds, count, axis=0), (level, count + 1)


class Large(Sorted):
    """A controller whose state is too large for registers."""

    def start(self) -> Any:
        return jnp.zeros(17)


@pytest.fixture
def without_jax(monkeypatch):
    """Have JAX fly nothing, and say how many vehicles it was asked to fly."""
    module, asked = sys.modules[simulate.__module__], []
    monkeypatch.setattr(module, "_FLY_EACH", lambda *_, batch, **__: batch)
    monkeypatch.setattr(module, "_trajectory", lambda _, batch: asked.append(batch))
    return asked


@pytest.mark.parametrize(
    ("kind", "said"),
    [
        (Sorted, "operation sort"),
        (Taking, "operation gather with mode='fill', as of jnp.take"),
        (Large, "state of 17 numbers"),
    ],
)
def test_what_has_no_c_code_flies_on_jax_and_says_so(without_jax, kind, said):
    control = kind(jnp.full((3, 4), 500.0))
    with pytest.warns(UserWarning, match=f"{said}: JAX is used"):
        simulate(CRAFT, start(), duration_s=0.001, control=control, backend="warp")
    assert without_jax == [(BATCH,)]


def test_flights_on_warp_have_no_derivatives():
    """Those of JAX are held against differences with the loads."""

    def height(east):
        state = at_hover(CRAFT, position=(east, 0.0, 4.0))
        flown = simulate(CRAFT, state, duration_s=0.01, backend="warp:cpu")
        return flown.position_m[-1, 2]

    with pytest.raises(InputError, match="Warp flights have no derivatives"):
        jax.grad(height)(1.0)


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
