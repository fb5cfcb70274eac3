import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from jblast.scene import Charge, Scene, VehicleSpec
from jblast.study.flight_results import with_bursts_at_start
from jblast.vehicle import blast_load

CRAFT = VehicleSpec(model="crazyflie", position=np.array([5.0, 0.0, 12.0]))


def flown(up, burst=None):
    return with_bursts_at_start(
        Scene(
            Charge(mass_kg=1.0, position_m=(0.0, 0.0, up), burst=burst),
            vehicle=CRAFT,
        ),
        CRAFT,
    )


def test_a_charge_high_up_is_flown_by_the_free_air_curves_and_said_so():
    scene, (note,) = flown(12.0)
    assert scene.charge.burst == "free-air"
    assert "free-air curves at 1 of 1 vehicles" in note
    assert flown(0.0)[0].charge.burst == "surface"
    assert flown(0.0)[1] == ()
    scene, (note,) = flown(12.0, "surface")
    assert scene.charge.burst == "surface"
    assert 'burst = "surface" contradicts the height' in note


def test_each_vehicle_of_a_batch_of_both_has_its_own_set():
    scenes = jax.vmap(
        lambda up: Scene(Charge(mass_kg=1.0, position_m=(0.0, 0.0, up)), vehicle=CRAFT)
    )(jnp.array([0.2, 12.0]))
    scenes, (note,) = with_bursts_at_start(scenes, CRAFT)
    assert scenes.charge.burst is None
    assert "free-air burst at 1 of 2 vehicles, else of a surface burst" in note
    waves = eqx.filter_vmap(blast_load)(scenes).waves
    np.testing.assert_array_equal(waves.free_air[:, 0], [0.0, 1.0])
    # only the higher charge has an image
    np.testing.assert_array_equal(waves.time_s[:, 1], [np.inf, 0.0])
