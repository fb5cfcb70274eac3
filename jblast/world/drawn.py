r"""Worlds: scenes with sampled random blasts, from which all sensor records follow.

Samples are the same for one seed on every machine and in any batch. Blast $k$ of a
world has the key `fold_in(key, k)` of the counter-based threefry, so a sample depends
on seed and number only. More blasts leave mass and position of the first ones
unchanged. Times by rate or tick do not change either, as each is the last plus a
waiting time. For `count` blasts in a window of length $L$, no two closer than $g$, all
times are equally likely if

$$t_k = t_0 + u_k\,(L - (n - 1) g) + r_k g$$

with $u_k$ independent and uniform and $r_k$ the rank of $u_k$ among the $n$: the order
statistics on the window without its gaps, with the gaps added again. Without a gap,
times do not depend on the number of blasts. With a gap they must, because the
distribution of the first time depends on that number.
"""

import math
import os
from dataclasses import replace
from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Key, PRNGKeyArray

from jblast.errors import require, shown
from jblast.parameters import CHARGE_POSITION
from jblast.scene import (
    Charge,
    Free,
    Scene,
    UncertainScene,
    draw_scene,
    quaternion_matrix,
    read_scene_or_world,
    read_world,
)
from jblast.scene.keys import MAX_BLASTS
from jblast.scene.random_blasts import (
    Box,
    ByCount,
    ByRate,
    Number,
    Ring,
    WorldSpec,
)
from jblast.scene.reader import check_fits
from jblast.scene.uncertain import Belief, Prior, Uniform, draw
from jblast.sensors import Track, record_laws
from jblast.vehicle import Trajectory

VEHICLE, CAMERA = "vehicle", "camera"
"""Names of the scene's vehicle and of its camera among the observers."""
SCENE_KEY, NOISE_KEY = 2**32 - 3, 2**32 - 4
"""Folded into a world's key; above all numbers of blasts, which count from 0."""
WORLD_KEY = 2**32 - 1
"""Folded into a seed; splits and lanes of the seed count from 0 and never reach it."""


def tracks_of(scene: Scene, flight: Trajectory) -> dict[str, Track]:
    """Return the paths of the vehicle and of the sensors and camera on it, by name.

    Paths are linear between the rows of the flight. No sensor is below the ground.

    Args:
        scene: The scene with the sensors.
        flight: Flight of the scene's vehicle, up to its loss.
    """
    time, place, turn = flight.time_s, flight.position_m, flight.quaternion
    found = {VEHICLE: Track(time, place)}
    for sensor in scene.sensors:
        if sensor.mount:
            rides = place + _turned(turn, sensor.offset_m)
            # An overturned vehicle on the ground has sensors below it: they are
            # clamped.
            found[sensor.name] = Track(time, rides.at[:, 2].max(0.0))
    if scene.camera is not None and scene.camera.mount:
        found[CAMERA] = Track(time, place + _turned(turn, scene.camera.position))
    return found


@jax.jit
def _turned(
    turn: Float[Array, "row 4"], offset_m: Float[Array, "3"]
) -> Float[Array, "row 3"]:
    """Return an offset along body axes in world axes, for each row."""
    return jax.vmap(lambda one: quaternion_matrix(one) @ offset_m)(turn)


def with_nevers(scene: Scene) -> Scene:
    """Return a scene padded with charges that never detonate, to a power of two.

    The added charges are like the first one, on the ground.

    Args:
        scene: The scene.
    """
    # A flight is compiled for a number of blasts: with padding, five blasts use the
    # program of eight.
    count = len(scene.charges)
    missing = 2 ** (count - 1).bit_length() - count
    east, north, _ = scene.charge.position_m
    place = east, north, jnp.zeros_like(east)
    # An infinite time gives no load, and the position on the ground no reflection.
    never = replace(
        scene.charge, time_s=jnp.full_like(east, jnp.inf), position_m=place, name=""
    )
    return replace(scene, charges=(*scene.charges, *(never,) * missing))


