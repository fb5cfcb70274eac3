"""Steps of many independent lanes, which restart in the step after their end.

In any step few lanes are in a blast, and few restart. Both cost more than the step
itself, so both are computed in blocks of these lanes only. Results are those of `step`.
"""

from collections.abc import Callable
from typing import Any, TypeVar

import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float, Key, PRNGKeyArray, PyTree

from jblast.environments.core import Step, begin, moved, reset
from jblast.environments.episode import (
    EnvironmentParams,
    EnvironmentState,
    one_wave,
    vehicle_in,
)
from jblast.errors import require
from jblast.vehicle import BlastLoad, State, Vehicle
from jblast.vehicle.dynamics import Wrench
from jblast.vehicle.rollout import CHUNK_BYTES, over_devices, tick_of
from jblast.vehicle.state import joined, three

T = TypeVar("T")
SHARES = {"tested": 48, "pushed": 128, "begun": 256}
"""Block sizes: rows over this number, and at least `LEAST_BLOCK`.

About the shares of pairs of lane and wave that are tested and that push in a step, and
of lanes that begin: larger blocks compute empty rows, smaller ones need more
iterations.
"""
LEAST_BLOCK = 8


def in_chunks(
    function: Callable[[PyTree[Array]], T],
    lanes: PyTree[Array],
    chunk: int,
    devices: int,
) -> T:
    """Map a function of a chunk of lanes over all lanes.

    Args:
        function: Function of arrays with the lanes of a chunk along the first axis,
            which it keeps.
        lanes: Arrays of all lanes.
        chunk: Lanes per chunk.
        devices: Number of devices.

    Raises:
        InputError: The number of lanes is not a multiple of chunks and devices.
    """
    count = jax.tree.leaves(lanes)[0].shape[0]
    whole = count > 0 and count % (chunk * devices) == 0
    words = f"a multiple of {chunk} times {devices} devices"
    require(whole, "lanes", words, f"{count:,}")
    parts = jax.tree.map(lambda x: x.reshape(-1, chunk, *x.shape[1:]), lanes)

    def here(parts: PyTree[Array]) -> PyTree[Array]:
        return jax.lax.map(function, parts)

    found = over_devices(here, parts, devices)
    return jax.tree.map(lambda x: x.reshape(-1, *x.shape[2:]), found)


def lane_keys(key: PRNGKeyArray, lanes: Array) -> Key[Array, " lane"]:
    """Return the keys of lanes: the seed's key with the lanes' numbers folded in."""
    return jax.vmap(jax.random.fold_in, (None, 0))(key, lanes)


def reset_lanes(
    key: PRNGKeyArray, lanes: Array, params: EnvironmentParams
) -> tuple[EnvironmentState, Float[Array, "lane seen"]]:
    """Begin the first episodes of lanes.

    Args:
        key: Key of the seed.
        lanes: Numbers of the lanes.
        params: Parameters of the environment.
    """
    return jax.vmap(reset, (0, None))(lane_keys(key, lanes), params)


def step_lanes(
    states: EnvironmentState,
    actions: Float[Array, "lane action"],
    params: EnvironmentParams,
) -> Step:
    """Take a step of every lane; ended lanes begin their next episode instead.

    This is Gymnasium's `NEXT_STEP`: the observation at the end of an episode is
    returned unchanged; the action after it is ignored and has no reward.

    Args:
        states: States of the lanes, one row each.
        actions: Actions, one row per lane.
        params: Parameters of the environment.
    """
    fresh = states.ended
    found = _moved(_pushed(states, params), actions, params)
    state, seen = for_some(
        fresh,
        "begun",
        lambda lane: begin(
            states.episode.key[lane], states.episode.number[lane] + 1, params
        ),
        (found.state, found.observation),
    )
    results = jax.tree.map(
        lambda x: jnp.where(fresh, jnp.zeros_like(x), x), tuple(found[2:])
    )
    return Step(state, seen, *results)


