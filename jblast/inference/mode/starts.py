"""Starting points of a search, spread over the plausible range of each parameter.

A number with a prior is drawn from it. A free positive number is spread by a factor, a
free position over the surroundings of the sensors: half of the starts lie among the
sensors, the others around and beyond them. Where a sensor measured a direction, every
other start is moved onto its line of sight. A free origin time, or clock offset, is set
last, so that the median residual of the readings of that clock is zero.
"""

import math

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float, PRNGKeyArray

from jblast.constants import STANDARD_SOUND_SPEED
from jblast.inference.posterior.posterior import Posterior
from jblast.kept_programs import kept
from jblast.parameters import CHARGE_POSITION, CLOCK_OFFSET
from jblast.quantities import CLOCK_TIMES, DIRECTIONS, FIREBALL_RADII
from jblast.scene import Free, parameter_named
from jblast.scene.uncertain import Belief, value_of

MAX_WIDTHS = 100.0
"""Largest distance of a start from an array, in widths of the array."""
AMONG = 0.25
"""Half of the starts are drawn nearer the middle of the sensors by this factor: within
the layout, whose extent is the standard deviation of the others. Of a log of five
microphones with a free clock 8 of 64 starts reach the best optimum with it, none
without (`tests/cli/verbs/infer/test_fit_clocks.py`)."""
GOLDEN = 0.5 * (math.sqrt(5.0) - 1.0)
"""Multiples of this, modulo 1, are evenly spread however many are taken."""
AWAY = 100.0
"""Least distance of a charge from a sensor that sees it, for a start [m]."""
FARTHER = 3.0
"""Starts along a line are spread by this factor, one standard deviation."""
BEARINGS = ("bearing_rad", "jolt_bearing_rad")
"""Quantities that point to the charge, or away from it."""
SHORT = 1e-3
"""A time in which fireballs grow [s]."""


@kept
def layout_size(posterior: Posterior) -> Float[Array, ""]:
    """Return how far the sensors stand from one another, or from the charge [m].

    Sensors that see a direction may stand together: then how far they may see.
    """
    layout = posterior.layout
    given = jnp.max(jnp.nan_to_num(layout.slant_range))
    spread = jnp.linalg.norm(jnp.ptp(layout.position, axis=0))
    least = jnp.maximum(sight_length(posterior), 1.0)
    return jnp.where(given > 0, given, jnp.maximum(spread, least))


@kept
def typical_step(posterior: Posterior) -> Float[Array, " free"]:
    """Return a typical step of each coordinate, which makes them alike to a solver."""
    size = layout_size(posterior)
    units = {"unit": 1.0, "layout": size, "travel": size / STANDARD_SOUND_SPEED}

    def step(name: str, belief: Belief):
        if not isinstance(belief, Free) or belief.positive:
            return 1.0
        amount, of = parameter_named(name).spread
        return amount * units[of] if of in units else size

    parameters = posterior.parameters
    return jnp.array([*map(step, parameters.names, parameters.beliefs)])


def start_sd(posterior: Posterior) -> Float[Array, " free"]:
    """Return how far starts are spread in each coordinate, one standard deviation."""

    def factor(name: str, belief: Belief):
        is_ln = isinstance(belief, Free) and belief.positive
        return jnp.log(parameter_named(name).spread.amount) if is_ln else 1.0

    parameters = posterior.parameters
    factors = jnp.array([*map(factor, parameters.names, parameters.beliefs)])
    return typical_step(posterior) * factors


def starts(
    key: PRNGKeyArray, posterior: Posterior, count: int, *, far: bool = False
) -> Float[Array, "start free"]:
    """Draw places to start from; the first is the middle of them all.

    A number with a prior is drawn from it. A free one is spread about its start: a
    positive one by a factor, a place over the sensors' surroundings. A free origin
    time, or clock, is set so that the median reading of its rows is met.

    Args:
        key: Random key.
        posterior: Has the scene, and the sensors.
        count: Number of starts.
        far: Whether half of the places lie among the sensors and every fourth beyond
            their surroundings, at up to `MAX_WIDTHS` times their extent: a charge
            beside a small array.
    """
    parameters = posterior.parameters
    normal = jax.random.normal(key, (count, len(parameters.names))).at[0].set(0.0)
    moved = normal * start_sd(posterior)[None, :]
    columns = [
        _spread(posterior, name, belief, moved[:, i], far=far)
        for i, (name, belief) in enumerate(
            zip(parameters.names, parameters.beliefs, strict=True)
        )
    ]
    z = places_along_sight(posterior, jnp.stack(columns, axis=1), normal)
    return with_times_met(posterior, z, normal)


