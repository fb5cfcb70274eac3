"""Waves at a position have the values of `sensors.record`, at rest and moving."""

from dataclasses import replace

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import jblast
from jblast.errors import InputError
from jblast.scene import Air, Charge, Ground, Scene, Sensor
from jblast.sensors import Track, overpressure, record_laws, waves
from jblast.sensors.waves_met import DEFAULT_RECORD_LAWS, IN_GROUND
from jblast.waves import (
    ground_motion_velocity,
    shock_kinematics_arrival_time,
    shock_kinematics_duration,
    shock_kinematics_pressure,
    wu_hao_ground_arrival_time,
)

PLACE = np.array([18.0, 5.0, 1.5])
ON_GROUND = Scene(Charge(mass_kg=15.0, time_s=0.7, burst="surface"))
LIFTED = Scene(Charge(mass_kg=0.5, position_m=(0.0, 0.0, 15.0), burst="free-air"))
OTHER_LAWS = {
    "air_arrival_s": "kingery_bulmash",
    "peak_overpressure_pa": "kinney_graham",
    "positive_duration_s": "kinney_graham",
    "positive_impulse_pa_s": "kinney_graham",
}


def readings(scene, place, laws):
    """Return the values of `sensors.record` at a position, on the common clock."""
    sensor = Sensor("s", place, records=tuple((name, 0.01) for name in laws))
    scene = replace(scene, sensors=(sensor,))
    layout, *_ = jblast.sensors.planned_layout(scene)
    value = jblast.record(scene, layout, dict(laws)).value
    return dict(zip(layout.quantity, np.asarray(value), strict=True))


@pytest.mark.parametrize(
    ("scene", "place", "laws"),
    [
        (ON_GROUND, PLACE, {}),
        (ON_GROUND, 30.0 * PLACE, {}),
        (ON_GROUND, PLACE, OTHER_LAWS),
        (LIFTED, PLACE * [1.0, 1.0, 0.0], {}),
    ],
    ids=["near", "far", "other laws", "free air"],
)
def test_samples_have_arrival_peak_duration_and_impulse_of_the_laws(scene, place, laws):
    known = readings(scene, place, record_laws(scene, laws))
    wave = waves(scene, place, laws)[0].pulse
    for name, value in (
        ("air_arrival_s", wave.arrival_time),
        ("peak_overpressure_pa", wave.peak),
        ("positive_duration_s", wave.duration),
    ):
        # the same formulas compiled twice
        assert float(value) == pytest.approx(known[name], rel=1e-14)
    rate = 4096 / known["positive_duration_s"]
    edges = known["air_arrival_s"] + (np.arange(6000) - 100.3) / rate
    samples = np.asarray(overpressure(scene, place, edges, laws))
    assert np.flatnonzero(samples)[0] == 100
    # a mean is below the peak by the slope there, (1 + b) over 1.5 samples of 4096
    assert samples.max() == pytest.approx(known["peak_overpressure_pa"], rel=1e-3)
    negative = 100 + np.flatnonzero(samples[100:] < 0)[0]
    assert negative == pytest.approx(4196, abs=1.5)
    impulse = samples[:negative].sum() / rate  # but for the last part of a sample
    assert impulse == pytest.approx(known["positive_impulse_pa_s"], rel=1e-5)


def test_a_front_between_two_samples_has_its_exact_time():
    """The share of the first sample that the wave fills gives its arrival."""
    rate, (wave,) = 48e3, waves(ON_GROUND, PLACE)
    arrival, rise = float(wave.pulse.arrival_time), float(wave.pulse.rise_time)
    shifts = np.linspace(0.05, 0.85, 9)  # at least a rise
    sample = jax.vmap(
        lambda start: overpressure(ON_GROUND, PLACE, start + np.arange(3) / rate)
    )
    means = np.asarray(jax.jit(sample)(arrival - shifts / rate))
    # behind the front, whose middle comes half a rise late; the slope behind the front
    # is half a per cent of a sample of 1/530 of the duration
    filled = 1 - shifts - 0.5 * rise * rate
    np.testing.assert_allclose(means[:, 0] / float(wave.pulse.peak), filled, atol=0.002)


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
def test_the_doppler_factor_of_a_radial_track_is_exact(speed):
    """In acoustics: met after R/(c - v), every time over 1 - v/c as long."""
    (wave,) = waves(SCENE, radial(speed), ACOUSTIC)
    met, pace = START / (SOUND - speed), 1.0 - speed / SOUND
    np.testing.assert_allclose(wave.pulse.arrival_time, 1.0 + met, rtol=1e-10)
    np.testing.assert_allclose(wave.pace, pace, rtol=1e-9)
    (there,) = waves(SCENE, [START + speed * met, 0.0, 0.0], ACOUSTIC)
    same = there.pulse._replace(arrival_time=wave.pulse.arrival_time).stretched(pace)
    np.testing.assert_allclose(wave.pulse, same, rtol=1e-9)


@pytest.mark.slow
def test_a_track_has_gradients_and_a_limit_of_speed():
    edges = 1.28 + jnp.linspace(0.0, 0.06, 150)

    def energy(speed):
        time = jnp.array([0.0, 3.0])
        east = START + speed * (time - 1.0)
        track = Track(time, jnp.stack([east, 0 * east, 0 * east], axis=1))
        return jnp.sum(overpressure(SCENE, track, edges) ** 2)

    both = jax.jit(jax.value_and_grad(energy))
    difference = (both(SPEED + 1e-5)[0] - both(SPEED - 1e-5)[0]) / 2e-5
    np.testing.assert_allclose(both(SPEED)[1], difference, rtol=1e-4)
    with pytest.raises(InputError, match=r"track: expected less than the .* of sound"):
        waves(SCENE, radial(1.1 * SOUND), ACOUSTIC)


