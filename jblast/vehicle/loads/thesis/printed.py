r"""The load of a blast as the thesis prints it: wrong in part, and kept to compare.

- When: Wu and Hao's air shock (eq. 3.4), as for the sound.
- Force: "the Friedlander waveform" (eq. 3.5), $P_s (1 - t/t^*) e^{-t/t^*}$ over its
  positive phase. Neither size nor area is printed: declared are Kingery and Bulmash's
  peak and duration of a surface burst, and the vehicle's own projected area.
- Moment: that of its file of pressure data, whose two rows are 100 m times the force
  across body x, about a point far away. No charge is told, so that the moment is the
  same of all; between the rows $M R^2$ is straight in $\ln R$, beyond them held. It is
  given with the force.

Parab's thesis, sections 3.4.1 and 4.3; the file is that of the public plugin.
"""

import math

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from jblast.scene import Scene
from jblast.types import as_float_array
from jblast.vehicle.dynamics.components import (
    four,
    rotation,
    three,
    times_transposed,
    unit,
)
from jblast.vehicle.dynamics.state import State
from jblast.vehicle.loads.thesis.blasts import Blasts, blasts_of
from jblast.vehicle.quadrotor.body import required_body
from jblast.vehicle.quadrotor.parameters import Vehicle
from jblast.waves.laws.kingery_bulmash import (
    kingery_bulmash_duration,
    kingery_bulmash_pressure,
)
from jblast.waves.laws.wu_hao import wu_hao_air_arrival_time

SOUND_SPEED_M_S = 340.0
DISTANCES_M = np.array([8.660254, 17.320508])
MOMENTS_N_M_S = np.array(
    [[-0.0017737, -21.1733, 9.56593], [-0.00027762, -5.65982, 3.1391]]
)
"""Of the file: body x, y and z, a row for each distance."""


def printed_impulse(
    distance_m: Float[Array, "..."],
    mass_kg: Float[Array, "..."],
    area_m2: Float[Array, "..."],
) -> Float[Array, "..."]:
    """Return the impulse of the positive phase on an area: $P_s t^* A/e$ [N s]."""
    peak = kingery_bulmash_pressure(distance_m, mass_kg)
    return peak * kingery_bulmash_duration(distance_m, mass_kg) * area_m2 / math.e


def printed_angular_impulse(
    distance_m: Float[Array, "..."],
) -> Float[Array, "... 3"]:
    """Return the angular impulse of the file, body axes [N m s]."""
    log = jnp.log(distance_m)
    square = DISTANCES_M[:, None] ** 2
    columns = [
        jnp.interp(log, np.log(DISTANCES_M), column)
        for column in (MOMENTS_N_M_S * square).T
    ]
    return jnp.stack(columns, axis=-1) / jnp.square(distance_m)[..., None]


class PrintedLoad(eqx.Module):
    """The pulse of a scene's blasts as the thesis prints it.

    Attributes:
        blasts: The charges.
        sound_speed_m_s: The one number of air in its arrival.
    """

    blasts: Blasts
    sound_speed_m_s: Float[Array, "*batch"] = eqx.field(
        converter=as_float_array, default=SOUND_SPEED_M_S
    )

    def arrival_time_s(self, position_m: Float[Array, "... 3"]) -> Float[Array, "..."]:
        """Return when the fronts come to places, a blast in each of the last axis."""
        return self.blasts.time_s + self._travel_s(self.blasts.distance_m(position_m))

    def impulse(
        self,
        start_s: Float[Array, ""],
        end_s: Float[Array, ""],
        state: State,
        vehicle: Vehicle,
    ) -> tuple[Float[Array, "3"], Float[Array, "3"]]:
        """Return what falls between two times.

        Returns:
            Impulse, world [N s], and angular impulse, body [N m s].

        Raises:
            InputError: Nothing is known of what a blast acts on.
        """
        body = required_body(vehicle.body)
        blasts = self.blasts
        distance = blasts.distance_m(state.position_m)
        duration = kingery_bulmash_duration(distance, blasts.mass_kg)

        def given(since: Float[Array, " blast"]) -> Float[Array, " blast"]:
            x = jnp.clip(since / duration, 0.0, 1.0)
            return x * jnp.exp(1.0 - x)  # 1 at the end of the positive phase

        share = blasts.shares(start_s, end_s, state, self._travel_s, given)
        away = (state.position_m[None] - blasts.position_m) / distance[:, None]
        attitude = rotation(unit(four(state.quaternion)))
        along = jnp.stack(
            [jnp.stack(times_transposed(attitude, three(one))) for one in away]
        )
        area = jnp.sqrt(
            jnp.sum(jnp.square(body.area_m2[None] * along), axis=-1) + 1e-30
        )
        push = share * printed_impulse(distance, blasts.mass_kg, area)
        turn = share[:, None] * printed_angular_impulse(distance)
        return jnp.sum(push[:, None] * away, axis=0), jnp.sum(turn, axis=0)

    def _travel_s(self, distance: Float[Array, "... blast"]) -> Float[Array, "..."]:
        speed = self.sound_speed_m_s
        return wu_hao_air_arrival_time(distance, self.blasts.mass_kg, speed)


def printed_load(scene: Scene) -> PrintedLoad:
    """Return the loads of a scene's blasts."""
    return PrintedLoad(blasts_of(scene))
