"""The load of blasts that were announced, on a vehicle wherever it is.

Its numbers are those of the server's own, so a flight by it is the flight in one
process. A C++ client, which has no laws, flies by the force profiles instead.
"""

import math
from collections.abc import Sequence

import jax.numpy as jnp

from jblast.errors import InputError
from jblast.vehicle import BlastLoad
from jblast.vehicle.loads.blast.from_scene import images_of
from jblast.vehicle.loads.blast.passage import Blast
from jblast.world.server.payload import Announcement


def announced_load(
    announced: Sequence[Announcement],
    *,
    pressure_pa: float,
    sound_speed_m_s: float,
    wind_m_s: Sequence[float],
    since_s: float = 0.0,
    room: int = 4,
) -> BlastLoad:
    """Return the load of blasts, for flights of a short while one after another.

    Args:
        announced: The blasts, those of both curve sets in any order.
        pressure_pa: Of the air.
        sound_speed_m_s: In still air.
        wind_m_s: East, north, up.
        since_s: When the flight begins: its own clock is 0 then [s].
        room: Blasts of each curve set that a load has, the missing ones never: one
            program for all numbers of them.

    Raises:
        InputError: There are more than fit.
    """
    blasts = []
    for burst in ("surface", "free-air"):
        of_burst = [one for one in announced if one.burst == burst]
        if len(of_burst) > room:
            raise InputError(
                f"expected at most {room} blasts of burst {burst!r} at a time, got "
                f"{len(of_burst)}"
            )
        blasts += [_blast(one, since_s) for one in of_burst]
        never = Blast(
            jnp.array([1e3, 0.0, 0.0]),
            jnp.asarray(math.inf),
            jnp.ones(()),
            jnp.ones(()),
            burst,
        )
        blasts += [never] * (room - len(of_burst))
    return BlastLoad(
        tuple(blasts),
        pressure_pa,
        sound_speed_m_s,
        jnp.asarray(wind_m_s, float),
        images=images_of(blasts),
    )


def _blast(announced: Announcement, since_s: float) -> Blast:
    pressure_mass, impulse_mass = announced.tnt_mass_kg
    return Blast(
        position_m=jnp.stack(
            [jnp.asarray(x, float) for x in announced.charge.position_m]
        ),
        time_s=jnp.asarray(float(announced.charge.time_s) - since_s),
        mass_kg=jnp.asarray(pressure_mass),
        impulse_mass_kg=jnp.asarray(impulse_mass),
        burst=announced.burst,
    )
