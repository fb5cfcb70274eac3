"""Steps of many independent lanes, which restart in the step after their end.

In any step few lanes are in a blast, and few restart. Both cost more than the step
itself, so both are computed in blocks of these lanes only. Results are those of `step`.
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
PUSHED_SHARE, BEGUN_SHARE, LEAST_BLOCK = 128, 256, 8
"""Block sizes: pairs of lane and blast over 128, lanes over 256, and at least 8.

About the shares of lanes in a blast and at a beginning in a step: larger blocks compute
empty rows, smaller ones need more iterations.
"""


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
    """Return the changed parts of the state of all lanes."""
    # On a CPU, XLA runs a program of small arrays sequentially in one thread, which is
    # fastest for many small loops, and a branch is a separate program. So the step is
    # taken in pieces of `CHUNK_BYTES` per number, each in a branch whose condition is
    # always true but unknown to XLA.
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
    # A sequential map: `vmap` over pieces would undo the small arrays.
    found = jax.lax.map(in_order, parts)
    return jax.tree.map(lambda x: x.reshape(-1, *x.shape[2:]), found)


def _pushed(states: EnvironmentState, params: EnvironmentParams) -> PyTree[Array]:
    """Return force and moment of the blasts, one row per lane."""
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
    """Apply a function to selected rows, in blocks, and store its results.

    Args:
        mask: Selected rows.
        function: Function of a row number.
        put: Function of the accumulated value, row numbers and results, which returns
            the next value. It has to drop row numbers beyond the end.
        start: Initial value.
        share: A block has a `share`-th of the rows, and at least `LEAST_BLOCK`.
    """
    # A loop over blocks with a data-dependent count: the cost follows the number of
    # selected rows, where a masked `vmap` would compute all rows.
    count = mask.shape[0]
    size = min(count, max(LEAST_BLOCK, count // share))
    # The n-th selected row is found by bisection of the cumulative count.
    so_far = jnp.cumsum(mask, dtype=jnp.int32)

    def more(carried: tuple[Array, T]) -> Array:
        return carried[0] < so_far[-1]

    def block(carried: tuple[Array, T]) -> tuple[Array, T]:
        done, found = carried
        ranks = done + jnp.arange(1, size + 1, dtype=jnp.int32)
        places = jnp.searchsorted(so_far, ranks, method="scan_unrolled")
        given = jax.vmap(function)(jnp.minimum(places, count - 1))
        # Padding of a block gets the largest integer, which stays beyond the end even
        # after a division by the number of blasts.
        past = jnp.where(places < count, places, jnp.iinfo(places.dtype).max)
        return done + size, put(found, past, given)

    return jax.lax.while_loop(more, block, (jnp.zeros((), jnp.int32), start))[1]
