r"""Loads of a blast as printed in Parab's thesis and as computed by its plugin.

Both are provided for comparison only: the second is wrong, the first in part.

As printed (sections 3.4.1 and 4.3; the file is that of the public plugin):

- Arrival: Wu and Hao's air shock (eq. 3.4), as for the sound.
- Force: "the Friedlander waveform" (eq. 3.5), $P_s (1 - t/t^*) e^{-t/t^*}$ over its
  positive phase. Neither peak nor area is printed. Declared here: Kingery and Bulmash's
  peak and duration of a surface burst, and the vehicle's own projected area.
- Moment: that of its file of pressure data, whose two rows are 100 m times the force
  across body x, about a point far away. The file names no charge, so the moment is the
  same for all charges. Between the rows $M R^2$ is linear in $\ln R$, beyond them
  constant. It is applied with the force.

As computed: the model plugin of gazebo_blast3d (`e6dd04c`; GPL, so only its facts are
stated here and nothing is copied) waits for r over 300 m/s and then applies, for one
step of the simulator, 4 ms,

$$F = \frac{2.2116^2\,r^{-2.1604}\,Q + 0.0196}{1\,\mathrm{ms}}, \qquad
  M = \frac{4.8894^2\,r^{-0.0262}\,Q + 5.4295}{1\,\mathrm{ms}}$$

in metres, kilograms, newtons: impulses divided by 1 ms, so the applied impulse is four
times too large. Both were fitted to a file of two rows, whose moments are about a point
100 m away. The direction of the force has azimuth and polar angle exchanged; the moment
is perpendicular to it. The simulator's model limits the moment; the limit is not
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
from jblast.types import as_numbers
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
"""Angular impulses of the file about body x, y and z, one row per distance."""
WAVE_SPEED_M_S = 300.0
"""Wave speed of the plugin, for every charge."""
NOMINAL_PULSE_S, APPLIED_PULSE_S = 1e-3, 4e-3
"""Nominal duration of the plugin's pulse, and the step over which it is applied."""
FORCE, MOMENT = (2.2116, -2.1604, 0.0196), (4.8894, -0.0262, 5.4295)
"""Coefficients a, n, b of an impulse $a^2 r^n Q + b$ [N s], [N m s], in m and kg."""
MAX_MOMENT_N_M = 1.0
"""Limit of the moment; declared: a third of the Hummingbird's pitch authority."""
NEAREST_M = 0.1
"""Minimum distance in the laws, within any charge; it avoids a division by zero."""


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
    # `interp` is constant beyond the file, so there the moment falls as 1/R^2.
    log = jnp.log(distance_m)
    square = DISTANCES_M[:, None] ** 2
    columns = [
        jnp.interp(log, np.log(DISTANCES_M), column)
        for column in (MOMENTS_N_M_S * square).T
    ]
    return jnp.stack(columns, axis=-1) / jnp.square(distance_m)[..., None]


class Blasts(eqx.Module):
    """Charges; leading axes are those of a batch.

    Attributes:
        position_m: East, north, up.
        time_s: Time of detonation; infinite: it never happens.
        mass_kg: TNT mass.
    """

    position_m: Float[Array, "*batch blast 3"] = eqx.field(converter=as_numbers)
    time_s: Float[Array, "*batch blast"] = eqx.field(converter=as_numbers)
    mass_kg: Float[Array, "*batch blast"] = eqx.field(converter=as_numbers)

    @property
    def never(self) -> Bool[Array, "*batch blast"]:
        """True for charges that never detonate."""
        return jnp.isposinf(self.time_s)

    def distance_m(
        self, position_m: Float[Array, "... 3"]
    ) -> Float[Array, "... blast"]:
        """Return the distances between charges and positions [m]."""
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
        """Return the share of each pulse between two times.

        Shares of successive steps are differences of one function of time, so that
        their sum over all steps is 1, however the vehicle moves.

        Args:
            start_s: Beginning of the step.
            end_s: End of the step.
            state: State of the vehicle at the beginning; its velocity is constant.
            travel_s: Function from distance [m] to travel time of the wave [s].
            given: Function from time since arrival [s] to the share until then.
        """
        ahead = state.position_m + state.velocity_m_s * (end_s - start_s)
        time = jnp.where(self.never, 0.0, self.time_s)

        def until(now: Float[Array, ""], place: Float[Array, "3"]):
            return given(now - time - travel_s(self.distance_m(place)))

        share = until(end_s, ahead) - until(start_s, state.position_m)
        return jnp.where(self.never, 0.0, share)


