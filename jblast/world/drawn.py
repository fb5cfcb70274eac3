r"""A scene with its random blasts drawn, from which the records of all sensors follow.

Draws are the same for one seed on every machine and in any batch. Blast $k$ of a world
has a key of its own, `fold_in(key, k)` of the counter-based threefry, so a draw depends
on seed and number alone: more blasts leave mass and place of the first ones unchanged.
Times by rate or tick stay as well, each being the last plus a wait. Of `count` blasts
in a window of length $L$, no two closer than $g$, all times are equally likely if

$$t_k = t_0 + u_k\,(L - (n - 1) g) + r_k g$$

with $u_k$ independent and uniform and $r_k$ the rank of $u_k$ among the $n$: the order
statistics on the window without its gaps, the gaps put back. Without a gap times do not
depend on the number of blasts; with one they do, as in any scheme: the distribution of
the first time depends on how many there are.
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

from jblast.errors import InputError, shown
from jblast.parameters import CHARGE_POSITION
from jblast.scene import (
    Charge,
    Free,
    Scene,
    UncertainScene,
    draw_scene,
    quaternion_matrix,
    read_scene_or_world,
)
from jblast.scene.random_blasts import (
    Box,
    ByCount,
    ByRate,
    ByTick,
    Number,
    Ring,
    WorldSpec,
)
from jblast.scene.reader.random_blasts import MOST_BLASTS, check_fits
from jblast.scene.uncertain import Belief, Prior, Uniform, draw
from jblast.sensors import Track, record_laws
from jblast.vehicle import Trajectory
from jblast.world.presets import Preset

VEHICLE, CAMERA = "vehicle", "camera"
"""What the scene's one vehicle and its camera are called among all who perceive."""
OF_SCENE, OF_NOISE = 2**32 - 3, 2**32 - 4
"""Folded into a world's key: past the numbers of blasts, which count from 0."""
FIRST_TRY = 16
"""Blasts drawn at first where their number is left to chance."""
OF_WORLDS = 2**32 - 1
"""Folded into a seed; splits and lanes of it, which count from 0, never come there."""


def tracks_of(scene: Scene, flight: Trajectory) -> dict[str, Track]:
    """Return where the vehicle, the sensors and the camera on it are, by name.

    Straight between the rows of the flight; of a vehicle that was lost, up to there.
    No sensor is below the ground.

    Args:
        scene: Has the sensors.
        flight: Of the scene's vehicle.
    """
    known = np.isfinite(np.asarray(flight.position_m)).all(axis=-1)
    time = jnp.asarray(flight.time_s)[known]
    place, turn = flight.position_m[known], flight.quaternion[known]
    found = {VEHICLE: Track(time, place)}
    for sensor in scene.sensors:
        if sensor.mount:
            rides = place + _turned(turn, sensor.offset_m)
            # of a vehicle that lies on its back, what was above it is on the ground
            found[sensor.name] = Track(time, rides.at[:, 2].max(0.0))
    if scene.camera is not None and scene.camera.mount:
        found[CAMERA] = Track(time, place + _turned(turn, scene.camera.position))
    return found


@jax.jit
def _turned(
    turn: Float[Array, "row 4"], offset_m: Float[Array, "3"]
) -> Float[Array, "row 3"]:
    """Return an offset in the axes of a body, in those of the world."""
    return jax.vmap(lambda one: quaternion_matrix(one) @ offset_m)(turn)


def with_nevers(scene: Scene) -> Scene:
    """Return a scene with charges that never happen, to a power of two of them.

    A flight is compiled for a number of blasts. So five blasts fly by the program of
    eight. The charges are like the first one, on the ground.

    Args:
        scene: What is there.
    """
    count = len(scene.charges)
    missing = 2 ** (count - 1).bit_length() - count
    east, north, _ = scene.charge.position_m
    place = east, north, jnp.zeros_like(east)
    never = replace(
        scene.charge, time_s=jnp.full_like(east, jnp.inf), position_m=place, name=""
    )
    return replace(scene, others=(*scene.others, *(never,) * missing))


def scene_of_one_blast(uncertain: UncertainScene, world: WorldSpec) -> UncertainScene:
    """Return a scene to fit one of a world's blasts in.

    Its mass has the prior that it was drawn by, and so has its place in a box about the
    origin. In a ring, or about a vehicle, place is free (of a ring, on the ground).
    Time is free, unless it is said or a prior without gaps: that of one among several
    depends on the others. Laws are those that the world is made by, unless the scene
    names others.

    Args:
        uncertain: The scene besides.
        world: What blasts are drawn by.

    Raises:
        InputError: The scene has a charge of its own beside the random ones.
    """
    scene = uncertain.scene
    if not bool(scene.charge.never):
        raise InputError(
            f"{uncertain.source or 'scene'}: [charge]: expected none beside [world] "
            "in a scene to fit with, which leaves open what is known of which shot; "
            "got one"
        )
    beliefs: dict[str, Belief] = {}
    region, place = world.region, [0.0, 0.0, 0.0]
    for axis, name in enumerate(CHARGE_POSITION):
        if isinstance(region, Box) and world.about == "world":
            low, high = region.low[axis], region.high[axis]
            place[axis] = float(0.5 * (low + high))
            if float(low) < float(high):
                beliefs[name] = Uniform(low, high)
        elif isinstance(region, Box) or axis < 2:
            beliefs[name] = Free(positive=False)
    mass, time = world.mass, world.time
    if isinstance(mass, Prior):
        beliefs["charge_mass_kg"] = mass
        mass = mass.constrain(jnp.zeros(()))
    independent = isinstance(world.occurrence, ByCount) and world.occurrence.count == 1
    if isinstance(time, Prior):
        beliefs["origin_time_s"] = time if independent else Free(positive=False)
        time = time.constrain(jnp.zeros(()))
    charge = Charge(mass, tuple(place), time)
    laws = dict(scene.law) | record_laws(scene, ground=True)
    scene = replace(scene, charge=charge, law=tuple(laws.items()))
    return replace(uncertain, scene=scene, beliefs={**uncertain.beliefs, **beliefs})


