"""Bursts, laws and ends of the table, for the tests of shock kinematics."""

from functools import cache

import jax.numpy as jnp
import pytest

from jblast.waves.laws.shock_kinematics import (
    shock_kinematics_arrival_time,
    shock_kinematics_pressure,
    shock_kinematics_shock_speed,
)
from tests.tools.slopes import with_slopes

BURSTS = ("surface", "free-air")
FIRST = {"surface": 0.0674, "free-air": 0.0531}
LAWS = {
    "pressure": shock_kinematics_pressure,
    "shock_speed": shock_kinematics_shock_speed,
    "arrival_time": shock_kinematics_arrival_time,
}
both_bursts = pytest.mark.parametrize("burst", BURSTS)


@cache
def log_law(name, burst):
    """Give ln y of ln Z, at 1 kg in standard air, its slope and its curvature."""
    return with_slopes(
        lambda log_z: jnp.log(LAWS[name](jnp.exp(log_z), 1.0, burst=burst))
    )