class PrintedLoad(eqx.Module):
    """Pulse of a scene's blasts as printed in the thesis.

    Attributes:
        blasts: The charges.
        sound_speed_m_s: Speed of sound in the arrival law.
    """

    blasts: Blasts
    sound_speed_m_s: Float[Array, "*batch"] = eqx.field(
        converter=as_numbers, default=SOUND_SPEED_M_S
    )

    def arrival_time_s(self, position_m: Float[Array, "... 3"]) -> Float[Array, "..."]:
        """Return arrival times at positions; blasts along the last axis [s]."""
        return self.blasts.time_s + self._travel_s(self.blasts.distance_m(position_m))

    def impulse(
        self,
        start_s: Float[Array, ""],
        end_s: Float[Array, ""],
        state: State,
        vehicle: Vehicle,
    ) -> tuple[Float[Array, "3"], Float[Array, "3"]]:
        """Return the impulse on a vehicle between two times.

        Returns:
            Impulse, world [N s], and angular impulse, body [N m s].

        Raises:
            InputError: The vehicle has no `body`.
        """
        body = required_body(vehicle.body)
        blasts = self.blasts
        distance = blasts.distance_m(state.position_m)
        duration = kingery_bulmash_duration(distance, blasts.mass_kg)

        def given(since: Float[Array, " blast"]) -> Float[Array, " blast"]:
            # The integral of (1 - x) exp(-x) from 0 to x is x exp(-x), here divided by
            # its value at the end of the phase, 1/e.
            x = jnp.clip(since / duration, 0.0, 1.0)
            return x * jnp.exp(1.0 - x)  # 1 at the end of the positive phase

        share = blasts.shares(start_s, end_s, state, self._travel_s, given)
        away = (state.position_m[None] - blasts.position_m) / distance[:, None]
        attitude = rotation(unit(four(state.quaternion)))
        along = jnp.stack(
            [jnp.stack(times_transposed(attitude, three(one))) for one in away]
        )
        area = jnp.sqrt(
            # 1e-30 keeps the root's gradient finite for a body without area.
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
    """Return the nominal impulse [N s]; the plugin applies four times as much."""
    return _fitted(FORCE, distance_m, mass_kg)


def coded_angular_impulse(
    distance_m: Float[Array, "..."], mass_kg: Float[Array, "..."]
) -> Float[Array, "..."]:
    """Return the nominal angular impulse [N m s], without the limit of the moment."""
    return _fitted(MOMENT, distance_m, mass_kg)


class CodedLoad(eqx.Module):
    """Pulse of a scene's blasts as computed by the plugin.

    Attributes:
        blasts: The charges.
        most_moment_n_m: Limit of the moment.
    """

    blasts: Blasts
    most_moment_n_m: Float[Array, "*batch"] = eqx.field(
        converter=as_numbers, default=MAX_MOMENT_N_M
    )

    def arrival_time_s(self, position_m: Float[Array, "... 3"]) -> Float[Array, "..."]:
        """Return start times of the force; blasts along the last axis [s]."""
        return self.blasts.time_s + self.blasts.distance_m(position_m) / WAVE_SPEED_M_S

    def impulse(
        self,
        start_s: Float[Array, ""],
        end_s: Float[Array, ""],
        state: State,
        vehicle: Vehicle,
    ) -> tuple[Float[Array, "3"], Float[Array, "3"]]:
        """Return the impulse on a vehicle between two times.

        Returns:
            Impulse, world [N s], and angular impulse, body [N m s].
        """
        distance = self.blasts.distance_m(state.position_m)
        share = self.blasts.shares(
            start_s,
            end_s,
            state,
            lambda r: r / WAVE_SPEED_M_S,
            lambda since: jnp.clip(since / APPLIED_PULSE_S, 0.0, 1.0),
        )
        mass = self.blasts.mass_kg
        force = coded_impulse(distance, mass) / NOMINAL_PULSE_S
        moment = jnp.minimum(
            coded_angular_impulse(distance, mass) / NOMINAL_PULSE_S,
            self.most_moment_n_m,
        )
        toward = (self.blasts.position_m - state.position_m[None]) / distance[:, None]
        push, across = _directions(toward)
        duration = share * APPLIED_PULSE_S
        attitude = rotation(unit(four(state.quaternion)))
        turn = jnp.sum((duration * moment)[:, None] * across, axis=0)
        return (
            jnp.sum((duration * force)[:, None] * push, axis=0),
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
    """Return unit vectors of the plugin's force and of the axis of its moment.

    Args:
        toward: Unit vectors from the vehicle to each charge.
    """
    x, y, z = toward.T
    # The azimuth is undefined for a charge straight above or below; the floor avoids 0
    # / 0.
    level = jnp.sqrt(jnp.maximum(1.0 - z**2, 1e-12))
    sin_azimuth, cos_azimuth = y / level, x / level
    # The plugin exchanges azimuth and polar angle; reproduced here.
    charge = jnp.stack([sin_azimuth * z, level**2, cos_azimuth], axis=-1)
    push = jnp.stack([sin_azimuth * z, -sin_azimuth * level, -cos_azimuth], axis=-1)
    across = jnp.cross(charge, push)
    length = jnp.linalg.norm(across, axis=-1, keepdims=True)
    return push, across / jnp.maximum(length, 1e-9)


def blasts_of(scene: Scene) -> Blasts:
    """Return the charges of a scene with their TNT masses of equal pressure."""
    charges = scene.charges
    return Blasts(
        jnp.stack([jnp.stack(charge.position_m) for charge in charges]),
        jnp.stack([charge.time_s for charge in charges]),
        jnp.stack([charge.tnt_mass("peak_overpressure_pa") for charge in charges]),
    )
