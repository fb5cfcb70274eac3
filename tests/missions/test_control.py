"""Short missions flown by a batch of vehicles, from the ground to the ground."""

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jblast.missions import Mission, MissionControl
from jblast.vehicle import (
    PositionHold,
    State,
    named,
    named_gains,
    simulate,
)
from tests.missions.missions import LAND, UP, mission

STEP, SECONDS = 0.002, 40.0
ROWS = (UP, (16, (6, 0, 6), {}), (16, (6, 5, 6), {"p1": 1.0}), LAND)


def control_of(one: Mission, model: str) -> MissionControl:
    return MissionControl(
        one.guidance, PositionHold(jnp.zeros(3), named_gains(model, integral=True))
    )


def standing(*batch: int) -> State:
    def none(size: int):
        return jnp.zeros((*batch, size))

    return State(none(3), none(3), none(4).at[..., 3].set(1.0), none(3), none(4))


def flown(control, model="iris", state=None, **options):
    return simulate(
        named(model),
        standing() if state is None else state,
        duration_s=SECONDS,
        step_s=STEP,
        control=control,
        ground_up_m=0.0,
        **options,
    )


@pytest.mark.slow
def test_a_batch_flies_plans_of_different_lengths_as_each_alone():
    many = [mission(*ROWS), mission(UP, LAND)]
    count = max(one.guidance.legs.count for one in many)
    alike = [
        dataclasses.replace(one.guidance, legs=one.guidance.legs.padded(count))
        for one in many
    ]

    guidance = jax.tree.map(lambda *x: jnp.stack(x), *alike)
    hold = control_of(many[0], "iris").hold
    holds = jax.tree.map(lambda x: jnp.stack([x, x]), hold)
    together = flown(
        MissionControl(guidance, holds), state=standing(2), store_every=500
    )
    for n, one in enumerate(many):
        alone = flown(control_of(one, "iris"), store_every=500)
        np.testing.assert_allclose(together.position_m[n], alone.position_m, atol=1e-6)
        # it stands where it landed, and its rotors stand
        np.testing.assert_allclose(alone.position_m[-1], (0, 0, 0), atol=0.05)
        assert np.abs(alone.rotor_speed_rad_s[-1]).max() < 1.0
