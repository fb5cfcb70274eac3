"""A wrong shape says which argument, what was expected, and what came."""

from typing import Any

import equinox as eqx
import jax.numpy as jnp
import numpy as np
import pytest

import jblast
from jblast.errors import InputError
from jblast.scene import Charge, Scene, Sensor, UncertainScene
from jblast.sensors import planned_layout

ARRIVAL = {"air_arrival_s": "wu_hao"}
SENSOR = Sensor("a", (20.0, 0.0, 0.0), records=(("air_arrival_s", 1e-3),))
SCENE = Scene(
    Charge(15.0, burst="surface"), sensors=(SENSOR,), law=tuple(ARRIVAL.items())
)
LAYOUT = planned_layout(SCENE)[0]


def with_leaf(where, leaf, of: Any = SCENE):
    return eqx.tree_at(where, of, leaf, is_leaf=lambda x: x is None)


BATCHES = {
    "mass": (
        with_leaf(lambda s: s.charge.mass_kg, jnp.ones(3)),
        r"scene.charge.mass_kg: expected shape \(\), got \(3,\).*jax.vmap",
    ),
    "clock": (
        with_leaf(lambda s: s.sensors[0].clock_offset_s, jnp.ones(5)),
        r"scene.clock_offset_s of a: expected shape \(\), got \(5,\)",
    ),
    "sensor": (
        with_leaf(lambda s: s.sensors[0].position_m, jnp.ones((7, 3))),
        r"sensor a: position_m: expected shape \(3,\), got \(7, 3\)",
    ),
}


@pytest.mark.parametrize(("scene", "said"), BATCHES.values(), ids=BATCHES)
def test_a_batch_that_is_not_mapped_is_refused_by_name(scene, said):
    with pytest.raises(InputError, match=said):
        jblast.record(scene, LAYOUT, ARRIVAL)
    with pytest.raises(InputError, match=said):
        jblast.simulate(UncertainScene(scene))
    with pytest.raises(InputError, match=said):
        jblast.bound(UncertainScene(scene))


def test_what_a_bound_is_asked_at_is_a_number():
    with pytest.raises(
        InputError, match=r"at\['charge_mass_kg'\]: expected shape \(\)"
    ):
        jblast.bound(UncertainScene(SCENE), {"charge_mass_kg": np.ones(2)})  # type: ignore  # what is refused