def _spread(
    posterior: Posterior,
    name: str,
    belief: Belief,
    moved: Float[Array, " start"],
    *,
    far: bool,
) -> Float[Array, " start"]:
    """Spread one coordinate about where it is expected; wind and altitude stay there.

    Args:
        posterior: Has the scene, and the sensors.
        name: Of the number.
        belief: What is believed of it; a prior is a normal in its coordinate.
        moved: How far each start is to be from there.
        far: See `starts`.
    """
    if not isinstance(belief, Free):
        return moved
    parameter = parameter_named(name)
    value = value_of(posterior.parameters.scene, name)
    if belief.positive:
        default = parameter.default
        known = default if value is None else jnp.where(value > 0, value, default)
        return jnp.log(known) + moved
    if parameter.name in CHARGE_POSITION:
        middle = posterior.layout.position.mean(axis=0).at[2].set(0.0)  # on the ground
        if far and parameter.name in CHARGE_POSITION[:2]:
            moved = moved * _spread_factors(len(moved))
        return middle[parameter.key.index] + moved
    return (0.0 if value is None else value) + 0.0 * moved


def _spread_factors(count: int) -> Float[np.ndarray, " start"]:
    """Return by which factor the place of each start is moved from the sensors' middle.

    Of each four starts two lie among the sensors, one in their surroundings, and one
    beyond: the same factor for east and north, evenly spread in its ln.
    """
    number = np.arange(count)
    beyond = MAX_WIDTHS ** ((number * GOLDEN) % 1.0)
    return np.where(number % 4 == 0, 1.0, np.where(number % 4 == 3, beyond, AMONG))


def sight_length(posterior: Posterior) -> Float[Array, ""]:
    """Return a typical distance of what sensors see the direction of [m]; else zero.

    How far sound goes in the time between the log's first and last clock times.
    """
    quantity = posterior.layout.quantity
    if not np.isin(quantity, tuple(DIRECTIONS)).any():
        return jnp.zeros(())
    clock = posterior.measured[np.isin(quantity, CLOCK_TIMES)]
    if clock.size == 0:
        return jnp.asarray(AWAY)
    return jnp.maximum(STANDARD_SOUND_SPEED * jnp.ptp(clock), AWAY)


def places_along_sight(
    posterior: Posterior,
    z: Float[Array, "start free"],
    normal: Float[Array, "start free"],
) -> Float[Array, "start free"]:
    """Move every other start's free places onto lines of sight, where there are any.

    Args:
        posterior: Has the bearings.
        z: Starts.
        normal: A standard normal draw for each coordinate.
    """
    names, beliefs = posterior.parameters.names, posterior.parameters.beliefs
    scene = posterior.parameters.scene
    for shot, charge in enumerate(scene.charges):
        place = [name + scene.label(charge) for name in CHARGE_POSITION]
        at = [names.index(name) if name in names else -1 for name in place]
        if at[0] < 0 or at[1] < 0:
            continue
        up = jnp.broadcast_to(charge.up, len(z)) if at[2] < 0 else z[:, at[2]]
        moved = _along_sight(
            posterior,
            np.array(posterior.layout.shot) == shot,
            jnp.stack([z[:, at[0]], z[:, at[1]], up], axis=1),
            normal[:, at[0]],
        )
        for i, coordinate in zip(at, moved.T, strict=True):
            if i >= 0 and isinstance(beliefs[i], Free):
                z = z.at[:, i].set(coordinate)
    return z


