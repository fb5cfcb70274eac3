r"""When the blasts of an episode may push its vehicle: cheap to ask, never too late.

At the place where the episode starts, a front comes at $t_0$ and its wave lasts $D$. At
a vehicle $d$ away from there it comes at $t_0 - d/c$ at the earliest and at $t_0 + 4.7
d/c$ at the latest (`BlastLoad.quiet_until`), and lasts no longer than the longest of
those at half, once and twice the start's distance from the charge, as long as $d$ is
less than half of that distance. Farther off the answer is that it may push.
"""

from typing import NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float

from jblast.environments.params import EnvironmentParams
from jblast.vehicle import BlastLoad
from jblast.vehicle.dynamics.components import Number, Vector
from jblast.vehicle.loads.blast.passage import crossing_time
from jblast.vehicle.quadrotor.body import required_body

LATE = 4.7
"""Most that a front comes later for each metre farther off, in units of 1/c."""
LONGER = 1.05
"""Of a wave, for the roundings of its tables."""


class Windows(NamedTuple):
    """Of each blast, about the place where an episode starts.

    Attributes:
        came_s: When the front comes there; infinite: never.
        lasts_s: How long its wave may last thereabouts.
        crossing_s: How long the front takes across the vehicle.
        near_m: Up to where that holds.
        slowness_s_m: One over the speed of sound, against any wind there is.
    """

    came_s: Float[Array, "*blast"]
    lasts_s: Float[Array, "*blast"]
    crossing_s: Float[Array, "*blast"]
    near_m: Float[Array, "*blast"]
    slowness_s_m: Float[Array, "*blast"]


def window_of(load: BlastLoad, params: EnvironmentParams, start: Vector) -> Windows:
    """Return when a blast may push a vehicle that starts at a place.

    Args:
        load: Of the one blast.
        params: Of the environment.
        start: Where the episode starts.
    """
    (blast,) = load.blasts
    place, body = jnp.stack(start), required_body(params.vehicle.body)
    way = place - blast.position_m
    shares = jnp.asarray([0.5, 1.0, 2.0], way.dtype)
    waves = load.wave_of(blast, blast.position_m[None] + shares[:, None] * way[None])
    slowest = jax.tree.map(lambda x: jnp.broadcast_to(x, shares.shape)[-1], waves)
    wind = jnp.sqrt(jnp.sum(jnp.square(load.wind_m_s)))
    sound = jnp.maximum(load.sound_speed_m_s - 2 * wind, 1.0)
    found = Windows(
        load.arrival_time_s(place)[0],
        LONGER * jnp.max(waves.duration_s + waves.suction_s),
        crossing_time(body, slowest),
        jnp.sqrt(jnp.sum(jnp.square(way))) / 2,
        1 / sound,
    )
    return jax.lax.stop_gradient(found)


def may_push(
    windows: Windows, off_m: Number, start_s: Number, end_s: Number
) -> Bool[Array, "*blast"]:
    """Return whether each blast may push a vehicle between two times.

    Args:
        windows: Of its episode.
        off_m: How far it is from where that started.
        start_s: From when.
        end_s: To when.
    """
    off = off_m * windows.slowness_s_m
    first = windows.came_s - windows.crossing_s - off
    last = windows.came_s + windows.crossing_s + LATE * off + windows.lasts_s
    inside = (end_s >= first) & (start_s <= last)
    return inside | ~(off_m < windows.near_m)
