"""What rides on a vehicle that hovers stands where that holds, turned by its yaw."""

import jax.numpy as jnp
import numpy as np

from jblast.inference.design.planned_log import hovering
from jblast.scene import Charge, Scene, Sensor, VehicleSpec

NOWHERE = jnp.full(3, jnp.nan)
RIDER = Sensor("rider", NOWHERE, mount="vehicle", offset_m=(1.0, 2.0, 3.0))
STAYS = Sensor("stays", (7.0, 8.0, 9.0))


def test_forward_is_east_at_first_and_north_after_a_quarter_turn():
    for yaw, expected in ((0.0, [11.0, 22.0, 33.0]), (np.pi / 2, [8.0, 21.0, 33.0])):
        vehicle = VehicleSpec(
            "iris", jnp.zeros(3), jnp.array([10.0, 20.0, 30.0]), yaw=yaw
        )
        scene = Scene(Charge(1.0), vehicle=vehicle, sensors=(RIDER, STAYS))
        rider, stays = hovering(scene).sensors
        # to rounding of the cosine of a right angle
        np.testing.assert_allclose(rider.position_m, expected, atol=1e-12)
        np.testing.assert_array_equal(stays.position_m, STAYS.position_m)
