"""Where a search begins: many places, spread over what the parameters could be."""

import math

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, PRNGKeyArray

from jblast.constants import STANDARD_SOUND_SPEED
from jblast.inference.mode.starts_along_sight import places_along_sight, sight_length
from jblast.inference.mode.starts_by_clock import with_times_met
from jblast.inference.posterior.posterior import Posterior
from jblast.kept_programs import kept
from jblast.parameters import CHARGE_POSITION
from jblast.scene import Free, parameter_named
from jblast.scene.uncertain import Belief, value_of

FARTHEST = 100.0
"""A charge is searched as far from an array as this many times its width."""
AMONG = 0.25
"""Half of the starts are drawn nearer the middle of the sensors by this factor: within
the layout, whose extent is the standard deviation of the others. Of a log of five
microphones with a free clock 8 of 64 starts reach the best optimum with it, none
without (`tests/cli/verbs/infer/test_fit_clocks.py`)."""
GOLDEN = 0.5 * (math.sqrt(5.0) - 1.0)
"""Multiples of this, modulo 1, are evenly spread however many are taken."""


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
            their surroundings, at up to `FARTHEST` times their extent: a charge beside
            a small array.
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
    beyond = FARTHEST ** ((number * GOLDEN) % 1.0)
    return np.where(number % 4 == 0, 1.0, np.where(number % 4 == 3, beyond, AMONG))