def _along_sight(
    posterior: Posterior,
    of_shot: np.ndarray,
    place: Float[Array, "start 3"],
    spread: Float[Array, " start"],
) -> Float[Array, "start 3"]:
    """Move every other place onto the line of sight of the first bearing, if any.

    The others stay: a second bearing may be better, or a library of places be drawn
    for logs that are yet to come.

    Args:
        posterior: Has the bearings.
        of_shot: Which rows are of the charge.
        place: East, north, up of the charge in each start [m].
        spread: A standard normal draw for each.
    """
    layout = posterior.layout
    seen = np.flatnonzero(of_shot & np.isin(layout.quantity, BEARINGS))
    if seen.size == 0:
        return place
    tall = np.flatnonzero(of_shot & np.isin(layout.quantity, "elevation_rad"))
    angle = posterior.measured[seen[0]]
    if layout.quantity[seen[0]] == "jolt_bearing_rad":  # thrown away from it
        angle = angle + math.pi
    rise = jnp.tan(posterior.measured[tall[0]]) if tall.size else 0.0
    line = jnp.stack([jnp.sin(angle), jnp.cos(angle), jnp.asarray(rise)])
    distance = sight_length(posterior) * FARTHER**spread
    on_line = layout.position[seen[0]][None, :] + distance[:, None] * line[None, :]
    return jnp.where(jnp.arange(len(place))[:, None] % 2 == 0, on_line, place)


def with_times_met(
    posterior: Posterior,
    z: Float[Array, "start free"],
    normal: Float[Array, "start free"],
) -> Float[Array, "start free"]:
    """Set free origin times, by clocks that are known, then clocks that are not.

    Args:
        posterior: Has the readings.
        z: Starts, their places set.
        normal: A standard normal draw for each coordinate.
    """
    for i, label in _free(posterior, "origin_time_s"):
        z = _with_origin_time(posterior, z, i, label, normal[:, i])
    timed = np.isin(posterior.layout.quantity, CLOCK_TIMES)
    for i, label in _free(posterior, CLOCK_OFFSET):
        z = _met(posterior, z, i, timed & (np.array(posterior.layout.clock) == label))
    return z


def _free(posterior: Posterior, base: str) -> list[tuple[int, str]]:
    """Return the coordinates that are one free number, and the label of each."""
    parameters = posterior.parameters
    parts = [name.partition(".") for name in parameters.names]
    return [
        (i, label)
        for i, ((name, _, label), belief) in enumerate(
            zip(parts, parameters.beliefs, strict=True)
        )
        if name == base and isinstance(belief, Free)
    ]


def _with_origin_time(
    posterior: Posterior,
    z: Float[Array, "start free"],
    i: int,
    label: str,
    normal: Float[Array, " start"],
) -> Float[Array, "start free"]:
    """Set the origin time of a charge by its rows, those of a flash if radii are seen.

    Args:
        posterior: Has the readings.
        z: Starts.
        i: Coordinate of the origin time.
        label: Name of the charge.
        normal: A standard normal draw.
    """
    layout, scene = posterior.layout, posterior.parameters.scene
    named = [charge.name for charge in scene.charges]
    of_charge = np.array(layout.shot) == (named.index(label) if scene.others else 0)
    radii = of_charge & np.isin(layout.quantity, FIREBALL_RADII)
    rows = of_charge & np.isin(layout.quantity, CLOCK_TIMES)
    offsets = [name.partition(".") for name in posterior.parameters.names]
    unknown = [clock for base, _, clock in offsets if base == CLOCK_OFFSET]
    known = rows & ~np.isin(layout.clock, unknown)
    rows = known if known.any() else rows
    flash = rows & np.isin(layout.quantity, "flash_time_s")
    rows = flash if radii.any() and flash.any() else rows
    z = _met(posterior, z, i, rows)
    if radii.any():
        z = z.at[:, i].set(_before_radii(z[:, i], layout.time[radii], normal))
    return z


def _met(posterior: Posterior, z, i: int, rows: Bool[np.ndarray, " row"]):
    """Move a time by as much as the median of some readings is later than predicted."""
    if not rows.any():
        return z
    residual = jax.vmap(lambda z: posterior.misfit(z).residual)(z)
    return z.at[:, i].add(jnp.median(residual[:, np.flatnonzero(rows)], axis=1))


def _before_radii(origin, times, normal):
    """Return origin times, those that are not before the first radius moved there.

    A radius before the explosion hardly constrains its time.
    """
    long = jnp.maximum(jnp.ptp(times), SHORT)
    earlier = times.min() - jnp.abs(normal) * long
    return jnp.where(origin < times.min(), origin, earlier)
