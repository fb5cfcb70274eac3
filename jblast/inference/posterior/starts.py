"""Starting points of a search, spread over the plausible range of each parameter.

A number with a prior is drawn from it. A free positive number is spread by a factor, a
free position over the surroundings of the sensors. Where a sensor measured a direction,
every other start is moved onto its line of sight. A free origin time, or clock offset,
is set last, so that the median residual of the readings of that clock is zero.
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

MIN_SIGHT_LENGTH = 100.0
"""Smallest typical distance along a line of sight [m], for logs without a span of clock
times. `SIGHT_SPREAD` reaches from 10 m to 1 km within two standard deviations."""
SIGHT_SPREAD = 3.0
"""Factor of one standard deviation by which starts along a line of sight are spread."""
BEARINGS = ("bearing_rad", "jolt_bearing_rad")
"""Quantities that point to the charge, or away from it."""
MIN_GROWTH_SPAN = 1e-3
"""Smallest span of the radii of a fireball [s], by which origin times are spread. A
single radius has a span of 0."""


@kept
def layout_size(posterior: Posterior) -> Float[Array, ""]:
    """Return the extent of the layout, or the largest given slant range [m].

    Sensors that measure directions may stand at one place. The length of their lines of
    sight counts then.
    """
    layout = posterior.layout
    given = jnp.max(jnp.nan_to_num(layout.slant_range))
    # the diagonal of the bounding box: pairs of many sensors would cost more
    spread = jnp.linalg.norm(jnp.ptp(layout.position, axis=0))
    least = jnp.maximum(sight_length(posterior), 1.0)
    return jnp.where(given > 0, given, jnp.maximum(spread, least))


@kept
def typical_step(posterior: Posterior) -> Float[Array, " free"]:
    """Return a typical step of each coordinate, by which a solver scales them."""
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
    """Return the standard deviation of the starts in each coordinate."""

    def factor(name: str, belief: Belief):
        is_ln = isinstance(belief, Free) and belief.positive
        return jnp.log(parameter_named(name).spread.amount) if is_ln else 1.0

    parameters = posterior.parameters
    factors = jnp.array([*map(factor, parameters.names, parameters.beliefs)])
    return typical_step(posterior) * factors


def starts(
    key: PRNGKeyArray, posterior: Posterior, count: int
) -> Float[Array, "start free"]:
    """Draw starting points; the first is the middle of all.

    A number with a prior is drawn from it. A free one is spread about its start: a
    positive one by a factor, a place over the sensors' surroundings. A free origin
    time, or clock, is set so that the median reading of its rows is met.

    Args:
        key: Random key.
        posterior: Posterior with the scene and the layout.
        count: Number of starts.
    """
    parameters = posterior.parameters
    # the first start is the middle of the prior: reproducible for any seed
    normal = jax.random.normal(key, (count, len(parameters.names))).at[0].set(0.0)
    moved = normal * start_sd(posterior)[None, :]
    columns = [
        _spread(posterior, name, belief, moved[:, i])
        for i, (name, belief) in enumerate(
            zip(parameters.names, parameters.beliefs, strict=True)
        )
    ]
    z = places_along_sight(posterior, jnp.stack(columns, axis=1), normal)
    # free origin times by the known clocks, then the free clock offsets
    for i, label in _free(posterior, "origin_time_s"):
        z = _with_origin_time(posterior, z, i, label, normal[:, i])
    timed = np.isin(posterior.layout.quantity, CLOCK_TIMES)
    for i, label in _free(posterior, CLOCK_OFFSET):
        z = _met(posterior, z, i, timed & (np.array(posterior.layout.clock) == label))
    return z


def _spread(
    posterior: Posterior,
    name: str,
    belief: Belief,
    moved: Float[Array, " start"],
) -> Float[Array, " start"]:
    """Spread one coordinate about its expected value; wind and altitude are not spread.

    Args:
        posterior: Posterior with the scene and the layout.
        name: Name of the number.
        belief: Its prior (a standard normal in its coordinate), or `Free`.
        moved: Offset of each start from the expected value.
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
        # most charges are at the surface, while sensors may be on masts or vehicles
        middle = posterior.layout.position.mean(axis=0).at[2].set(0.0)  # on the ground
        return middle[parameter.key.index] + moved
    return (0.0 if value is None else value) + 0.0 * moved


def sight_length(posterior: Posterior) -> Float[Array, ""]:
    """Return a typical length of a line of sight [m]; 0 if no direction was measured.

    It is the distance that sound travels between the first and last clock times.
    """
    quantity = posterior.layout.quantity
    if not np.isin(quantity, tuple(DIRECTIONS)).any():
        return jnp.zeros(())
    clock = posterior.measured[np.isin(quantity, CLOCK_TIMES)]
    if clock.size == 0:
        return jnp.asarray(MIN_SIGHT_LENGTH)
    return jnp.maximum(STANDARD_SOUND_SPEED * jnp.ptp(clock), MIN_SIGHT_LENGTH)


