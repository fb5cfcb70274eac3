"""Many lanes together; each is independent, and restarts with the step after its end.

In any step few lanes are in a blast, and few restart. Both cost more than the step
itself, so both are computed for blocks of these lanes alone, as many blocks as needed.
Each lane has the same result as by `step`.
"""

from collections.abc import Callable
from typing import TypeVar

import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float, Key, PRNGKeyArray, PyTree

from jblast.environments.core import (
    Moved,
    Step,
    begin,
    in_blast,
    moved,
    pushed_by,
    reset,
    step_of,
)
from jblast.environments.episode import EnvironmentParams, EnvironmentState
from jblast.errors import InputError
from jblast.vehicle.dynamics import Wrench
from jblast.vehicle.rollout import CHUNK_BYTES, over_devices

T = TypeVar("T")
CHUNK = 1024
"""Lanes that a processor takes through all their steps before it takes the next: the
state of more does not stay in its cache, of fewer a block of those in a blast or at a
beginning is mostly empty."""
PUSHED_SHARE, BEGUN_SHARE, LEAST_BLOCK = 128, 256, 8
"""A block holds one in so many pairs of lane and blast, one in so many lanes that
begin, and so many at least."""


def in_chunks(
    function: Callable[[PyTree[Array]], T],
    lanes: PyTree[Array],
    chunk: int,
    devices: int,
) -> T:
    """Return what a function of a chunk of lanes gives for all of them.

    Args:
        function: Of arrays whose first axis are the lanes of a chunk; so are those that
            it returns.
        lanes: Of all.
        chunk: Lanes of a chunk.
        devices: Among how many chunks are shared.

    Raises:
        InputError: Lanes do not go up in chunks, or chunks in devices.
    """
    count = jax.tree.leaves(lanes)[0].shape[0]
    if count < 1 or count % (chunk * devices):
        raise InputError(
            f"lanes: expected a multiple of {chunk} times {devices} devices, got "
            f"{count:,}"
        )
    parts = jax.tree.map(lambda x: x.reshape(-1, chunk, *x.shape[1:]), lanes)

    def here(parts: PyTree[Array]) -> PyTree[Array]:
        return jax.lax.map(function, parts)

    found = over_devices(here, parts, devices)
    return jax.tree.map(lambda x: x.reshape(-1, *x.shape[2:]), found)


def lane_keys(key: PRNGKeyArray, lanes: Array) -> Key[Array, " lane"]:
    """Return the keys of lanes, each its number folded into the seed's key."""
    return jax.vmap(jax.random.fold_in, (None, 0))(key, lanes)


def reset_lanes(
    key: PRNGKeyArray, lanes: Array, params: EnvironmentParams
) -> tuple[EnvironmentState, Float[Array, "lane seen"]]:
    """Begin the first episodes of lanes.

    Args:
        key: Of the seed.
        lanes: Their numbers.
        params: Of the environment.
    """
    return jax.vmap(reset, (0, None))(lane_keys(key, lanes), params)


def step_lanes(
    states: EnvironmentState,
    actions: Float[Array, "lane action"],
    params: EnvironmentParams,
) -> Step:
    """Take a step of every lane; those that ended begin their next episode instead.

    That is Gymnasium's `NEXT_STEP`: the observation at the end of an episode is
    returned as such, the action after it is not looked at, and earns nothing.

    Args:
        states: Of the lanes, a row each.
        actions: Likewise.
        params: Of the environment.
    """
    wrench = _pushed(states, params)
    taken = step_of(states, _moved(states, actions, params, wrench))

    fresh = states.ended
    state, seen = for_some(
        fresh,
        lambda lane: begin(states.key[lane], states.number[lane] + 1, params),
        lambda all_, lanes, begun: jax.tree.map(
            lambda x, some: x.at[lanes].set(some, mode="drop"), all_, begun
        ),
        (taken.state, taken.observation),
        BEGUN_SHARE,
    )
    none = jnp.zeros_like(taken.reward)
    info = {
        name: jnp.where(fresh, jnp.zeros_like(value), value)
        for name, value in taken.info.items()
    }
    return Step(
        state,
        seen,
        jnp.where(fresh, none, taken.reward),
        taken.terminated & ~fresh,
        taken.truncated & ~fresh,
        info,
    )


