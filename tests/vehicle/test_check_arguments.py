"""Winds, loads and controllers for other vehicles than those that fly are refused."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jblast.errors import InputError
from jblast.scene import Charge, Scene
from jblast.vehicle import (
    Each,
    PositionHold,
    State,
    StepGust,
    blast_load,
    named,
    named_gains,
    simulate,
)
from tests.vehicle.flights import at_hover

CRAFT = named("hummingbird")
ALONE = at_hover(CRAFT)
FIVE = jax.tree.map(lambda x: jnp.broadcast_to(x, (5, *x.shape)), ALONE)


def gust(count: int) -> StepGust:
    return StepGust(np.ones((count, 3)), np.zeros(count))


def hold(count: int) -> PositionHold:
    """Holds of as many places, which share their gains."""
    return PositionHold(np.ones((count, 3)), named_gains("hummingbird"))


def load(count: int):
    def of(mass):
        return blast_load(Scene(charge=Charge(mass_kg=mass)))

    return jax.vmap(of)(jnp.ones(count))


WRONG = {
    "a wind for 3 of 5": (FIVE, {"wind": Each(gust(3))}, "wind: .*5,.*got .3, 3."),
    "loads for 3 of 5": (FIVE, {"loads": (Each(load(3)),)}, "loads: .*5,.*got .3"),
    "gains for all": (FIVE, {"control": Each(hold(5))}, "control: .*5,.*got .3,"),
    "winds for one": (ALONE, {"wind": Each(gust(5))}, "wind: expected a batch"),
    "winds not wrapped": (FIVE, {"wind": gust(5)}, "wind: .*wrapped in Each, got .5"),
    "loads not wrapped": (FIVE, {"loads": (load(5),)}, "loads: .*wrapped in Each"),
    "holds not wrapped": (FIVE, {"control": hold(5)}, "control: .*wrapped in Each"),
    "ground that is nan": (FIVE, {"ground_up_m": np.nan}, "ground_up_m: .*got nan"),
}


@pytest.mark.parametrize("backend", ["jax", "warp:cpu"])
@pytest.mark.parametrize(("state", "options", "said"), WRONG.values(), ids=WRONG)
def test_what_is_for_other_vehicles_is_refused(state, options, said, backend):
    with pytest.raises(InputError, match=said):
        simulate(CRAFT, state, duration_s=0.01, backend=backend, **options)


def test_a_batch_of_none_is_refused():
    none = State(*(x[:0] for x in jax.tree.leaves(FIVE)))
    with pytest.raises(InputError, match="expected one vehicle or more"):
        simulate(CRAFT, none, duration_s=0.01)
