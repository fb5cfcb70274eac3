"""Instruments of a vehicle, and the jolt that a blast gives it."""

from dataclasses import replace
from functools import partial

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jblast.errors import InputError
from jblast.scene import Air, Charge, Imu, Scene, Sensor, VehicleSpec
from jblast.sensors import planned_layout, record
from jblast.sensors.flight_sensors import (
    DIPOLE_GAUSS,
    MOMENTS,
    Barometer,
    Gps,
    Magnetometer,
    Suite,
    blast_overpressure,
    dipole_field,
    height_of,
    lagging,
    pressure_at,
)
from jblast.sensors.law_choice import resolve_laws
from jblast.vehicle import State, blast_load, named, start_of
from tests.vehicle.hovering import wave_at

FIELD = Magnetometer(jnp.array([0.0, 0.2, -0.4]))
PERIOD, TURNS, SPEED = 0.004, 200, 5.0
GROUND = (jnp.asarray(101_325.0), jnp.asarray(288.15))


@eqx.filter_jit
def samples(suite, key):
    """Return the samples of a flight to the east, 10 m up, heading north."""
    times = jnp.arange(-1, TURNS).astype(float) * PERIOD
    zero = jnp.zeros((TURNS + 1, 3))
    place = jnp.stack([SPEED * times, 0 * times, 10 + 0 * times], axis=-1)
    quarter = jnp.array([0.0, 0.0, np.sqrt(0.5), np.sqrt(0.5)])
    north = jnp.broadcast_to(quarter, (TURNS + 1, 4))
    velocity = zero.at[:, 0].set(SPEED)
    states = State(place, velocity, north, zero, jnp.zeros((TURNS + 1, 4)))

    def turn(held, n):
        before, now = (jax.tree.map(lambda x, n=n: x[n], states) for n in (n, n + 1))
        sample, held = suite(
            key, n, held, before, now, n.astype(float) * PERIOD, jnp.asarray(PERIOD)
        )
        return held, sample

    start = suite.start(key, jax.tree.map(lambda x: x[0], states))
    return jax.lax.scan(turn, start, jnp.arange(TURNS))[1]


@pytest.fixture(scope="module")
def many():
    """Return the samples of 300 suites, with the resolution of their IMU."""
    keys = jax.random.split(jax.random.key(2), 300)
    suite = Suite(FIELD, imu=Imu(rate=250.0))
    return eqx.filter_vmap(samples, in_axes=(None, 0))(suite, keys)


def test_a_fix_is_late_by_its_delay_with_errors_of_their_size(many):
    reported = np.flatnonzero(many.has_fix[0])
    # 0.12 s are 30 turns, 5 Hz every 50
    np.testing.assert_array_equal(reported, [30, 80, 130, 180])
    np.testing.assert_array_equal(np.flatnonzero(many.takes_fix[0]), [0, 50, 100, 150])
    true = np.stack([SPEED * (reported - 30) * PERIOD, 0 * reported, 10 + 0 * reported])
    off = np.asarray(many.fix.position_m)[:, reported] - true.T
    # 1200 fixes: 2 % is one standard error
    np.testing.assert_allclose(off.std(axis=(0, 1)), [0.4, 0.4, 0.8], rtol=0.08)


def test_body_axes_of_field_and_force_and_the_resolution(many):
    rows = np.flatnonzero(many.has_field[0])
    np.testing.assert_array_equal(rows, np.arange(0, TURNS, 5))
    field = np.asarray(many.field_gauss)[:, rows]
    # body x is north; one standard error is 0.0001 gauss
    np.testing.assert_allclose(field.mean(axis=(0, 1)), [0.2, 0, -0.4], atol=4e-4)
    np.testing.assert_allclose(field.std(axis=(0, 1)), 0.009, rtol=0.03)
    step = float(Imu().accelerometer_range) / 2**15
    codes = np.asarray(many.force_m_s2) / step
    np.testing.assert_allclose(codes, np.round(codes), atol=1e-6)