def scene_of_one_blast(uncertain: UncertainScene, world: WorldSpec) -> UncertainScene:
    """Return a scene for the fit of one of a world's blasts.

    The mass has the prior that it is sampled from, and so has the position in a box
    about the origin. For a ring this is the box around it, on the ground. About a
    vehicle the position is free. The time is free unless it is fixed or the world has a
    single blast: the prior of one time among several depends on the other times. Laws
    are those of the world unless the scene names others.

    Args:
        uncertain: The scene without random blasts.
        world: Distribution of the blasts.

    Raises:
        InputError: The scene has a charge in addition to the random ones.
    """
    scene, where = uncertain.scene, f"{uncertain.source or 'scene'}: [charge]"
    got = "one; a fit has one shot, so its priors would be ambiguous"
    expected = "none in a scene with [world] to fit with"
    require(scene.charge.never, where, expected, got)
    beliefs: dict[str, Belief] = {}
    if isinstance(world.region, Box):
        low, high = world.region.low, world.region.high
    else:
        high = world.region.outer * jnp.array([1.0, 1.0, 0.0])
        low = -high
    # The median of the prior, as for every uncertain number of a scene.
    place = 0.5 * (low + high)
    for axis, name in enumerate(CHARGE_POSITION):
        if world.about != "world" and (axis < 2 or isinstance(world.region, Box)):
            beliefs[name] = Free(positive=False)
        elif low[axis] < high[axis]:
            beliefs[name] = Uniform(low[axis], high[axis])
    mass, time = world.mass, world.time
    if isinstance(mass, Prior):
        beliefs["charge_mass_kg"] = mass
        mass = mass.constrain(jnp.zeros(()))
    # Only a single blast has an independent time; with gaps, times are order
    # statistics.
    independent = isinstance(world.occurrence, ByCount) and world.occurrence.count == 1
    if isinstance(time, Prior):
        beliefs["origin_time_s"] = time if independent else Free(positive=False)
        time = time.constrain(jnp.zeros(()))
    charge = Charge(mass, tuple(map(float, place)), time)
    laws = dict(scene.law) | record_laws(scene)
    scene = replace(scene, charges=(charge,), law=tuple(laws.items()))
    return replace(uncertain, scene=scene, beliefs={**uncertain.beliefs, **beliefs})


def read_run_scene(
    path: str | os.PathLike[str],
) -> tuple[UncertainScene, WorldSpec | None]:
    """Read a scene of a run: with [world], [charge] or both, or a mission.

    Raises:
        InputError: As in `read_scene_or_world`, or none of them is there.
    """
    uncertain, world = read_scene_or_world(path, needs_charge=False)
    vehicle = uncertain.scene.vehicle
    flies = vehicle is not None and vehicle.mission is not None
    if world is None and bool(uncertain.scene.charge.never) and not flies:
        read_world(path)  # names what is missing
    return uncertain, world


def scene_to_fit(path: str | os.PathLike[str]) -> UncertainScene:
    """Read a scene for fits; of a world of random blasts, the scene of one of them.

    Raises:
        InputError: As in `read_scene` and `scene_of_one_blast`.
    """
    uncertain, world = read_scene_or_world(path)
    return uncertain if world is None else scene_of_one_blast(uncertain, world)


class DrawnWorld(NamedTuple):
    """A sampled world.

    Attributes:
        scene: The scene; its charges have names and are sorted by time. A scene without
            charges has one that never detonates. Its laws are explicit, so that all
            sensors use the same ones.
        seed: Seed of all samples.
        source: File of the world.
    """

    scene: Scene
    seed: int
    source: str

    @property
    def charges(self) -> tuple[Charge, ...]:
        """Charges that detonate, sorted by time."""
        return tuple(charge for charge in self.scene.charges if not charge.never)

    @property
    def shots(self) -> tuple[str, ...]:
        """Names of the charges; a random blast has its number as name."""
        return tuple(charge.name for charge in self.charges)

    @property
    def noise_key(self) -> PRNGKeyArray:
        """Key of the errors of readings."""
        return jax.random.fold_in(world_key(self.seed), NOISE_KEY)


