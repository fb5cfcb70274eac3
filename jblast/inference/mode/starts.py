"""Where a search begins: many places, spread over what the parameters could be."""

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, PRNGKeyArray

from jblast.constants import STANDARD_SOUND_SPEED
from jblast.inference.mode.starts_along_sight import along_sight, sight_length
from jblast.inference.posterior.posterior import Posterior
from jblast.kept_programs import kept
from jblast.observations import CLOCK_TIMES
from jblast.parameter_table import CLOCK_OFFSET
from jblast.quantities import FIREBALL_RADII
from jblast.scene import Free, place_of
from jblast.scene.parameters import value_of

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
def scales(posterior: Posterior) -> Float[Array, " free"]:
    """Return a typical step of each coordinate, which makes them alike to a solver."""
    size = layout_size(posterior)
    units = {"unit": 1.0, "layout": size, "travel": size / STANDARD_SOUND_SPEED}

    def step(name, belief):
        if not isinstance(belief, Free) or belief.positive:
            return 1.0
        amount, of = place_of(name).spread
        return amount * units[of] if of in units else size

    parameters = posterior.parameters
    steps = map(step, parameters.names, parameters.beliefs)
    return jnp.array(list(steps))


def spreads(posterior: Posterior) -> Float[Array, " free"]:
    """Return how far starts are spread in each coordinate, one standard deviation."""
    parameters = posterior.parameters
    by_factor = jnp.array(
        [
            jnp.log(place_of(name).spread.amount)
            if isinstance(belief, Free) and belief.positive
            else 1.0
            for name, belief in zip(parameters.names, parameters.beliefs, strict=True)
        ]
    )
    return scales(posterior) * by_factor


def starts(
    key: PRNGKeyArray, posterior: Posterior, count: int
) -> Float[Array, "start free"]:
    """Draw places to start from; the first is the middle of them all.

    A number with a prior is drawn from it. A free one is spread about its start: a
    positive one by a factor, a place over the sensors' surroundings. A free origin
    time, or clock, is set so that the median reading of its rows is met.
    """
    parameters = posterior.parameters
    middle = posterior.layout.position.mean(axis=0)
    draws = jax.random.normal(key, (count, len(parameters.names))).at[0].set(0.0)
    draws = draws * spreads(posterior)[None, :]
    columns = []
    for i, (name, belief) in enumerate(
        zip(parameters.names, parameters.beliefs, strict=True)
    ):
        spread = draws[:, i]
        value = value_of(parameters.scene, name)
        if not isinstance(belief, Free):
            columns.append(spread)
        elif belief.positive:
            default = place_of(name).default
            known = default if value is None else jnp.where(value > 0, value, default)
            start = jnp.log(known)
            columns.append(start + spread)
        elif _base(name) in ("charge_east_m", "charge_north_m"):
            columns.append(middle["en".index(name[7])] + spread)
        elif _base(name) == "charge_up_m":
            columns.append(spread)
        else:
            columns.append((0.0 if value is None else value) + 0.0 * spread)
    layout = posterior.layout
    for charge in parameters.scene.charges:
        label = parameters.scene.label(charge)
        free = [f"charge_{side}_m{label}" for side in ("east", "north", "up")]
        at = [parameters.names.index(n) if n in parameters.names else -1 for n in free]
        if at[0] < 0 or at[1] < 0:
            continue
        of_shot = _rows_of(parameters.scene, layout, charge.name)
        up = jnp.broadcast_to(charge.up, count) if at[2] < 0 else columns[at[2]]
        place = jnp.stack([columns[at[0]], columns[at[1]], up], axis=1)
        spread = draws[:, at[0]] / spreads(posterior)[at[0]]
        place = along_sight(posterior, of_shot, place, spread)
        for i, coordinate in zip(at, place.T, strict=True):
            if i >= 0 and isinstance(parameters.beliefs[i], Free):
                columns[i] = coordinate
    z = jnp.stack(columns, axis=1)
    clocks = [n.partition(".")[2] for n in parameters.names if _base(n) == CLOCK_OFFSET]
    timed = np.isin(layout.quantity, CLOCK_TIMES)
    # first the origin times, by clocks that are known, then the clocks that are not
    for wanted in ("origin_time_s", CLOCK_OFFSET):
        for i, name in enumerate(parameters.names):
            if _base(name) != wanted or not isinstance(parameters.beliefs[i], Free):
                continue
            label = name.partition(".")[2]
            radii = np.zeros(len(timed), bool)
            if wanted == CLOCK_OFFSET:
                rows = timed & (np.array(layout.clock) == label)
            else:
                of_shot = _rows_of(parameters.scene, layout, label)
                radii = of_shot & np.isin(layout.quantity, FIREBALL_RADII)
                rows = timed & of_shot
                known = rows & ~np.isin(layout.clock, clocks)
                rows = known if known.any() else rows
                flash = rows & np.isin(layout.quantity, "flash_time_s")
                rows = flash if radii.any() and flash.any() else rows
            if rows.any():
                z = z.at[:, i].add(_late_by(posterior, z, np.flatnonzero(rows)))
            if radii.any():
                spread = draws[:, i] / spreads(posterior)[i]
                z = z.at[:, i].set(_before_radii(z[:, i], layout.time[radii], spread))
    return z


def _rows_of(scene, layout, name: str) -> np.ndarray:
    """Return which rows are of a charge, by its name; of one, all."""
    named = [charge.name if scene.others else "" for charge in scene.charges]
    return np.array(named)[list(layout.shot)] == (name if scene.others else "")


def _late_by(posterior, z, rows):
    """By how much the median reading of some rows is later than each start predicts."""
    residual = jax.vmap(lambda z: posterior.misfit(z).residual)(z)
    return jnp.median(residual[:, rows], axis=1)


def _before_radii(origin, times, spread):
    """Return origin times, those that are not before the first radius moved there.

    A radius before the explosion hardly says when that was.
    """
    long = jnp.maximum(jnp.ptp(times), SHORT)
    earlier = times.min() - jnp.abs(spread) * long
    return jnp.where(origin < times.min(), origin, earlier)


def _base(name: str) -> str:
    """Return a number's name without the charge or clock it is of."""
    return name.partition(".")[0]
