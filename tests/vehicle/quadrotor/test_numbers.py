"""Numbers of a vehicle, in one precision."""

import jax.numpy as jnp
import numpy as np

from jblast.vehicle.quadrotor import in_precision


def test_numbers_of_any_origin_fly_by_one_program():
    # of a float of Python's, of NumPy, of an array: types that a program tells apart
    given = [jnp.asarray(0.5), np.array([0.5]), jnp.array([0.5], jnp.float32), 7]
    found = in_precision(given, np.dtype(np.float64))
    assert [x.dtype for x in found[:3]] == [np.float64] * 3
    assert not found[0].weak_type
    assert found[1] is given[1]
    assert found[3] == 7
