"""The ground is heard before the air: its velocity times rho c, when record says."""

import math

import jax.numpy as jnp
import numpy as np
import pytest

from jblast.errors import InputError
from jblast.scene import Air, Charge, Ground, Scene
from jblast.scene.scene import GroundPath
from jblast.sensors import Layout, heard, overpressure, record
from jblast.sensors.wave_paths import (
    DEFAULT_GROUND_LAWS,
    ground_laws,
    ground_waves,
    pressure_of_velocity,
)
from jblast.waves import ground_motion_velocity, wu_hao_ground_arrival_time
from jblast.waves.pulse import ground_pulse_velocity

PLACE = np.array([60.0, 0.0, 8.0])
DENSITY_TIMES_SPEED = 413.0  # of air at 20 C [kg/m2/s]


def scene(path: GroundPath = "thesis", **charge):
    return Scene(
        Charge(mass_kg=15.0, burst="surface", **charge),
        air=Air(temperature=293.15),
        ground=Ground(path=path),
    )


@pytest.mark.parametrize(
    "path", [pytest.param("head", marks=pytest.mark.slow), "thesis"]
)
def test_it_comes_when_record_says_with_the_velocity_that_record_says(path):
    layout = Layout(
        quantity=("ground_arrival_s", "ground_peak_velocity_m_s"),
        position=jnp.stack([PLACE, PLACE * np.array([1.0, 1.0, 0.0])]),
        slant_range=jnp.full(2, jnp.nan),
        time=jnp.full(2, jnp.nan),
        group=(0, 0),
        shot=(0, 0),
        clock=("", ""),
    )
    arrival, velocity = record(scene(path), layout, DEFAULT_GROUND_LAWS).value
    air, ground = heard(scene(path), PLACE, ground=True)
    assert (air.kind, ground.kind) == ("air", "ground")
    np.testing.assert_allclose(ground.pulse.arrival_time, arrival, rtol=1e-12)
    assert arrival < 0.5 * air.pulse.arrival_time
    fine = float(ground.pulse.time_constant) / 1000
    edges = float(arrival) + fine * np.arange(-10, 9000)
    pressure = np.asarray(overpressure(scene(path), PLACE, edges, ground=True))
    before_air = edges[1:] < air.pulse.arrival_time
    pressure = pressure[before_air]
    assert np.all(pressure[:10] == 0.0)
    assert pressure[10] > 0.0
    # rho c by its printed value to half a per cent; the shape is sampled finely
    np.testing.assert_allclose(
        pressure.max(), DENSITY_TIMES_SPEED * velocity, rtol=5e-3
    )


@pytest.mark.slow
def test_off_it_is_not_there_and_never_is_silent():
    edges = np.linspace(0.0, 0.1, 300)
    assert np.all(np.asarray(overpressure(scene(), PLACE, edges)) == 0.0)
    never = scene(time_s=jnp.inf)
    heard_of_it = overpressure(never, PLACE, edges, ground=True)
    assert np.all(np.asarray(heard_of_it) == 0.0)
    assert np.isposinf(heard(never, PLACE, ground=True)[1].pulse.arrival_time)


FAR = jnp.array([300.0, 400.0, 2.0])


def test_a_wave_has_the_arrival_and_the_velocity_of_the_laws():
    never = Charge(mass_kg=50.0, time_s=math.inf, name="never")
    first = Charge(mass_kg=50.0, time_s=0.25, name="first")
    scene = Scene((first, never), ground=Ground(p_speed=5000.0))
    wave, nothing = ground_waves(scene, FAR, ground_laws(scene))
    # the way along the ground, by the law itself
    travel = wu_hao_ground_arrival_time(500.0, 50.0, 5000.0)
    assert wave.arrival_time == pytest.approx(0.25 + float(travel), rel=1e-6)
    time = wave.arrival_time + wave.time_constant * np.linspace(0.0, 9.0, 20_001)
    velocity = ground_pulse_velocity(wave, time)
    # a parabola's top between instants 5e-4 of a time constant apart
    peak = ground_motion_velocity(500.0, 50.0, 0.0)
    assert float(velocity.max()) == pytest.approx(float(peak), rel=1e-6)
    assert math.isinf(nothing.arrival_time)
    assert not ground_pulse_velocity(nothing, time).any()


def test_standard_air_has_an_impedance_of_417_rayl():
    """1.225 kg/m3 times 340.3 m/s; humidity is half and takes a little."""
    assert float(pressure_of_velocity(Air())) == pytest.approx(417.0, rel=5e-3)


def test_a_law_that_there_is_not_is_refused():
    with pytest.raises(InputError, match="ground_motion, got 'ground_motio'; did you"):
        ground_laws(Scene(), {"ground_displacement_m": "ground_motio"})
