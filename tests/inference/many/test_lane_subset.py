import jax.numpy as jnp
import numpy as np

from jblast.inference.many.lane_subset import LEAST, lanes_where, picked, put


def test_lanes_are_filled_up_by_the_last_to_a_power_of_two():
    wanted = np.zeros(100, bool)
    wanted[[3, 50]] = True
    found = lanes_where(jnp.asarray(wanted))
    assert found.size == LEAST
    np.testing.assert_array_equal(np.unique(found), [3, 50])
    assert lanes_where(jnp.ones(33, bool)).size == 64
    assert lanes_where(jnp.zeros(5, bool)).size == 0


def test_lanes_put_back_where_they_were_taken_change_nothing_else():
    tree = {"a": jnp.arange(6.0), "b": jnp.arange(12.0).reshape(2, 6)}
    lanes = np.array([1, 4, 4])
    some = picked(tree, lanes)
    np.testing.assert_array_equal(some["b"], tree["b"][:, lanes])
    changed = put(tree, {"a": some["a"] + 10, "b": some["b"]}, lanes)
    np.testing.assert_array_equal(changed["a"], [0.0, 11.0, 2.0, 3.0, 14.0, 5.0])
    np.testing.assert_array_equal(changed["b"], tree["b"])
