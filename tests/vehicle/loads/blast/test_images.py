"""The wave by way of the ground: a second blast, from the image of the charge."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jblast.scene import Charge, Scene
from jblast.sensors.flight_sensors import blast_overpressure
from jblast.vehicle import blast_load
from jblast.vehicle.loads.blast_wave import arrival_time, wave_at, wind_speed
from jblast.vehicle.quadrotor import required_body
from jblast.waves.height_of_burst import image_range
from tests.vehicle.loads.blast.hovering import CRAZYFLIE, held, hovering, impulse

UP, AWAY, ABOVE = 12.0, 14.0, 4.0
"""Height of burst, distance over ground and height of the vehicle."""
HEAVY = eqx.tree_at(lambda v: v.mass_kg, CRAZYFLIE, jnp.asarray(1e6))
"""It stays where it is: 1000 t."""


def load(up: float = UP, mass: float = 1.0, **options):
    charge = Charge(mass, (0.0, 0.0, up), burst="free-air")
    return blast_load(Scene(charge), **options)


def at(up: float = ABOVE):
    return hovering(CRAZYFLIE, (AWAY, 0.0, up))


def times(one, state) -> list[float]:
    """When each of its waves comes."""
    air = one.surroundings()
    return [float(b.time_s + b.travel_time_s(air, state.position_m)) for b in one.waves]


def test_it_comes_from_below_as_far_as_the_image_by_the_laws_of_free_air():
    one, state = load(), at()
    far = float(image_range(np.hypot(AWAY, UP - ABOVE), UP, ABOVE))
    assert far == pytest.approx(np.hypot(AWAY, UP + ABOVE), rel=1e-12)
    mass, pressure, speed = jnp.ones(()), one.pressure_pa, one.sound_speed_m_s
    (image,) = one.images
    expected = arrival_time(jnp.asarray(far), mass, pressure, speed, "free-air")
    assert times(one, state)[1] == pytest.approx(float(expected), rel=1e-12)
    wave = wave_at(jnp.asarray(far), mass, mass, pressure, speed, "free-air")
    found = one.wave_of(image, state.position_m)
    np.testing.assert_allclose(found, wave, rtol=1e-12)


@pytest.mark.parametrize("step", [1e-3, 10e-3])
def test_a_step_of_any_length_gives_the_jumps_of_both_fronts(step):
    """Each is rho V (1 + C_m) u_s along its own way, and together they are the sum."""
    both, straight = (
        load(drag=False, rotors=False, reflection=seen) for seen in (True, False)
    )
    first, second = times(both, at())
    assert second > first + 0.01
    # rotors that carry 1000 t: it stays
    carries = jnp.sqrt(1e6 * 9.81 / 4 / CRAZYFLIE.thrust_coefficient)
    state = eqx.tree_at(lambda x: x.rotor_speed_rad_s, at(), jnp.full(4, carries))
    body = required_body(CRAZYFLIE.body)
    density = 1.4 * both.pressure_pa / both.sound_speed_m_s**2
    for came, blast, up in ((first, both.blasts[0], -UP), (second, both.images[0], UP)):
        edges = np.append(np.arange(0.0, came, step), came + 1e-3)
        given = held(state, HEAVY, both, edges).sum(axis=0)
        if blast is both.images[0]:  # less what the first has given until then
            given = given - held(state, HEAVY, straight, edges).sum(axis=0)
        way = np.array([AWAY, 0.0, ABOVE + up])
        way /= np.linalg.norm(way)
        wave = both.wave_of(blast, state.position_m)
        speed = wind_speed(wave, jnp.asarray(1e-3))
        jump = float(density * body.volume_m3 * 1.5 * speed)
        np.testing.assert_allclose(given, jump * way, rtol=3e-3, atol=1e-3 * jump)


def test_on_the_ground_both_are_one_of_twice_the_pressure_that_pushes_along_it():
    one, state = load(rotors=False, drag=False), at(0.0)
    first, second = times(one, state)
    assert first == second
    pressure = blast_overpressure(one, jnp.asarray(first + 1e-6), state.position_m)
    alone = load(reflection=False)
    half = blast_overpressure(alone, jnp.asarray(first + 1e-6), state.position_m)
    assert float(pressure) == pytest.approx(2 * float(half), rel=1e-12)
    ends = jnp.asarray(0.0), jnp.asarray(first + 1e-3)
    given = impulse(one, *ends, state, CRAZYFLIE)[0]
    assert abs(float(given[2])) < 1e-12 * float(given[0])


@pytest.mark.slow
def test_of_a_charge_so_high_that_its_echo_is_faint_nothing_is_left():
    state = hovering(CRAZYFLIE, (5.0, 0.0, 2000.0))
    both, straight = (load(2000.0, reflection=seen) for seen in (True, False))
    push = [
        np.asarray(impulse(x, *map(jnp.asarray, (0.0, 20.0)), state, HEAVY)[0])
        for x in (both, straight)
    ]
    wave = both.wave_of(both.images[0], state.position_m)
    assert float(wave.peak) < 1e-4
    np.testing.assert_allclose(
        *push, rtol=1e-3, atol=1e-3 * float(np.abs(push[1]).max())
    )


def test_while_it_says_it_is_quiet_no_front_comes_the_second_neither():
    one, state = load(), at()
    first, second = times(one, state)
    between = jnp.asarray((first + second) / 2)
    until = float(one.quiet_until(between, state, CRAZYFLIE))
    assert float(between) <= until < second
    assert float(one.quiet_until(jnp.asarray(second + 60.0), state, CRAZYFLIE)) > second


@pytest.mark.slow
@pytest.mark.parametrize("burst", ["surface", "free-air"])
def test_a_charge_on_the_ground_has_none_and_a_batch_of_both_kinds_is_its_loop(burst):
    charge = Charge(1.0, (0.0, 0.0, 0.0), burst=burst)
    assert blast_load(Scene(charge)).images == ()
    if burst == "surface":
        assert blast_load(Scene(Charge(1.0, (0.0, 0.0, 9.0), burst=burst))).images == ()
        return

    def push(up):
        one = load(up)
        return one.impulse(jnp.asarray(0.0), jnp.asarray(0.3), at(), HEAVY)[0]

    heights = jnp.array([0.0, UP])
    together = jax.jit(jax.vmap(push))(heights)
    for up, found in zip(heights, together, strict=True):
        given = impulse(load(float(up)), *map(jnp.asarray, (0.0, 0.3)), at(), HEAVY)
        np.testing.assert_allclose(found, given[0], rtol=1e-9, atol=1e-12)
