"""Values of one kind are computed together, and answered in their own order."""

import jax.numpy as jnp
import numpy as np

from jblast.vehicle.loads.blast import map_grouped


def test_answers_come_in_the_order_of_values_whatever_their_kind():
    calls = []

    def of(value):
        calls.append(None)
        return {"sum": jnp.sum(value["x"]) + value.get("more", 0.0)}

    values = [
        {"x": jnp.array([1.0, 2.0])},
        {"x": jnp.array([5.0]), "more": jnp.array(7.0)},
        {"x": jnp.array([3.0, 4.0])},
        {"x": jnp.array([6.0, 8.0])},
    ]
    found = [float(one["sum"]) for one in map_grouped(of, values)]
    np.testing.assert_array_equal(found, [3.0, 12.0, 7.0, 14.0])
    assert len(calls) == 2  # once a kind


def test_of_nothing_there_is_nothing():
    assert map_grouped(lambda value: value, []) == []
