r"""Loads of a blast as printed in Parab's thesis, and as computed by its plugin.

Both are wrong, the first in part, and are kept for comparison.

As printed (sections 3.4.1 and 4.3; the file is that of the public plugin):

- Arrival: Wu and Hao's air shock (eq. 3.4), as for the sound.
- Force: "the Friedlander waveform" (eq. 3.5), $P_s (1 - t/t^*) e^{-t/t^*}$ over its
  positive phase. Neither size nor area is printed. Declared here: Kingery and Bulmash's
  peak and duration of a surface burst, and the vehicle's own projected area.
- Moment: that of its file of pressure data, whose two rows are 100 m times the force
  across body x, about a point far away. No charge is given, so the moment is the same
  for all; between the rows $M R^2$ is linear in $\ln R$, beyond them constant. It is
  applied with the force.

As computed: the model plugin of gazebo_blast3d (`e6dd04c`; GPL, so only its facts are
stated here and nothing is copied) waits r/300 m/s and then pushes for one step of the
simulator, 4 ms, with

$$F = \frac{2.2116^2\,r^{-2.1604}\,Q + 0.0196}{1\,\mathrm{ms}}, \qquad
  M = \frac{4.8894^2\,r^{-0.0262}\,Q + 5.4295}{1\,\mathrm{ms}}$$

in metres, kilograms, newtons: impulses meant for 1 ms, so that four times as much is
given. Both were fitted to a file of two rows, whose moments are about a point 100 m
away. The direction of the force has azimuth and polar angle exchanged; the moment is
perpendicular to it. A limit in the simulator's model cuts the moment; its value is not
published and is declared here.

Two properties of the plugin are not reproduced: there the push begins at a step of the
simulator (here, at the arrival of the wave), and the distance is that of the
announcement (here, of the moment).
"""

import math
from collections.abc import Callable

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float

from jblast.scene import Scene
from jblast.types import as_float_array
from jblast.vehicle.quadrotor import Vehicle, required_body
from jblast.vehicle.state import State, four, rotation, three, times_transposed, unit
from jblast.waves.laws.kingery_bulmash import (
    kingery_bulmash_duration,
    kingery_bulmash_pressure,
)
from jblast.waves.laws.wu_hao import wu_hao_air_arrival_time
from jblast.waves.paths import slant_range

# As in the thesis, whose loads this module reproduces.
SOUND_SPEED_M_S = 340.0
DISTANCES_M = np.array([8.660254, 17.320508])
MOMENTS_N_M_S = np.array(
    [[-0.0017737, -21.1733, 9.56593], [-0.00027762, -5.65982, 3.1391]]
)
"""Of the file: body x, y and z, a row for each distance."""
SPEED_M_S = 300.0
"""Of the plugin's wave, whatever the charge."""
MEANT_S, HELD_S = 1e-3, 4e-3
"""Over how long the impulse is meant to be given, and how long it is."""
FORCE, MOMENT = (2.2116, -2.1604, 0.0196), (4.8894, -0.0262, 5.4295)
"""a, n and b of an impulse $a^2 r^n Q + b$: N s and N m s of metres and kilograms."""
MOST_MOMENT_N_M = 1.0
"""Declared: a third of what the Hummingbird's rotors can do about its y axis."""
NEAREST_M = 0.1
"""Nearer than that everything is as it is there."""


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


class Blasts(eqx.Module):
    """Charges; leading axes are a batch's.

    Attributes:
        position_m: East, north, up.
        time_s: Of detonation; infinite: it never happens.
        mass_kg: Of TNT.
    """

    position_m: Float[Array, "*batch blast 3"] = eqx.field(converter=as_float_array)
    time_s: Float[Array, "*batch blast"] = eqx.field(converter=as_float_array)
    mass_kg: Float[Array, "*batch blast"] = eqx.field(converter=as_float_array)

    @property
    def never(self) -> Bool[Array, "*batch blast"]:
        """Which never happen."""
        return jnp.isposinf(self.time_s)

    def distance_m(
        self, position_m: Float[Array, "... 3"]
    ) -> Float[Array, "... blast"]:
        """Return how far the charges are from places."""
        here = position_m[..., None, :]
        source = jnp.broadcast_to(
            self.position_m, (*here.shape[:-2], *self.position_m.shape)
        )
        return jnp.maximum(slant_range(source, here), NEAREST_M)

    def shares(
        self,
        start_s: Float[Array, ""],
        end_s: Float[Array, ""],
        state: State,
        travel_s: Callable[[Float[Array, " blast"]], Float[Array, " blast"]],
        given: Callable[[Float[Array, " blast"]], Float[Array, " blast"]],
    ) -> Float[Array, " blast"]:
        """Return which share of each pulse falls between two times.

        Shares of following steps are the differences of one function of time, so that
        over all steps the whole is given once, however the vehicle moves.

        Args:
            start_s: Beginning of the step.
            end_s: Its end.
            state: Of the vehicle at the beginning; it goes on as it moves.
            travel_s: Time from detonation to arrival, from the distance [m].
            given: Share of the whole until a time since the arrival [s].
        """
        ahead = state.position_m + state.velocity_m_s * (end_s - start_s)
        time = jnp.where(self.never, 0.0, self.time_s)

        def until(now: Float[Array, ""], place: Float[Array, "3"]):
            return given(now - time - travel_s(self.distance_m(place)))

        share = until(end_s, ahead) - until(start_s, state.position_m)
        return jnp.where(self.never, 0.0, share)


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


