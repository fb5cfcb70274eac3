import math

import jax.numpy as jnp
import numpy as np
import pytest

from jblast.errors import InputError
from jblast.scene import Air, Charge, Ground, Scene
from jblast.sensors.wave_paths import ground_laws, ground_waves, pressure_of_velocity
from jblast.waves import ground_motion_velocity, wu_hao_ground_arrival_time
from jblast.waves.pulse import ground_pulse_velocity

PLACE = jnp.array([300.0, 400.0, 2.0])


def test_a_wave_has_the_arrival_and_the_velocity_of_the_laws():
    never = Charge(mass_kg=50.0, time_s=math.inf, name="never")
    first = Charge(mass_kg=50.0, time_s=0.25, name="first")
    scene = Scene(first, others=(never,), ground=Ground(p_speed=5000.0))
    wave, nothing = ground_waves(scene, PLACE, ground_laws(scene))
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