@pytest.mark.slow
def test_the_port_measures_all_moments_of_a_wave_through_its_lag():
    load = blast_load(Scene(Charge(1.0, (40.0, 0.0, 0.0), 0.25)))
    suite = Suite(FIELD, barometer=Barometer(noise=0.0), blasts=load)
    read = samples(suite, jax.random.key(0))
    shares = (np.arange(MOMENTS) + 0.5) / MOMENTS
    times = jnp.asarray((np.arange(TURNS)[:, None] - 1 + shares) * PERIOD)
    # the waves of a turn are those in the middle of its path
    middle = SPEED * times.mean(axis=1)
    places = jnp.stack([middle, 0 * middle, 10 + 0 * middle], axis=-1)
    over = jax.jit(jax.vmap(partial(blast_overpressure, load)))(times, places)
    assert float(jnp.min(over)) < 0 < float(jnp.max(over))
    rest = pressure_at(jnp.asarray(10.0), *GROUND)

    def turn(port, outside):
        port = lagging(port, outside, suite.barometer.lag, jnp.asarray(PERIOD))
        return port, port

    _, expected = jax.lax.scan(turn, rest, rest + over)
    np.testing.assert_allclose(read.pressure_pa, expected, rtol=1e-9)


@pytest.mark.slow
def test_overpressure_is_that_of_the_wave():
    vehicle = VehicleSpec("iris", position=jnp.array([20.0, 0.0, 2.0]))
    charge = Charge(5.0, position_m=(0.0, 0.0, 0.0), time_s=1.0)
    never = Charge(5.0, position_m=(1.0, 0.0, 0.0), time_s=jnp.inf, name="n")
    load = blast_load(Scene(charges=(charge, never), vehicle=vehicle))
    place = vehicle.position
    arrival = load.arrival_time_s(place)[0]
    wave = wave_at(load, place)
    lowest = arrival + wave.duration_s + wave.suction_s / 3
    moments = jnp.stack([arrival - 1e-6, arrival + 1e-9, lowest])
    expected = np.array([0.0, float(wave.peak), -float(wave.suction)]) * 101_325
    over = blast_overpressure(load, moments, place)
    np.testing.assert_allclose(over, expected, rtol=1e-5)


@pytest.mark.parametrize(
    ("height", "printed"), [(500.0, 95_460.8), (1000.0, 89_874.6), (5000.0, 54_019.9)]
)
def test_pressures_are_those_of_the_standard_atmosphere(height, printed):
    # US 1976, table I, by geopotential height; six digits are printed
    found = pressure_at(jnp.asarray(height), *GROUND)
    assert float(found) == pytest.approx(printed, rel=2e-6)
    assert float(height_of(found, *GROUND)) == pytest.approx(height, abs=1e-6)


def test_the_dipole_has_its_printed_pole_and_its_moment_at_the_equator():
    # the pole of 2025 as the British Geological Survey prints it: 80.8 N, 72.8 W;
    # a tenth of a degree of latitude is all that is printed
    moment = float(np.linalg.norm(DIPOLE_GAUSS))
    east, north, up = dipole_field(80.8, -72.8)
    assert up == pytest.approx(-2 * moment, rel=1e-5)
    assert np.hypot(east, north) < 2 * moment * np.radians(0.1)
    across = dipole_field(80.8 - 90.0, -72.8)
    np.testing.assert_allclose(across, [0, moment, 0], atol=2e-3 * moment)


@pytest.mark.parametrize(
    ("part", "message"),
    [
        ({"gps": Gps(delay=0.2)}, "gps: expected a delay .* 0.2 s, got 0.2 s"),
        ({"imu": Imu(rate=4.0)}, "gps: expected a rate .* the imu, 4 Hz, got 5 Hz"),
        ({"barometer": Barometer(rate=0.0)}, "barometer: expected a rate .* got 0 Hz"),
    ],
)
def test_an_impossible_rate_or_delay_is_refused(part, message):
    with pytest.raises(ValueError, match=message):
        Suite(FIELD, **part)


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
