"""The wave by way of the ground: from the image of the charge."""

from dataclasses import replace

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jblast.scene import Air, Charge, Scene
from jblast.sensors import heard, overpressure
from jblast.waves import (
    shock_kinematics_arrival_time,
    shock_kinematics_duration,
    shock_kinematics_pressure,
)

SOUND = 340.0
HIGH = Scene(
    Charge(mass_kg=1.0, position_m=(0.0, 0.0, 20.0)), air=Air(sound_speed=SOUND)
)
PLACE = jnp.array([20.0, 0.0, 12.0])
IMAGE = float(np.hypot(20.0, 32.0))


def test_it_comes_from_the_image_by_the_same_laws():
    direct, reflected = heard(HIGH, PLACE)
    assert (direct.kind, reflected.kind) == ("air", "reflected")
    free = ("free-air",)
    np.testing.assert_allclose(reflected.distance, IMAGE, rtol=1e-12)
    np.testing.assert_allclose(
        [
            reflected.pulse.arrival_time,
            reflected.pulse.peak,
            reflected.pulse.duration,
        ],
        [
            shock_kinematics_arrival_time(IMAGE, 1.0, 101325.0, SOUND, *free),
            shock_kinematics_pressure(IMAGE, 1.0, 101325.0, *free),
            shock_kinematics_duration(IMAGE, 1.0, 101325.0, SOUND, *free),
        ],
        rtol=1e-12,
    )
    assert reflected.pulse.arrival_time > direct.pulse.arrival_time + 0.01


@pytest.mark.slow
@pytest.mark.parametrize(
    ("charge", "place"),
    [
        (replace(HIGH.charge, burst="surface"), PLACE),
        (replace(HIGH.charge, position_m=(0.0, 0.0, 0.0)), PLACE),
        (HIGH.charge, PLACE * jnp.array([1.0, 1.0, 0.0])),
        (replace(HIGH.charge, position_m=(0.0, 0.0, 0.5)), PLACE),
    ],
    ids=["surface curves", "on the ground", "place on the ground", "too low"],
)
def test_there_is_none_where_the_ground_is_in_the_curves(charge, place):
    waves = heard(replace(HIGH, charge=charge), place)
    assert all(np.isposinf(w.pulse.arrival_time) for w in waves[1:])
    assert all(w.pulse.peak == 0.0 for w in waves[1:])


@pytest.mark.slow  # compiles for long
def test_gradients_are_finite_where_both_ways_become_one():
    edges = jnp.linspace(0.03, 0.2, 100)

    def energy(up, charge_up):
        scene = replace(
            HIGH, charge=replace(HIGH.charge, position_m=(0.0, 0.0, charge_up))
        )
        place = jnp.stack([jnp.asarray(20.0), jnp.asarray(0.0), up])
        return jnp.sum(overpressure(scene, place, edges) ** 2)

    slopes = jax.jit(jax.vmap(jax.grad(energy, argnums=(0, 1))))(
        jnp.array([0.0, 12.0, 0.0, 12.0]), jnp.array([20.0, 20.0, 0.0, 0.0])
    )
    assert np.all(np.isfinite(slopes))
