r"""Blasts drawn at random: the same for one seed on every machine, in any batch.

Number $k$ of a world has a key of its own, `fold_in(key, k)` of the counter-based
threefry, so a draw depends on nothing but seed and number: more blasts leave mass and
place of the first ones as they are. Times by rate or tick stay as well, each being the
last plus a wait. Of `count` blasts in a window of length $L$, no two closer than $g$,
all times are equally likely just if

$$t_k = t_0 + u_k\,(L - (n - 1) g) + r_k g$$

with $u_k$ independent and uniform and $r_k$ the rank of $u_k$ among the $n$: the order
statistics on what the gaps leave of the window, the gaps put back. So without a gap
times stay, too; with one they move together as more blasts crowd the window, which no
scheme can avoid: the distribution of the first one's time depends on how many there
are.
"""

import math
from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Key, PRNGKeyArray

from jblast.errors import InputError
from jblast.scene.priors import Prior, Uniform, draw
from jblast.scene.random.spec import (
    Box,
    ByCount,
    ByRate,
    ByTick,
    Number,
    Ring,
    WorldSpec,
)
from jblast.scene.reader.world import MOST_BLASTS, check_fits

FIRST_TRY = 16
"""Blasts drawn at first where their number is left to chance."""


OF_WORLDS = 2**32 - 1
"""Folded into a seed; splits and lanes of it, which count from 0, never come there."""


class Blasts(NamedTuple):
    """Random blasts, by number.

    Attributes:
        time_s: On the common clock [s]; infinite: it never happens.
        position_m: East, north, up [m].
        mass_kg: Of the charge [kg].
    """

    time_s: Float[Array, " blast"]
    position_m: Float[Array, "blast 3"]
    mass_kg: Float[Array, " blast"]


def draw_blasts(
    seed: int,
    world: WorldSpec,
    about_m: Float[Array, "3"] | None = None,
    *,
    until_s: float = math.inf,
    source: str = "scene",
) -> Blasts:
    """Draw the blasts of a world, in order of their numbers.

    Args:
        seed: Of the draws.
        world: What they are drawn by.
        about_m: What the region is about: east, north, up [m]; None: the origin.
        until_s: Blasts by rate or tick after this are not drawn [s].
        source: Where the world was read from, for the messages.

    Returns:
        Those that happen; perhaps none, where chance decides how many.

    Raises:
        InputError: There are more than `MOST_BLASTS`, or a gap was drawn at which they
            do not fit.

    Example:
        `draw_blasts(0, jblast.scene.WorldSpec()).time_s`
    """
    key = world_key(seed)
    about = jnp.zeros(3) if about_m is None else about_m
    where = f"{source}: [world]"
    if isinstance(world.occurrence, ByCount):
        count = world.occurrence.count
        if isinstance(world.time, Uniform):
            gap = float(_of_world(key, world.gap, 0))
            check_fits(count, *world.window, gap, f"{where} (seed {seed})")
        return _blasts(key, world, about, count)
    count, end = FIRST_TRY, min(world.window[1], until_s)
    while True:
        blasts = _blasts(key, world, about, count)
        times = np.asarray(blasts.time_s)
        if times[-1] > end:
            happen = int(np.sum(times <= end))
            return Blasts(*(numbers[:happen] for numbers in blasts))
        if count > MOST_BLASTS:
            raise InputError(
                f"{where}: expected at most {MOST_BLASTS:,} blasts, got more until "
                f"{end:g} s with seed {seed}"
            )
        count *= 2


def world_key(seed: int) -> PRNGKeyArray:
    """Return the key of a world: none that noise of its sensors is drawn from."""
    return jax.random.fold_in(jax.random.key(seed, impl="threefry2x32"), OF_WORLDS)


def blast_sequence(
    key: PRNGKeyArray, world: WorldSpec, about_m: Float[Array, "3"], count: int
) -> Blasts:
    """Return the first blasts of a world. Pure: for jit and vmap over keys.

    Args:
        key: Of the world, a threefry key.
        world: What they are drawn by.
        about_m: What the region is about: east, north, up [m].
        count: How many; of `ByCount` as many as it says. By rate or tick they go on
            past the end of the window.
    """
    numbers = jnp.arange(count)
    keys = jax.vmap(lambda n: jax.random.split(jax.random.fold_in(key, n), 3))(numbers)
    position = jax.vmap(lambda k: _place(k, world.region, about_m))(keys[:, 1])
    mass = jax.vmap(lambda k: _drawn(k, world.mass))(keys[:, 2])
    return Blasts(_times(key, keys[:, 0], world), position, mass)