def _moved(
    states: EnvironmentState,
    actions: Float[Array, "lane action"],
    params: EnvironmentParams,
    wrench: PyTree[Array],
) -> Moved:
    """Return what the step of all lanes changes.

    On a CPU XLA runs a program of small arrays alone in order, in one thread, which is
    what so many small loops want; a branch is a program of its own. So there the step
    is taken by pieces of so many lanes, in a branch that is always taken, by a
    condition that XLA cannot know.
    """
    given = (states, tuple(actions.T), wrench)
    lanes, number = actions.shape[0], states.farthest_m
    piece = CHUNK_BYTES // number.dtype.itemsize

    def take(given: PyTree[Array]) -> Moved:
        state, action, wrench = given
        return jax.vmap(moved, (0, 0, None, 0))(state, action, params, wrench)

    def in_order(given: PyTree[Array]) -> Moved:
        shapes = jax.eval_shape(take, given)
        none = jax.tree.map(lambda x: jnp.zeros(x.shape, x.dtype), shapes)
        always = jnp.all(given[0].number >= 0)
        return jax.lax.cond(always, lambda: take(given), lambda: none)

    if jax.default_backend() != "cpu":
        return take(given)
    if lanes <= piece:
        return in_order(given)
    if lanes % piece:
        return take(given)
    parts = jax.tree.map(lambda x: x.reshape(-1, piece, *x.shape[1:]), given)
    found = jax.lax.map(in_order, parts)
    return jax.tree.map(lambda x: x.reshape(-1, *x.shape[2:]), found)


def _pushed(states: EnvironmentState, params: EnvironmentParams) -> PyTree[Array]:
    """Return what the blasts give all lanes, a row each."""
    pushes = jax.vmap(in_blast, (0, None))(states, params) & ~states.ended[:, None]
    zero = jnp.zeros_like(states.farthest_m)

    def one(place: Array) -> Wrench:
        lane, blast = place // pushes.shape[1], place % pushes.shape[1]
        state = jax.tree.map(lambda x: x[lane], states)
        which = jax.tree.map(lambda x: x[blast], state.episode.blasts)
        return pushed_by(state, which, params)

    return for_some(
        pushes.ravel(),
        one,
        lambda total, places, given: jax.tree.map(
            lambda x, some: x.at[places // pushes.shape[1]].add(some, mode="drop"),
            total,
            given,
        ),
        ((zero, zero, zero), (zero, zero, zero)),
        PUSHED_SHARE,
    )


def for_some(
    mask: Bool[Array, " row"],
    function: Callable[[Array], PyTree],
    put: Callable[[T, Array, PyTree], T],
    start: T,
    share: int,
) -> T:
    """Return what is there with what a function gives for some rows put in.

    Args:
        mask: Which rows.
        function: Of the number of one row.
        put: Of what is there, the numbers of some rows and what the function gave.
            Numbers past the end are to be dropped.
        start: What is there before.
        share: One in so many rows makes a block, but `LEAST_BLOCK` at least.
    """
    count = mask.shape[0]
    size = min(count, max(LEAST_BLOCK, count // share))
    so_far = jnp.cumsum(mask, dtype=jnp.int32)

    def more(carried: tuple[Array, T]) -> Array:
        return carried[0] < so_far[-1]

    def block(carried: tuple[Array, T]) -> tuple[Array, T]:
        done, found = carried
        ranks = done + jnp.arange(1, size + 1, dtype=jnp.int32)
        places = jnp.searchsorted(so_far, ranks, method="scan_unrolled")
        given = jax.vmap(function)(jnp.minimum(places, count - 1))
        # those that fill up the block point past the end, whatever they are divided by
        past = jnp.where(places < count, places, jnp.iinfo(places.dtype).max)
        return done + size, put(found, past, given)

    return jax.lax.while_loop(more, block, (jnp.zeros((), jnp.int32), start))[1]
