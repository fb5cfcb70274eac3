"""The jolt: the impulse of the load over mass, its limits, its slopes, its messages."""

from dataclasses import replace
from itertools import pairwise

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jblast.errors import InputError
from jblast.scene import Air, Charge, Scene, Sensor, VehicleSpec
from jblast.sensors import planned_layout, record
from jblast.sensors.law_choice import resolve_laws
from jblast.vehicle import State, blast_load, named, start_of
from jblast.vehicle.loads.blast import jolt_velocity
from jblast.vehicle.loads.blast_wave import (
    Blast,
    Surroundings,
    density_ratio,
    overpressure,
    wind_speed,
)
from jblast.vehicle.quadrotor import required_body

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
    came = load.arrival_time_s(PLACE)[0]
    wave = load.wave_of(load.blasts[0], PLACE)
    end = came + 1.2 * (wave.duration_s + wave.suction_s)
    given, _ = load.impulse(came - 1e-3, end, state, vehicle)
    changed = np.asarray(given / vehicle.mass_kg)
    speed, bearing, elevation = record(scene, LAYOUT, LAWS).value
    # the same rule over the same wave: rounding alone
    assert float(speed) == pytest.approx(np.linalg.norm(changed), rel=1e-9)
    assert float(bearing) == pytest.approx(np.arctan2(*changed[:2]), rel=1e-9)
    assert float(elevation) == pytest.approx(np.arcsin(changed[2] / speed), rel=1e-9)


def test_a_known_pulse_of_drag_alone_is_its_integral():
    # rotors that feel no wind and a body without a volume: quadratic drag, and so heavy
    # that nothing moves meanwhile: 1/2 rho C A u |u| over the wave, by another rule
    vehicle = named("hummingbird")
    still = {
        "rotor_drag": jnp.zeros(3),
        "translational_lift": jnp.zeros(()),
        "mass_kg": jnp.asarray(1e6),
        "body": replace(required_body(vehicle.body), volume_m3=jnp.zeros(())),
    }
    vehicle = replace(vehicle, **still)
    place = jnp.array([15.0, 0.0, 0.0])
    air = Surroundings(jnp.asarray(101325.0), jnp.asarray(340.0), jnp.zeros(3))
    blast = Blast(jnp.zeros(3), 0.0, 10.0, 10.0, "surface")
    rest = jnp.zeros(3)
    state = State(place, rest, jnp.array([0.0, 0.0, 0.0, 1.0]), rest, jnp.zeros(4))
    wave = blast.wave(air, place)
    parts = [0.0, float(wave.duration_s), float(wave.duration_s + wave.suction_s)]
    total = 0.0
    for first, last in pairwise(parts):
        middle = jnp.asarray(first + (last - first) * (np.arange(4000) + 0.5) / 4000)
        wind = np.asarray(wind_speed(wave, middle))
        density = 1.4 * 101325.0 / 340.0**2 * density_ratio(overpressure(wave, middle))
        force = 0.5 * np.asarray(density) * 1.05 * 0.020 * wind * np.abs(wind)
        total += force.mean() * (last - first)
    got = jolt_velocity(blast, air, vehicle, state)
    # eight nodes a phase leave 1e-3 of the drag at most (vehicle/loads/blast_wave.py)
    assert float(got[0]) == pytest.approx(total / 1e6, rel=1e-3)
    np.testing.assert_allclose(got[1:], 0.0, atol=1e-20)


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