def draw_world(
    uncertain: UncertainScene,
    world: WorldSpec | None,
    seed: int = 0,
    *,
    until_s: float = math.inf,
) -> DrawnWorld:
    """Sample a world: its random blasts, and every number of the scene with a prior.

    Args:
        uncertain: The scene; its charge may be one that never detonates.
        world: Distribution of the blasts; None: only the charges of the scene.
        seed: Seed of all samples.
        until_s: End of the world [s].

    Raises:
        InputError: A number is free, the region refers to a missing vehicle, two
            observers have one name, or as in `draw_blasts`.

    Example:
        `draw_world(*jblast.scene.read_world("world.toml"), seed=1).shots`
    """
    source = uncertain.source or "scene"
    key = jax.random.fold_in(world_key(seed), SCENE_KEY)
    scene = draw_scene(key, uncertain)
    _check_names(scene, source)
    blasts: Blasts | tuple[()] = ()
    if world is not None:
        vehicle = scene.vehicle if world.about == "vehicle" else None
        there = world.about != "vehicle" or vehicle is not None
        expected = "a [vehicle] as centre of the region"
        require(there, f"{source}: [world] about", expected, "none")
        about = None if vehicle is None else vehicle.held
        blasts = draw_blasts(seed, world, about, until_s=until_s, source=source)
    charges = [
        replace(charge, name=charge.name or "charge")
        for charge in scene.charges
        if not charge.never
    ]
    drawn = zip(*blasts, strict=True)
    for number, (time, place, mass) in enumerate(drawn, start=1):
        name = str(number)
        free = name not in {charge.name for charge in charges}
        expected = "a name that no random blast has"
        require(free, f"{source}: [[charge]] name", expected, shown(name))
        charges.append(Charge(mass, tuple(place), time, name=name))
    # Sorted, so that the order of rows in all files is that of the times.
    charges.sort(key=lambda charge: float(charge.time_s))
    charges = charges or [Charge(time_s=math.inf)]
    placed = all(charge.range_m is None for charge in charges)
    got = "range_m, which is the distance of a single sensor"
    require(placed, f"{source}: [charge] range_m", "position_m", got)
    scene = replace(scene, charges=tuple(charges))
    laws = dict(scene.law) | record_laws(scene)
    scene = replace(scene, law=tuple(laws.items()))
    return DrawnWorld(scene, seed, source)


def _check_names(scene: Scene, source: str) -> None:
    """Reject sensors named like the vehicle or the camera, or without a position."""
    others = {VEHICLE: scene.vehicle, CAMERA: scene.camera}
    for sensor in scene.sensors:
        where, name = f"{source}: [[sensor]]", sensor.name
        expected = f"another name than that of the scene's {name}"
        require(others.get(name) is None, f"{where} name", expected, shown(name))
        placed = sensor.mount or not np.isnan(sensor.position_m).any()
        expected = "[east, north, up], or a mount"
        require(placed, f"{where} {shown(name)} position_m", expected, "nothing")


class Blasts(NamedTuple):
    """Random blasts, by number.

    Attributes:
        time_s: Time of detonation, common clock [s]; infinite: it never happens.
        position_m: East, north, up [m].
        mass_kg: Mass of the charge [kg].
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
    """Sample the blasts of a world, in order of their numbers.

    Args:
        seed: Seed of the samples.
        world: Distribution of the blasts.
        about_m: Centre of the region: east, north, up [m]; None: the origin.
        until_s: Blasts by rate or tick end at this time [s].
        source: File of the world, for messages.

    Returns:
        The blasts that happen; by rate or tick there may be none.

    Raises:
        InputError: There are more than `MAX_BLASTS`, or they do not fit with the
            sampled gap.

    Example:
        `draw_blasts(0, jblast.scene.WorldSpec()).time_s`
    """
    key = world_key(seed)
    about = jnp.zeros(3) if about_m is None else about_m
    where = f"{source}: [world]"
    if isinstance(world.occurrence, ByCount):
        count = world.occurrence.count
        if isinstance(world.time, Uniform):
            gap = float(_common_number(key, world.gap, 0))
            check_fits(count, *world.window, gap, f"{where} (seed {seed})")
        return _blasts(key, world, about, count)
    blasts = _blasts(key, world, about, MAX_BLASTS + 1)
    end = min(world.window[1], until_s)
    happen = int(np.sum(np.asarray(blasts.time_s) <= end))
    expected = f"at most {MAX_BLASTS:,} blasts"
    got = f"more until {end:g} s with seed {seed}"
    require(happen <= MAX_BLASTS, where, expected, got)
    return Blasts(*(numbers[:happen] for numbers in blasts))


def world_key(seed: int) -> PRNGKeyArray:
    """Return the key of a world, which differs from all keys of its sensors' noise."""
    return jax.random.fold_in(jax.random.key(seed, impl="threefry2x32"), WORLD_KEY)