def places_along_sight(
    posterior: Posterior,
    z: Float[Array, "start free"],
    normal: Float[Array, "start free"],
) -> Float[Array, "start free"]:
    """Move the free position of every other start onto a line of sight, if any.

    Args:
        posterior: Posterior with the bearings.
        z: Starts.
        normal: Standard normal draw of each coordinate.
    """
    names, beliefs = posterior.parameters.names, posterior.parameters.beliefs
    scene = posterior.parameters.scene
    for shot, charge in enumerate(scene.charges):
        place = [name + scene.label(charge) for name in CHARGE_POSITION]
        at = [names.index(name) if name in names else -1 for name in place]
        # with one fixed coordinate the line of sight has one intersection, which the
        # search finds
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
    """Move every other position onto the line of sight of the first bearing, if any.

    The remaining ones are not moved: a second bearing may be better, and `fit_many`
    draws one set of starts for logs with other bearings.

    Args:
        posterior: Posterior with the bearings.
        of_shot: True for the rows of the charge.
        place: East, north, up of the charge in each start [m].
        spread: Standard normal draw of each start.
    """
    layout = posterior.layout
    seen = np.flatnonzero(of_shot & np.isin(layout.quantity, BEARINGS))
    if seen.size == 0:
        return place
    tall = np.flatnonzero(of_shot & np.isin(layout.quantity, "elevation_rad"))
    angle = posterior.measured[seen[0]]
    # the blast pushes a vehicle away from the charge
    if layout.quantity[seen[0]] == "jolt_bearing_rad":
        angle = angle + math.pi
    rise = jnp.tan(posterior.measured[tall[0]]) if tall.size else 0.0
    line = jnp.stack([jnp.sin(angle), jnp.cos(angle), jnp.asarray(rise)])
    # log-normal: a line of sight has no upper end
    distance = sight_length(posterior) * SIGHT_SPREAD**spread
    on_line = layout.position[seen[0]][None, :] + distance[:, None] * line[None, :]
    return jnp.where(jnp.arange(len(place))[:, None] % 2 == 0, on_line, place)


def _free(posterior: Posterior, base: str) -> list[tuple[int, str]]:
    """Return index and label of the free coordinates with a base name."""
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
    """Set the origin time of a charge by its clock times.

    With fireball radii the flash times alone are used, if there are any.

    Args:
        posterior: Posterior with the readings.
        z: Starts.
        i: Coordinate of the origin time.
        label: Name of the charge.
        normal: Standard normal draw of each start.
    """
    layout, scene = posterior.layout, posterior.parameters.scene
    named = [charge.name for charge in scene.charges]
    of_charge = np.array(layout.shot) == (
        named.index(label) if len(scene.charges) > 1 else 0
    )
    radii = of_charge & np.isin(layout.quantity, FIREBALL_RADII)
    rows = of_charge & np.isin(layout.quantity, CLOCK_TIMES)
    offsets = [name.partition(".") for name in posterior.parameters.names]
    unknown = [clock for base, _, clock in offsets if base == CLOCK_OFFSET]
    known = rows & ~np.isin(layout.clock, unknown)
    # a clock whose offset is free cannot set the origin time: both would shift together
    rows = known if known.any() else rows
    flash = rows & np.isin(layout.quantity, "flash_time_s")
    # the flash of a filmed fireball is nearly the origin time; sound arrives seconds
    # later
    rows = flash if radii.any() and flash.any() else rows
    z = _met(posterior, z, i, rows)
    if radii.any():
        # A radius before the explosion hardly constrains its time: origin times after
        # the first radius are set before it. Radii grow for a time comparable with
        # their span.
        origin, times = z[:, i], layout.time[radii]
        long = jnp.maximum(jnp.ptp(times), MIN_GROWTH_SPAN)
        earlier = times.min() - jnp.abs(normal) * long
        z = z.at[:, i].set(jnp.where(origin < times.min(), origin, earlier))
    return z


def _met(posterior: Posterior, z, i: int, rows: Bool[np.ndarray, " row"]):
    """Add the median residual of some readings to a time."""
    if not rows.any():
        return z
    residual = jax.vmap(lambda z: posterior.misfit(z).residual)(z)
    # a median, not a mean: a start should not follow one wrong clock
    return z.at[:, i].add(jnp.median(residual[:, np.flatnonzero(rows)], axis=1))
