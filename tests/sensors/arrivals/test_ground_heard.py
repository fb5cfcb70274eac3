"""The ground is heard before the air: its velocity times rho c, when record says."""

import jax.numpy as jnp
import numpy as np
import pytest

from jblast.scene import Air, Charge, Ground, Scene
from jblast.scene.scene import GroundPath
from jblast.sensors import Layout, heard, overpressure, record
from jblast.sensors.wave_paths import DEFAULT_GROUND_LAWS

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
