"""What blasts do to a vehicle beside moving it, against numbers worked out by hand."""

import equinox as eqx
import jax.numpy as jnp
import numpy as np
import pytest

from jblast.scene import Charge, Scene
from jblast.study.flight_results import Options, encounter_at, exposed, load_of
from jblast.vehicle import State, blast_load, named

CRAZYFLIE = named("crazyflie")
TIME = np.linspace(0.0, 1.0, 1001)
LEVEL = jnp.array([0.0, 0.0, 0.0, 1.0])


def standing(place) -> State:
    """Return the rows of a vehicle that stays where it is."""
    rows = np.ones((TIME.size, 1))
    still = 0 * rows * np.zeros(3)
    turned = rows * np.asarray(LEVEL)
    return State(rows * place[None, :], still, turned, still, rows * np.zeros(4))


@eqx.filter_jit
def exposure(scene, load, place):
    encounter = encounter_at(load, jnp.asarray(place), LEVEL)
    return exposed(
        scene, load, CRAZYFLIE, encounter, jnp.asarray(TIME), standing(place)
    )


def test_a_pulse_of_a_millisecond_accelerates_by_its_impulse():
    case = np.array([0.1, 8.0, np.pi / 2, np.pi, 3e-3, 0.0, 4e-3, 0.0, 0.0, 0.0])
    made = Scene(Charge(mass_kg=1.0, position_m=(-3.0, 0.0, 2.0)))
    load = load_of(made, Options(profile=case[None]))
    found = exposure(made, load, jnp.array([5.0, 0.0, 2.0]))
    # 5 mN s over 1 ms on 30 g; it is pushed 0.1 mm away while it lasts
    assert float(found.peak_acceleration_m_s2) == pytest.approx(5.0 / 0.03, rel=1e-3)
    assert np.isnan(found.peak_overpressure_pa)
    assert np.isnan(found.fireball_time_s)


@pytest.mark.slow
def test_a_place_in_a_fireball_is_in_it_from_when_it_comes_to_when_it_fades():
    scene = Scene(Charge(mass_kg=1.0, time_s=0.2))
    load = blast_load(scene)
    found = exposure(scene, load, jnp.array([1.0, 0.0, 0.0]))
    reached = -1e-3 * np.log(1 - 1.0 / 1.81)
    # rows a millisecond apart, a flag at each end
    assert float(found.fireball_time_s) == pytest.approx(0.258 - reached, abs=2e-3)
    far = exposure(scene, load, jnp.array([3.0, 0.0, 0.0]))
    assert far.fireball_time_s == 0
    peak = encounter_at(load, jnp.array([3.0, 0.0, 0.0]), LEVEL).overpressure_pa[0]
    np.testing.assert_allclose(far.peak_overpressure_pa, peak)
    # the drag of the wind alone: q of the shock, gamma 1.4, on its side
    pressure = float(peak) / 101325
    push = 2.5 * pressure**2 / (7 + pressure) * 101325 * 1.05 * 1.3e-3
    assert found.peak_acceleration_m_s2 > far.peak_acceleration_m_s2 > push / 0.03


@pytest.mark.slow  # a film is compiled
def test_the_fireball_flown_into_is_the_one_filmed():
    """With the growth time of the scene, and the explosive's worth in TNT."""
    charge = Charge(mass_kg=1.0, time_s=0.2, explosive="C4")
    scene = Scene(charge, fireball_growth=50e-3)
    found = exposure(scene, blast_load(scene), jnp.array([1.0, 0.0, 0.0]))
    # while it reaches the place it rises by 1 cm, a millisecond's worth of growth
    reached = -50e-3 * np.log(1 - 1.0 / (1.81 * 1.37 ** (1 / 3)))
    duration = 0.258 * 1.37**0.349
    assert float(found.fireball_time_s) == pytest.approx(duration - reached, abs=3e-3)


@pytest.mark.slow
def test_a_blast_that_comes_after_the_end_does_nothing_to_it():
    charge = Charge(mass_kg=1.0, time_s=2.0, explosive="C4")  # the program above
    scene = Scene(charge, fireball_growth=50e-3)
    found = exposure(scene, blast_load(scene), jnp.array([3.0, 0.0, 0.0]))
    assert [float(value) for value in found] == [0.0, 0.0, 0.0]