def _moved(
    states: EnvironmentState,
    actions: Float[Array, "lane action"],
    params: EnvironmentParams,
) -> Step:
    """Take a step of all lanes with given force and moment of the blasts."""
    # On a CPU, XLA runs a program of small arrays sequentially in one thread, which is
    # fastest for many small loops, and a branch is a separate program. So the step is
    # taken in pieces of `CHUNK_BYTES` per number, each in a branch whose condition is
    # always true but unknown to XLA.
    given = (states, tuple(actions.T))
    lanes, number = actions.shape[0], states.farthest_m
    piece = CHUNK_BYTES // number.dtype.itemsize

    def take(given: PyTree[Array]) -> PyTree[Array]:
        state, action = given
        found = jax.vmap(moved, (0, 0, None))(state, action, params)
        # The constant part of the state is not copied.
        nothing: Any = ()
        return found._replace(state=found.state._replace(episode=nothing))

    def in_order(given: PyTree[Array]) -> PyTree[Array]:
        shapes = jax.eval_shape(take, given)
        none = jax.tree.map(lambda x: jnp.zeros(x.shape, x.dtype), shapes)
        always = jnp.all(given[0].episode.number >= 0)
        return jax.lax.cond(always, lambda: take(given), lambda: none)

    if jax.default_backend() != "cpu" or (lanes > piece and lanes % piece):
        found = take(given)
    elif lanes <= piece:
        found = in_order(given)
    else:
        parts = jax.tree.map(lambda x: x.reshape(-1, piece, *x.shape[1:]), given)
        # A sequential map: `vmap` over pieces would undo the small arrays.
        found = jax.lax.map(in_order, parts)
        found = jax.tree.map(lambda x: x.reshape(-1, *x.shape[2:]), found)
    return found._replace(
        state=found.state._replace(episode=states.episode),
        observation=jnp.stack(found.observation, axis=-1),
    )


def _pushed(states: EnvironmentState, params: EnvironmentParams) -> EnvironmentState:
    """Return the states with force and moment of the blasts in their next step."""
    now, lanes = states.now, states.ended.shape[0]
    tick = jax.vmap(tick_of, (0, None))(states.steps, params.step_s)
    start_s, end_s = tick.start, tick.start + tick.length

    def pulse(pair: Array) -> tuple[BlastLoad, Array, State, Vehicle]:
        wave, lane = pair // lanes, pair % lanes
        state = jax.tree.map(lambda x: x[lane], states)
        load, motion = one_wave(state.episode.load, wave), joined(state.now.motion)
        return load, lane, motion, vehicle_in(params, state.episode)

    def until(pair: Array) -> Array:
        load, lane, motion, vehicle = pulse(pair)
        return load.quiet_until(start_s[lane], motion, vehicle)

    def push(pair: Array) -> Wrench:
        load, lane, motion, vehicle = pulse(pair)
        force, moment = load.impulse(start_s[lane], end_s[lane], motion, vehicle)
        return three(force / params.step_s), three(moment / params.step_s)

    quiet_s = jnp.concatenate(now.inactive_until_s)
    waves = len(now.inactive_until_s)
    flies = jnp.tile(~states.ended, waves)
    ends_s = jnp.tile(end_s, waves)
    # The negations also hold for NaN.
    due = flies & ~(ends_s <= quiet_s)
    # The bounds only select the loads to evaluate: their gradient is no physics.
    quiet_s = jax.lax.stop_gradient(for_some(due, "tested", until, quiet_s))
    acts = due & ~(ends_s <= quiet_s)
    zero = jnp.zeros_like(quiet_s)
    none = ((zero, zero, zero), (zero, zero, zero))
    wrench = jax.tree.map(
        lambda x: x.reshape(waves, -1).sum(axis=0), for_some(acts, "pushed", push, none)
    )
    inactive_until_s = tuple(quiet_s.reshape(waves, -1))
    return states._replace(
        now=now._replace(impulse_wrench=wrench, inactive_until_s=inactive_until_s)
    )


def for_some(
    mask: Bool[Array, " row"], what: str, function: Callable[[Array], T], start: T
) -> T:
    """Return values of all rows, computed in blocks for selected ones.

    Args:
        mask: Selected rows.
        what: Name in `SHARES`.
        function: Function of a row's number.
        start: Values of the remaining rows.
    """
    # A loop over blocks with a data-dependent count: the cost follows the number of
    # selected rows, where a masked `vmap` would compute all.
    count = mask.shape[0]
    size = min(count, max(LEAST_BLOCK, count // SHARES[what]))
    # The n-th selected row is found by bisection of the cumulative count.
    so_far = jnp.cumsum(mask, dtype=jnp.int32)

    def more(carried: tuple[Array, T]) -> Array:
        return carried[0] < so_far[-1]

    def block(carried: tuple[Array, T]) -> tuple[Array, T]:
        done, found = carried
        ranks = done + jnp.arange(1, size + 1, dtype=jnp.int32)
        rows = jnp.searchsorted(so_far, ranks, method="scan_unrolled")
        some = jax.vmap(function)(jnp.minimum(rows, count - 1))
        # Padding of a block is beyond the end and dropped.
        found = jax.tree.map(
            lambda x, new: x.at[rows].set(new, mode="drop"), found, some
        )
        return done + size, found

    return jax.lax.while_loop(more, block, (jnp.zeros((), jnp.int32), start))[1]