def coded_impulse(
    distance_m: Float[Array, "..."], mass_kg: Float[Array, "..."]
) -> Float[Array, "..."]:
    """Return the impulse that is meant; four times as much is given [N s]."""
    return _fitted(FORCE, distance_m, mass_kg)


def coded_angular_impulse(
    distance_m: Float[Array, "..."], mass_kg: Float[Array, "..."]
) -> Float[Array, "..."]:
    """Return the angular impulse that is meant, nothing clipped [N m s]."""
    return _fitted(MOMENT, distance_m, mass_kg)


class CodedLoad(eqx.Module):
    """The pulse of a scene's blasts as the plugin gives it.

    Attributes:
        blasts: The charges.
        most_moment_n_m: At which the moment is cut.
    """

    blasts: Blasts
    most_moment_n_m: Float[Array, "*batch"] = eqx.field(
        converter=as_float_array, default=MOST_MOMENT_N_M
    )

    def arrival_time_s(self, position_m: Float[Array, "... 3"]) -> Float[Array, "..."]:
        """Return when the push begins at places, a blast in each of the last axis."""
        return self.blasts.time_s + self.blasts.distance_m(position_m) / SPEED_M_S

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
        """
        distance = self.blasts.distance_m(state.position_m)
        share = self.blasts.shares(
            start_s,
            end_s,
            state,
            lambda r: r / SPEED_M_S,
            lambda since: jnp.clip(since / HELD_S, 0.0, 1.0),
        )
        mass = self.blasts.mass_kg
        force = coded_impulse(distance, mass) / MEANT_S
        moment = jnp.minimum(
            coded_angular_impulse(distance, mass) / MEANT_S, self.most_moment_n_m
        )
        toward = (self.blasts.position_m - state.position_m[None]) / distance[:, None]
        push, across = _directions(toward)
        held = share * HELD_S
        attitude = rotation(unit(four(state.quaternion)))
        turn = jnp.sum((held * moment)[:, None] * across, axis=0)
        return (
            jnp.sum((held * force)[:, None] * push, axis=0),
            jnp.stack(times_transposed(attitude, three(turn))),
        )


def coded_load(scene: Scene) -> CodedLoad:
    """Return the loads of a scene's blasts."""
    return CodedLoad(blasts_of(scene))


def _fitted(
    fit: tuple[float, float, float],
    distance_m: Float[Array, "..."],
    mass_kg: Float[Array, "..."],
) -> Float[Array, "..."]:
    root, power, rest = fit
    return root**2 * distance_m**power * mass_kg + rest


def _directions(
    toward: Float[Array, "blast 3"],
) -> tuple[Float[Array, "blast 3"], Float[Array, "blast 3"]]:
    """Return where the plugin's force points, and about what its moment turns.

    Args:
        toward: From the vehicle to each charge, of length 1.
    """
    x, y, z = toward.T
    level = jnp.sqrt(jnp.maximum(1.0 - z**2, 1e-12))
    sin_azimuth, cos_azimuth = y / level, x / level
    # with the polar angle in place of the azimuth, and that in place of it
    charge = jnp.stack([sin_azimuth * z, level**2, cos_azimuth], axis=-1)
    push = jnp.stack([sin_azimuth * z, -sin_azimuth * level, -cos_azimuth], axis=-1)
    across = jnp.cross(charge, push)
    length = jnp.linalg.norm(across, axis=-1, keepdims=True)
    return push, across / jnp.maximum(length, 1e-9)


def blasts_of(scene: Scene) -> Blasts:
    """Return a scene's charges."""
    charges = scene.charges
    return Blasts(
        jnp.stack([jnp.stack(charge.position_m) for charge in charges]),
        jnp.stack([charge.time_s for charge in charges]),
        jnp.stack([charge.tnt_mass("peak_overpressure_pa") for charge in charges]),
    )
