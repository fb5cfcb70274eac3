"""A short mission flown by a vehicle, wind and all, from the ground to the ground."""

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jblast.missions import Mission, MissionControl, replay
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
def test_it_takes_off_flies_and_stands_where_it_landed():
    one = mission(*ROWS)
    control = control_of(one, "iris")
    flight = flown(control)
    aim, item, armed = map(
        np.asarray, replay(control.guidance, flight, jnp.asarray(STEP))
    )
    assert armed.any()
    assert not armed[-1]
    assert (np.diff(item[item >= 0]) >= 0).all()
    assert not bool(flight.lost)
    place = np.asarray(flight.position_m)
    # it has not stirred before it flies, and its rotors stand at the end
    assert np.abs(place[: np.argmax(item >= 0)]).max() < 1e-6
    assert np.abs(flight.rotor_speed_rad_s[-1]).max() < 1.0
    np.testing.assert_allclose(place[-1], (0, 0, 0), atol=0.05)
    error = np.linalg.norm(place - aim, axis=1)
    assert error[item >= 0].max() < 0.5
    for stop in one.stops[:3]:
        off = np.linalg.norm(place - stop.goal_m, axis=1).min()
        assert off < stop.limits.acceptance_m


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
