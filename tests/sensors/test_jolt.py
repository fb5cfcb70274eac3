"""The jolt: the impulse of the load over mass, its limits, its slopes, its messages."""

from dataclasses import replace

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jblast.errors import InputError
from jblast.scene import Air, Charge, Scene, Sensor, VehicleSpec
from jblast.sensors import planned_layout, record
from jblast.sensors.law_choice import resolve_laws
from jblast.vehicle import blast_load, named, start_of

QUANTITIES = ("jolt_velocity_m_s", "jolt_bearing_rad", "jolt_elevation_rad")
LAWS: dict[str, str] = {quantity: "blast_load" for quantity in QUANTITIES}
PLACE = jnp.array([12.0, 9.0, 3.0])
SENSOR = Sensor("imu", PLACE, records=tuple((q, 0.01) for q in QUANTITIES))


def scene_of(mass=10.0, wind=0.0, model="hummingbird") -> Scene:
    return Scene(
        Charge(mass, (0.0, 0.0, 0.0), burst="surface"),
        air=Air(wind_east=wind),
        vehicle=VehicleSpec(model, PLACE, yaw=0.4),
        sensors=(SENSOR,),
    )


LAYOUT, _, _ = planned_layout(scene_of())


@jax.jit
def read_at(mass, place):
    scene = scene_of(mass)
    at = jnp.broadcast_to(place, (3, 3))
    return record(scene, replace(LAYOUT, position=at), LAWS).value


@pytest.mark.slow
@pytest.mark.parametrize("model", ["hummingbird", "iris"])
def test_a_jolt_is_the_impulse_of_the_load_in_one_step_over_mass(model):
    scene = scene_of(model=model)
    assert scene.vehicle is not None
    vehicle, state, load = named(model), start_of(scene.vehicle), blast_load(scene)
    given, _ = load.impulse(jnp.asarray(0.0), jnp.asarray(0.2), state, vehicle)
    changed = np.asarray(given / vehicle.mass_kg)
    speed, bearing, elevation = record(scene, LAYOUT, LAWS).value
    # the same rule over the same wave: rounding alone
    assert float(speed) == pytest.approx(np.linalg.norm(changed), rel=1e-9)
    assert float(bearing) == pytest.approx(np.arctan2(*changed[:2]), rel=1e-9)
    assert float(elevation) == pytest.approx(np.arcsin(changed[2] / speed), rel=1e-9)


@pytest.mark.slow
def test_a_level_vehicle_is_thrown_straight_away_from_the_charge():
    _, bearing, elevation = read_at(10.0, PLACE)
    assert float(bearing) == pytest.approx(np.arctan2(12.0, 9.0), abs=1e-12)
    assert float(elevation) > np.arctan2(3.0, 15.0)  # its rotors lift it besides


@pytest.mark.slow  # slopes of a load are compiled
def test_jolts_have_the_slopes_of_finite_differences():
    given = jnp.asarray(10.0), PLACE
    forward = jax.jit(jax.jacfwd(read_at, argnums=(0, 1)))(*given)
    step = 1e-5  # differences of second order: 1e-10 of the value over it
    for axis in range(3):
        moved = step * jnp.eye(3)[axis]
        slope = (read_at(10.0, PLACE + moved) - read_at(10.0, PLACE - moved)) / 2 / step
        np.testing.assert_allclose(forward[1][:, axis], slope, rtol=1e-6, atol=1e-9)
    slope = (read_at(10.0 + step, PLACE) - read_at(10.0 - step, PLACE)) / 2 / step
    np.testing.assert_allclose(forward[0], slope, rtol=1e-6, atol=1e-9)


@pytest.mark.slow
def test_a_charge_that_never_happens_jolts_nobody():
    never = replace(scene_of(), charges=(replace(scene_of().charge, time_s=jnp.inf),))
    value = record(never, LAYOUT, LAWS).value
    assert float(value[0]) == 0.0
    assert bool(jnp.isnan(value[1:]).all())


def test_the_law_of_a_jolt_is_chosen_without_its_vehicle():
    chosen = resolve_laws(scene_of(), LAYOUT)
    assert {quantity: law.name for quantity, law in chosen.items()} == LAWS


def test_a_scene_without_a_vehicle_has_nothing_to_jolt():
    with pytest.raises(InputError, match=r"jolt: expected a \[vehicle\]"):
        record(replace(scene_of(), vehicle=None), LAYOUT, LAWS)
