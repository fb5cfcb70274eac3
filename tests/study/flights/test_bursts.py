"""Curve sets of charges above the ground, and the remarks on them."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from jblast.scene import Charge, Scene, VehicleSpec
from jblast.study.flight_results import Options, burst_remarks, load_of
from jblast.vehicle import BlastLoad

CRAFT = VehicleSpec(model="crazyflie", position=np.array([5.0, 0.0, 12.0]))


def scene_of(up, burst=None):
    charge = Charge(mass_kg=1.0, position_m=(0.0, 0.0, up), burst=burst)
    return Scene(charge, vehicle=CRAFT)


def test_a_charge_high_up_has_the_free_air_curves_with_a_remark():
    (note,) = burst_remarks(scene_of(12.0), CRAFT)
    assert "free-air curves at 1 of 1 vehicles" in note
    assert note.endswith("all waves are those of a free-air burst")
    assert burst_remarks(scene_of(0.0), CRAFT) == ()
    (note,) = burst_remarks(scene_of(12.0, "surface"), CRAFT)
    assert 'burst = "surface" contradicts the height' in note
    assert note.endswith("all waves are those of a surface burst")


def test_each_vehicle_of_a_batch_of_both_has_its_own_set():
    scenes = jax.vmap(scene_of)(jnp.array([0.2, 12.0]))
    (note,) = burst_remarks(scenes, CRAFT)
    assert "free-air burst at 1 of 2 vehicles, else of a surface burst" in note
    load = load_of(scenes, Options())
    assert isinstance(load, BlastLoad)
    waves = load.waves
    np.testing.assert_array_equal(waves.free_air[:, 0], [0.0, 1.0])
    # only the higher charge has an image, and none has one where no charge is high
    np.testing.assert_array_equal(waves.time_s[:, 1], [np.inf, 0.0])
    low = eqx.filter_vmap(scene_of)(jnp.array([0.1, 0.2]))
    load = load_of(low, Options())
    assert isinstance(load, BlastLoad)
    assert load.waves.time_s.shape == (2, 1)