def scene_to_fit(path: str | os.PathLike[str]) -> UncertainScene:
    """Read a scene to fit logs in: of random blasts, that of any one of them.

    Raises:
        InputError: As in `read_scene` and `scene_of_one_blast`.
    """
    uncertain, world = read_scene_or_world(path)
    return uncertain if world is None else scene_of_one_blast(uncertain, world)


class DrawnWorld(NamedTuple):
    """A world that was drawn.

    Attributes:
        scene: What is there; its charges are named and come in order of time. Where
            there is none, one that never happens stands for it. Its laws are said, so
            that all senses go by the same ones.
        seed: Of all draws.
        source: Where the world was read from.
        preset: By which blasts act other than they do; None: by the scene's laws.
    """

    scene: Scene
    seed: int
    source: str
    preset: Preset | None = None

    def scene_of(self, kind: str) -> Scene:
        """Return the scene as a sense has it; one for all but in a preset.

        Args:
            kind: Of a sensor; "vehicle" or "camera".
        """
        if self.preset is None:
            return self.scene
        return self.preset.scene_of(self.scene, kind)

    @property
    def charges(self) -> tuple[Charge, ...]:
        """Those that happen, in order of time."""
        return tuple(charge for charge in self.scene.charges if not charge.never)

    @property
    def shots(self) -> tuple[str, ...]:
        """Their names: of a random one its number, as it was drawn."""
        return tuple(charge.name for charge in self.charges)

    @property
    def noise_key(self) -> PRNGKeyArray:
        """Of the errors of readings."""
        return jax.random.fold_in(world_key(self.seed), OF_NOISE)


def draw_world(
    uncertain: UncertainScene,
    world: WorldSpec | None,
    seed: int = 0,
    *,
    until_s: float = math.inf,
    preset: Preset | None = None,
) -> DrawnWorld:
    """Draw a world: its random blasts, and every number of the scene with a prior.

    Args:
        uncertain: The scene besides; its one charge may be one that never happens.
        world: What the blasts are drawn by; None: there are those of the scene alone.
        seed: Of all draws.
        until_s: When the world ends [s].
        preset: By which blasts act; the scene has taken it in (`with_preset`).

    Raises:
        InputError: A number is free, the region is about a vehicle that is not there,
            two who perceive have one name, or as in `draw_blasts`.

    Example:
        `draw_world(*jblast.scene.read_world("world.toml"), seed=1).shots`
    """
    source = uncertain.source or "scene"
    key = jax.random.fold_in(world_key(seed), OF_SCENE)
    scene = draw_scene(key, uncertain)
    _refuse_one_name(scene, source)
    blasts: Blasts | tuple[()] = ()
    if world is not None:
        about = _held(scene, source) if world.about == "vehicle" else None
        blasts = draw_blasts(seed, world, about, until_s=until_s, source=source)
    charges = [
        replace(charge, name=charge.name or "charge")
        for charge in scene.charges
        if not charge.never
    ]
    drawn = zip(*blasts, strict=True)
    for number, (time, place, mass) in enumerate(drawn, start=1):
        name = str(number)
        if name in {charge.name for charge in charges}:
            raise InputError(
                f"{source}: [[charge]] name: expected another than that of a random "
                f"blast, got {shown(name)}"
            )
        charges.append(Charge(mass, tuple(place), time, name=name))
    charges.sort(key=lambda charge: float(charge.time_s))
    charges = charges or [Charge(time_s=math.inf)]
    if any(charge.range_m is not None for charge in charges):
        raise InputError(
            f"{source}: [charge] range_m: expected position_m, got a range, which is "
            "to one sensor alone"
        )
    scene = replace(scene, charge=charges[0], others=tuple(charges[1:]))
    laws = dict(scene.law) | record_laws(scene, ground=True)
    scene = replace(scene, law=tuple(laws.items()))
    return DrawnWorld(scene, seed, source, preset)


def _held(scene: Scene, source: str) -> Float[Array, "3"]:
    """Return the place that the vehicle holds."""
    if scene.vehicle is None:
        raise InputError(
            f"{source}: [world] about: expected a [vehicle] that the region is about, "
            "got none"
        )
    return scene.vehicle.held


def _refuse_one_name(scene: Scene, source: str) -> None:
    """Refuse a sensor that is called as the vehicle or the camera is."""
    taken = {
        name
        for name, there in ((VEHICLE, scene.vehicle), (CAMERA, scene.camera))
        if there is not None
    }
    for sensor in scene.sensors:
        if sensor.name in taken:
            raise InputError(
                f"{source}: [[sensor]] name: expected another than that of the "
                f"scene's {sensor.name}, got {shown(sensor.name)}"
            )
        if not sensor.mount and np.isnan(sensor.position_m).any():
            raise InputError(
                f"{source}: [[sensor]] {shown(sensor.name)} position_m: expected "
                "[east, north, up], or a mount, got nothing"
            )


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
