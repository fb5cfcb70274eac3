"""All instruments of a vehicle: what comes when, and lanes of a batch as alone."""

from functools import partial

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jblast.scene import Charge, Imu, Scene
from jblast.sensors.flight_sensors import (
    MOMENTS,
    Barometer,
    Gps,
    Magnetometer,
    Suite,
    blast_overpressure,
    lagging,
    pressure_at,
)
from jblast.vehicle import State, blast_load

FIELD = Magnetometer(jnp.array([0.0, 0.2, -0.4]))
PERIOD, TURNS = 0.004, 200


def flight(speed):
    """East at a speed, 10 m up."""
    times = jnp.arange(-1, TURNS).astype(float) * PERIOD
    zero = jnp.zeros((TURNS + 1, 3))
    place = jnp.stack([speed * times, 0 * times, 10 + 0 * times], axis=-1)
    level = jnp.broadcast_to(jnp.array([0.0, 0, 0, 1]), (TURNS + 1, 4))
    moves = zero.at[:, 0].set(speed)
    return State(place, moves, level, zero, jnp.zeros((TURNS + 1, 4)))


@eqx.filter_jit
def samples(suite, key, speed):
    states = flight(speed)

    def turn(held, n):
        before, now = (jax.tree.map(lambda x, n=n: x[n], states) for n in (n, n + 1))
        sample, held = suite(
            key, n, held, before, now, n.astype(float) * PERIOD, jnp.asarray(PERIOD)
        )
        return held, sample

    start = suite.start(key, jax.tree.map(lambda x: x[0], states))
    return jax.lax.scan(turn, start, jnp.arange(TURNS))[1]


def test_a_fix_comes_late_by_its_delay_and_tells_where_the_vehicle_was():
    quiet = Gps(horizontal_noise=0.0, vertical_noise=0.0, velocity_noise=0.0)
    told = samples(Suite(FIELD, gps=quiet), jax.random.key(0), jnp.asarray(5.0))
    comes = np.flatnonzero(told.has_fix)
    # 0.12 s are 30 turns, 5 Hz every 50
    np.testing.assert_array_equal(comes, [30, 80, 130, 180])
    was = np.asarray(told.fix.position_m)[comes]
    np.testing.assert_allclose(was[:, 0], 5.0 * (comes - 30) * PERIOD, atol=1e-12)
    np.testing.assert_array_equal(np.flatnonzero(told.takes_fix), [0, 50, 100, 150])


def test_a_blast_comes_through_the_port_from_its_first_moment_to_its_last():
    load = blast_load(Scene(Charge(1.0, (40.0, 0.0, 0.0), 0.25)))
    suite = Suite(FIELD, barometer=Barometer(noise=0.0), blasts=load)
    speed = 9.0
    told = samples(suite, jax.random.key(0), jnp.asarray(speed))
    shares = (np.arange(MOMENTS) + 0.5) / MOMENTS
    times = jnp.asarray((np.arange(TURNS)[:, None] - 1 + shares) * PERIOD)
    places = jnp.stack([speed * times, 0 * times, 10 + 0 * times], axis=-1)
    each = jax.jit(jax.vmap(jax.vmap(partial(blast_overpressure, load))))
    over = each(times, places)
    assert float(jnp.min(over)) < 0 < float(jnp.max(over))
    rest = pressure_at(jnp.asarray(10.0), suite.ground_pressure_pa, jnp.asarray(288.15))

    def turn(port, outside):
        port = lagging(port, outside, suite.barometer.lag, jnp.asarray(PERIOD))
        return port, port

    _, expected = jax.lax.scan(turn, rest, rest + over)
    np.testing.assert_allclose(told.pressure_pa, expected, rtol=1e-9)


def test_errors_of_a_fix_have_their_size():
    keys = jax.random.split(jax.random.key(2), 300)
    still = jnp.zeros(300)
    told = eqx.filter_vmap(samples, in_axes=(None, 0, 0))(Suite(FIELD), keys, still)
    rows = np.asarray(told.has_fix[0])
    off = np.asarray(told.fix.position_m)[:, rows] - [0.0, 0.0, 10.0]
    # 1200 fixes: 2 % is one standard error
    np.testing.assert_allclose(off.std(axis=(0, 1)), [0.4, 0.4, 0.8], rtol=0.08)


def test_what_cannot_be_is_refused():
    with pytest.raises(ValueError, match=r"delay: expected .* got 0\.2 s"):
        Gps(delay=0.2)
    with pytest.raises(
        ValueError, match="gps: expected a rate of at most that of the imu, 4 Hz"
    ):
        Suite(FIELD, imu=Imu(rate=4.0))