HIGH = Scene(
    Charge(mass_kg=1.0, position_m=(0.0, 0.0, 20.0)), air=Air(sound_speed=SOUND)
)
ABOVE = jnp.array([20.0, 0.0, 12.0])


def test_the_reflection_comes_from_the_image_by_the_same_laws():
    direct, reflected = waves(HIGH, ABOVE)
    assert (direct.kind, reflected.kind) == ("air", "reflected")
    distance = float(np.hypot(20.0, 32.0))
    air = (distance, 1.0, 101325.0)
    known = [
        distance,
        shock_kinematics_arrival_time(*air, SOUND, "free-air"),
        shock_kinematics_pressure(*air, "free-air"),
        shock_kinematics_duration(*air, SOUND, "free-air"),
    ]
    pulse = reflected.pulse
    found = [reflected.distance, pulse.arrival_time, pulse.peak, pulse.duration]
    np.testing.assert_allclose(found, known, rtol=1e-8)  # within a program: tables
    assert pulse.arrival_time > direct.pulse.arrival_time + 0.01


CONTAINED = {
    "surface curves": (replace(HIGH.charge, burst="surface"), ABOVE),
    "charge on the ground": (replace(HIGH.charge, position_m=(0.0, 0.0, 0.0)), ABOVE),
    "sensor on the ground": (HIGH.charge, ABOVE * jnp.array([1.0, 1.0, 0.0])),
    "charge too low": (replace(HIGH.charge, position_m=(0.0, 0.0, 0.5)), ABOVE),
}


@pytest.mark.parametrize(("charge", "place"), CONTAINED.values(), ids=CONTAINED)
def test_there_is_no_reflection_where_the_curves_contain_the_ground(charge, place):
    for wave in waves(replace(HIGH, charges=(charge,)), place)[1:]:
        assert np.isposinf(wave.pulse.arrival_time)
        assert wave.pulse.peak == 0.0


@pytest.mark.slow  # compiles for long
def test_gradients_are_finite_where_both_ways_become_one():
    edges = jnp.linspace(0.03, 0.2, 100)

    def energy(up, charge_up):
        charge = replace(HIGH.charge, position_m=(0.0, 0.0, charge_up))
        place = jnp.stack([jnp.asarray(20.0), jnp.asarray(0.0), up])
        return jnp.sum(
            overpressure(replace(HIGH, charges=(charge,)), place, edges) ** 2
        )

    slopes = jax.jit(jax.vmap(jax.grad(energy, argnums=(0, 1))))(
        jnp.array([0.0, 12.0, 0.0, 12.0]), jnp.array([20.0, 20.0, 0.0, 0.0])
    )
    assert np.all(np.isfinite(slopes))


def test_a_wave_in_the_ground_has_arrival_and_velocity_of_the_laws():
    never = Charge(mass_kg=50.0, time_s=np.inf, name="never")
    first = Charge(mass_kg=50.0, time_s=0.25, name="first")
    scene = Scene((first, never), ground=Ground(p_speed=5000.0))
    wave, nothing = waves(scene, [300.0, 400.0, 2.0], None, IN_GROUND)
    assert (wave.kind, wave.shot, nothing.shot) == ("ground", 0, 1)
    # the way along the ground, by the law itself
    travel = wu_hao_ground_arrival_time(500.0, 50.0, 5000.0)
    assert wave.pulse.arrival_time == pytest.approx(0.25 + float(travel), rel=1e-6)
    time = wave.pulse.arrival_time + wave.pulse.time_constant * np.linspace(0, 9, 20001)
    peak = ground_motion_velocity(500.0, 50.0, 0.0)
    found = float(wave.pulse.mean(time[:-1], time[1:]).max())
    # a parabola's top between instants 5e-4 of a time constant apart
    assert found == pytest.approx(float(peak), rel=1e-6)
    assert np.isinf(nothing.pulse.arrival_time)
    assert nothing.pulse.amplitude == 0.0


def test_laws_are_those_given_else_the_scenes_else_the_defaults():
    scene = Scene(law=(("air_arrival_s", "wu_hao"), ("positive_duration_s", "auto")))
    given = {"peak_overpressure_pa": "swisdak", "flash_time_s": "light"}
    assert record_laws(scene, given) == {
        **DEFAULT_RECORD_LAWS,
        "air_arrival_s": "wu_hao",
        "peak_overpressure_pa": "swisdak",
    }
    with pytest.raises(InputError, match="ground_motion, got 'ground_motio'; did you"):
        record_laws(Scene(), {"ground_displacement_m": "ground_motio"})


NEAR = Scene(Charge(mass_kg=1.0, burst="free-air"))
# the impulse on the ground is 1.2 times the free-air peak times its duration
FORD = {"positive_impulse_pa_s": "ford_2021"}
REJECTED = {
    "no law": (SCENE, PLACE, {"peak_overpressure_pa": "sadovski"}, "expected one of"),
    "at the charge": (SCENE, [0.0] * 3, None, "expected a position away from it"),
    "nowhere": (SCENE, [np.nan, 0.0, 0.0], None, "expected a position away from it"),
    "no pulse": (NEAR, [0.3, 0.0, 0.0], FORD, "expected laws with a pulse"),
    "two numbers": (SCENE, [1.0, 2.0], None, "place: expected east, north and up"),
}


@pytest.mark.parametrize(
    ("scene", "place", "laws", "said"), REJECTED.values(), ids=REJECTED
)
def test_invalid_places_and_laws_are_rejected(scene, place, laws, said):
    with pytest.raises(InputError, match=said):
        waves(scene, place, laws)