def blast_sequence(
    key: PRNGKeyArray, world: WorldSpec, about_m: Float[Array, "3"], count: int
) -> Blasts:
    """Return the first blasts of a world; a pure function, for jit and vmap over keys.

    Args:
        key: Key of the world, a threefry key.
        world: Distribution of the blasts.
        about_m: Centre of the region: east, north, up [m].
        count: Number of blasts; for `ByCount` its count. By rate or tick they continue
            beyond the end of the window.
    """
    # A key per blast: the samples of one blast do not depend on the number of others.
    numbers = jnp.arange(count)
    keys = jax.vmap(lambda n: jax.random.split(jax.random.fold_in(key, n), 3))(numbers)
    position = jax.vmap(lambda k: _place(k, world.region, about_m))(keys[:, 1])
    mass = jax.vmap(lambda k: _drawn(k, world.mass))(keys[:, 2])
    return Blasts(_times(key, keys[:, 0], world), position, mass)


_blasts = eqx.filter_jit(blast_sequence)


def _common_number(key: PRNGKeyArray, number: Number, which: int) -> Float[Array, ""]:
    """Return a number that all blasts of a world share."""
    # These keys count down from the largest number, so they never equal a blast's.
    return _drawn(jax.random.fold_in(key, 2**32 - 1 - which), number)


def _drawn(key: PRNGKeyArray, number: Number) -> Float[Array, ""]:
    return draw(key, number) if isinstance(number, Prior) else number


def _place(
    key: PRNGKeyArray, region: Box | Ring, about_m: Float[Array, "3"]
) -> Float[Array, "3"]:
    """Sample a position, uniform over the region; those of a ring are on the ground."""
    if isinstance(region, Box):
        share = jax.random.uniform(key, (3,))
        return about_m + region.low + share * (region.high - region.low)
    share, turn = jax.random.uniform(key, (2,))
    # The squared radius is uniform, so that the density per area is.
    inner, outer = jnp.square(region.inner), jnp.square(region.outer)
    radius = jnp.sqrt(inner + share * (outer - inner))
    angle = 2.0 * math.pi * turn
    east, north = radius * jnp.cos(angle), radius * jnp.sin(angle)
    return jnp.stack([about_m[0] + east, about_m[1] + north, 0.0 * radius])


def _times(
    key: PRNGKeyArray, keys: Key[Array, " blast"], world: WorldSpec
) -> Float[Array, " blast"]:
    """Sample the times of blasts, each from its own key."""
    gap = _common_number(key, world.gap, 0)
    how, time = world.occurrence, world.time
    if isinstance(how, ByCount):
        if not isinstance(time, Uniform):
            return jax.vmap(lambda k: _drawn(k, time))(keys)
        share = jax.vmap(jax.random.uniform)(keys)
        # The window without the gaps; see the module's docstring.
        free = (time.hi - time.lo) - (share.size - 1) * gap
        order = jnp.argsort(share)
        # The inverse permutation: each blast gets the time of its own rank, so that its
        # time stays paired with its mass and position.
        rank = jnp.argsort(order)
        first = time.lo + share[order] * jnp.maximum(free, 0.0)
        return (first + jnp.arange(share.size, dtype=float) * gap)[rank]
    assert isinstance(time, Uniform), "[world] by rate or tick has a window"
    numbers = jnp.arange(keys.shape[0], dtype=float)
    if isinstance(how, ByRate):
        mean = 1.0 / _common_number(key, how.rate, 1)
        wait = mean * jax.vmap(jax.random.exponential)(keys)
        return time.lo + jnp.cumsum(wait) + gap * numbers
    # Ticks by geometric waiting times: the inverse transform of the distribution;
    # probability 1 gives a wait of one tick. A share of zero would have an infinite
    # logarithm.
    tiny = jnp.finfo(float).tiny
    share = jax.vmap(lambda k: jax.random.uniform(k, minval=tiny))(keys)
    failed = math.log1p(-how.probability) if how.probability < 1.0 else -math.inf
    wait = 1.0 + jnp.floor(jnp.log(share) / failed)
    # Rounding must not turn a gap of whole ticks into one more tick.
    blind = jnp.maximum(jnp.ceil(gap / how.tick * (1.0 - 1e-12)), 1.0) - 1.0
    return time.lo + (jnp.cumsum(wait) + blind * numbers - 1.0) * how.tick
