"""Pressure, speed and arrival of a shock: smooth, scaled, and in batches."""

import jax.numpy as jnp

from jblast.waves.laws.shock_kinematics import shock_kinematics_valid
from tests.waves.laws.shock_kinematics.cases import (
    FIRST,
    both_bursts,
)


@both_bursts
def test_it_is_valid_from_the_first_row_to_ten_thousand(burst):
    first = FIRST[burst]
    z = jnp.array([0.99 * first, 1.01 * first, 40.0, 400.0, 9.9e3, 1.01e4])
    valid = shock_kinematics_valid(z, 1.0, burst=burst)
    assert valid.tolist() == [False, True, True, True, True, False]