_blasts = eqx.filter_jit(blast_sequence)


def _of_world(key: PRNGKeyArray, number: Number, which: int) -> Float[Array, ""]:
    """Return a number that a whole world has in common.

    Its keys count from the other end, so that none is one of a blast's.
    """
    return _drawn(jax.random.fold_in(key, 2**32 - 1 - which), number)


def _drawn(key: PRNGKeyArray, number: Number) -> Float[Array, ""]:
    return draw(key, number) if isinstance(number, Prior) else number


def _place(
    key: PRNGKeyArray, region: Box | Ring, about_m: Float[Array, "3"]
) -> Float[Array, "3"]:
    """Draw a place, uniform over the region; that of a ring is on the ground."""
    if isinstance(region, Box):
        share = jax.random.uniform(key, (3,))
        return about_m + region.low + share * (region.high - region.low)
    share, turn = jax.random.uniform(key, (2,))
    inner, outer = jnp.square(region.inner), jnp.square(region.outer)
    radius = jnp.sqrt(inner + share * (outer - inner))
    angle = 2.0 * math.pi * turn
    east, north = radius * jnp.cos(angle), radius * jnp.sin(angle)
    return jnp.stack([about_m[0] + east, about_m[1] + north, 0.0 * radius])


def _times(
    key: PRNGKeyArray, keys: Key[Array, " blast"], world: WorldSpec
) -> Float[Array, " blast"]:
    """Draw the times of blasts, each from a key of its own."""
    gap = _of_world(key, world.gap, 0)
    how, time = world.occurrence, world.time
    if isinstance(how, ByCount):
        if not isinstance(time, Uniform):
            return jax.vmap(lambda k: _drawn(k, time))(keys)
        share = jax.vmap(jax.random.uniform)(keys)
        free = (time.hi - time.lo) - (share.size - 1) * gap
        order = jnp.argsort(share)
        rank = jnp.argsort(order)
        first = time.lo + share[order] * jnp.maximum(free, 0.0)
        return _apart(first + jnp.arange(share.size, dtype=float) * gap, gap)[rank]
    assert isinstance(time, Uniform), "the reader of [world] asks for it"
    if isinstance(how, ByRate):
        mean = 1.0 / _of_world(key, how.rate, 1)
        wait = mean * jax.vmap(jax.random.exponential)(keys)
        rising = time.lo + jnp.cumsum(wait) + gap * jnp.arange(wait.size, dtype=float)
        return _apart(rising, gap)
    return _ticks(keys, how, time.lo, gap)


def _ticks(
    keys: Key[Array, " blast"],
    how: ByTick,
    start: Float[Array, ""],
    gap: Float[Array, ""],
) -> Float[Array, " blast"]:
    """Draw at which ticks there is a blast: waits are geometric."""
    tiny = jnp.finfo(float).tiny
    share = jax.vmap(lambda k: jax.random.uniform(k, minval=tiny))(keys)
    failed = math.log1p(-how.probability) if how.probability < 1.0 else -math.inf
    wait = 1.0 + jnp.floor(jnp.log(share) / failed)
    # a gap of whole ticks is not made longer by a rounding
    blind = jnp.maximum(jnp.ceil(gap / how.tick * (1.0 - 1e-12)), 1.0) - 1.0
    number = jnp.cumsum(wait) + blind * jnp.arange(wait.size, dtype=float) - 1.0
    return start + number * how.tick


def _apart(
    times: Float[Array, " blast"], gap: Float[Array, ""]
) -> Float[Array, " blast"]:
    """Return rising times, none nearer to the last than the gap by a rounding."""

    def later(last: Array, time: Array) -> tuple[Array, Array]:
        time = jnp.maximum(time, last + gap)
        return time, time

    return jax.lax.scan(later, -jnp.inf * jnp.ones_like(times[0]), times)[1]
