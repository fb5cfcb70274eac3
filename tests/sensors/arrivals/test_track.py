"""Places that move, and the way by the ground, from the image of the charge."""

from dataclasses import replace

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jblast.errors import InputError
from jblast.scene import Air, Charge, Scene
from jblast.sensors import Track, heard, overpressure
from jblast.waves import (
    shock_kinematics_arrival_time,
    shock_kinematics_duration,
    shock_kinematics_pressure,
)
from jblast.waves.pulse import pulse_mean

SOUND, START, SPEED = 340.0, 100.0, 34.0
SCENE = Scene(
    Charge(mass_kg=2.0, time_s=1.0, burst="surface"), air=Air(sound_speed=SOUND)
)
ACOUSTIC = {"air_arrival_s": "acoustic"}


def radial(speed):
    """Return a track away from the charge, at START when it explodes."""
    time = np.array([0.0, 1.0, 1.2, 3.0])  # a knot on the way changes nothing
    east = START + speed * (time - 1.0)
    return Track(time, np.stack([east, 0 * east, 0 * east], axis=1))


@pytest.mark.parametrize("speed", [-SPEED, 0.0, SPEED, 0.8 * SOUND])
def test_doppler_of_a_place_on_the_ray_is_exact(speed):
    """In acoustics: met after R/(c - v), every time over 1 - v/c as long."""
    (wave,) = heard(SCENE, radial(speed), ACOUSTIC)
    met = START / (SOUND - speed)
    np.testing.assert_allclose(wave.pulse.arrival_time, 1.0 + met, rtol=1e-10)
    place = [START + speed * met, 0.0, 0.0]
    (there,) = heard(SCENE, place, ACOUSTIC)
    np.testing.assert_allclose(wave.pulse.peak, there.pulse.peak, rtol=1e-9)
    slower = 1.0 - speed / SOUND
    np.testing.assert_allclose(
        wave.pulse.duration, there.pulse.duration / slower, rtol=1e-9
    )
    edges = 1.0 + met + np.linspace(-0.2, 5.0, 300) * float(wave.pulse.duration)
    samples = overpressure(SCENE, radial(speed), edges, ACOUSTIC)
    np.testing.assert_allclose(
        samples,
        pulse_mean(wave.pulse, edges[:-1], edges[1:]),
        atol=1e-7 * float(wave.pulse.peak),
    )


@pytest.mark.slow  # compiles for long
def test_gradients_by_the_track_are_those_of_differences():
    edges = 1.28 + jnp.linspace(0.0, 0.06, 150)

    def energy(speed):
        time = jnp.array([0.0, 3.0])
        east = START + speed * (time - 1.0)
        track = Track(time, jnp.stack([east, 0 * east, 0 * east], axis=1))
        return jnp.sum(overpressure(SCENE, track, edges) ** 2)

    slope = jax.jit(jax.grad(energy))(SPEED)
    of = jax.jit(energy)
    difference = (of(SPEED + 1e-5) - of(SPEED - 1e-5)) / 2e-5
    np.testing.assert_allclose(slope, difference, rtol=1e-4)


@pytest.mark.parametrize(
    ("time", "position"),
    [
        ([], np.zeros((0, 3))),
        ([0.0, 1.0], np.zeros((3, 3))),
        ([0.0, 0.0], np.zeros((2, 3))),
        ([0.0, np.nan], np.zeros((2, 3))),
        ([0.0, 1.0], np.full((2, 3), np.inf)),
    ],
)
def test_knots_that_do_not_fit_are_refused(time, position):
    with pytest.raises(InputError, match="track: expected"):
        Track(np.array(time), position)


def test_a_place_faster_than_sound_is_refused():
    with pytest.raises(InputError, match=r"track: expected less than the .* of sound"):
        heard(SCENE, radial(1.1 * SOUND), ACOUSTIC)


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
    waves = heard(replace(HIGH, charges=(charge,)), place)
    assert all(np.isposinf(w.pulse.arrival_time) for w in waves[1:])
    assert all(w.pulse.peak == 0.0 for w in waves[1:])


@pytest.mark.slow  # compiles for long
def test_gradients_are_finite_where_both_ways_become_one():
    edges = jnp.linspace(0.03, 0.2, 100)

    def energy(up, charge_up):
        scene = replace(
            HIGH, charges=(replace(HIGH.charge, position_m=(0.0, 0.0, charge_up)),)
        )
        place = jnp.stack([jnp.asarray(20.0), jnp.asarray(0.0), up])
        return jnp.sum(overpressure(scene, place, edges) ** 2)

    slopes = jax.jit(jax.vmap(jax.grad(energy, argnums=(0, 1))))(
        jnp.array([0.0, 12.0, 0.0, 12.0]), jnp.array([20.0, 20.0, 0.0, 0.0])
    )
    assert np.all(np.isfinite(slopes))
