"""Where a search begins: many places, spread over what the parameters could be."""

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, PRNGKeyArray

from jblast.constants import STANDARD_SOUND_SPEED
from jblast.inference.posterior import Posterior
from jblast.scene import PARAMETERS, Free
from jblast.scene.scene import value_of

CLOCK_TIMES = ("flash_time_s", "air_arrival_s", "ground_arrival_s")

# Spread of a free positive number about its start: a factor, one standard deviation.
FACTORS = {
    "charge_mass_kg": 100.0,
    "charge_range_m": 10.0,
    "air_sound_speed_m_s": 1.05,
    "air_temperature_k": 1.05,
    "air_pressure_pa": 1.1,
    "air_relative_humidity": 1.5,
    "ground_p_speed_m_s": 1.5,
    "sedov_gamma": 1.05,
}


def layout_size(posterior: Posterior) -> Float[Array, ""]:
    """Return how far the sensors stand from one another, or from the charge [m]."""
    layout = posterior.layout
    given = jnp.max(jnp.nan_to_num(layout.slant_range))
    spread = jnp.linalg.norm(jnp.ptp(layout.position, axis=0))
    return jnp.where(given > 0, given, jnp.maximum(spread, 1.0))


def scales(posterior: Posterior) -> Float[Array, " free"]:
    """Return a typical step of each coordinate, which makes them alike to a solver."""
    size = layout_size(posterior)
    lengths = {
        "origin_time_s": size / STANDARD_SOUND_SPEED,
        "charge_up_m": 0.1 * size,
        "air_altitude_m": 1000.0,
    }
    parameters = posterior.parameters
    return jnp.array(
        [
            1.0
            if not isinstance(belief, Free) or belief.positive
            else lengths.get(name, size)
            for name, belief in zip(parameters.names, parameters.beliefs, strict=True)
        ]
    )


def spreads(posterior: Posterior) -> Float[Array, " free"]:
    """Return how far starts are spread in each coordinate, one standard deviation."""
    parameters = posterior.parameters
    by_factor = jnp.array(
        [
            jnp.log(FACTORS[name])
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
    time is set so that the median clock reading is met.
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
            default = PARAMETERS[name].default
            known = default if value is None else jnp.where(value > 0, value, default)
            start = jnp.log(known)
            columns.append(start + spread)
        elif name in ("charge_east_m", "charge_north_m"):
            columns.append(middle["en".index(name[7])] + spread)
        elif name == "charge_up_m":
            columns.append(spread)
        else:
            columns.append((0.0 if value is None else value) + 0.0 * spread)
    z = jnp.stack(columns, axis=1)
    if "origin_time_s" in parameters.names:
        index = parameters.names.index("origin_time_s")
        if isinstance(parameters.beliefs[index], Free):
            z = z.at[:, index].add(_late_by(posterior, z))
    return z


def _late_by(posterior, z):
    """By how much the median clock reading is later than each start predicts."""
    rows = [
        row
        for row, quantity in enumerate(posterior.layout.quantity)
        if quantity in CLOCK_TIMES
    ]
    if not rows:
        return jnp.zeros(z.shape[0])
    residual = jax.vmap(lambda z: posterior.misfit(z).residual)(z)
    return jnp.median(residual[:, np.array(rows)], axis=1)
