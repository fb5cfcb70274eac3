"""A barometer on a vehicle: heights, its lag, and what a blast makes it say."""

import jax.numpy as jnp
import numpy as np
import pytest

from jblast.scene import Charge, Scene, VehicleSpec
from jblast.sensors.flight_sensors import (
    MOST_PA,
    Barometer,
    blast_overpressure,
    height_of,
    lagging,
    pressure_at,
)
from jblast.vehicle import blast_load

GROUND = (jnp.asarray(101_325.0), jnp.asarray(288.15))

PRINTED = {500.0: 95_460.8, 1000.0: 89_874.6, 5000.0: 54_019.9}
"""Pressures of the standard atmosphere by geopotential height, US 1976, table I."""


@pytest.mark.parametrize("height", PRINTED)
def test_pressures_are_those_printed_of_the_standard_atmosphere(height):
    found = pressure_at(jnp.asarray(height), *GROUND)
    # six digits are printed
    assert float(found) == pytest.approx(PRINTED[height], rel=2e-6)
    assert float(height_of(found, *GROUND)) == pytest.approx(height, abs=1e-6)


def test_it_comes_to_a_new_pressure_by_its_lag():
    lag = jnp.asarray(0.02)
    at_first = jnp.asarray(100_000.0)
    after = lagging(at_first, jnp.full(8, 101_000.0), lag, lag)
    assert float(after) == pytest.approx(101_000 - 1000 * np.exp(-1), abs=1e-6)


def test_it_says_no_more_than_it_can():
    lag = jnp.asarray(1e-4)
    told = lagging(jnp.asarray(1e5), jnp.full(8, 5e5), lag, jnp.asarray(0.004))
    assert float(told) == MOST_PA


def test_a_blast_comes_on_top_as_its_wave_has_it():
    vehicle = VehicleSpec("iris", position=jnp.array([20.0, 0.0, 2.0]))
    charge = Charge(5.0, position_m=(0.0, 0.0, 0.0), time_s=1.0)
    never = Charge(5.0, position_m=(1.0, 0.0, 0.0), time_s=jnp.inf, name="n")
    scene = Scene(charge, others=(never,), vehicle=vehicle)
    load, place = blast_load(scene), vehicle.position
    came = load.arrival_time_s(place)[0]
    wave = load.wave_of(load.blasts[0], place)
    peak = blast_overpressure(load, came + 1e-9, place)
    assert float(peak) == pytest.approx(float(wave.peak) * 101_325, rel=1e-5)
    assert float(blast_overpressure(load, came - 1e-6, place)) == 0
    sucked = came + wave.duration_s + wave.suction_s / 3
    low = blast_overpressure(load, sucked, place)
    assert float(low) == pytest.approx(-float(wave.suction) * 101_325, rel=1e-6)


def test_a_rate_of_nothing_is_refused():
    with pytest.raises(ValueError, match="rate: expected a positive rate, got 0 Hz"):
        Barometer(rate=0.0)
