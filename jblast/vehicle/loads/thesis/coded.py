r"""The load of a blast as the thesis's plugin computes it: wrong, and kept to compare.

The model plugin of gazebo_blast3d (`e6dd04c`; GPL, so its facts are told here and
nothing is copied) waits r/300 m/s and then pushes for one step of the simulator, 4 ms,
with

$$F = \frac{2.2116^2\,r^{-2.1604}\,Q + 0.0196}{1\,\mathrm{ms}}, \qquad
  M = \frac{4.8894^2\,r^{-0.0262}\,Q + 5.4295}{1\,\mathrm{ms}}$$

metres, kilograms, newtons: impulses meant for 1 ms, so that four times as much is
given. Both were fitted to a file of two rows, whose moments are about a point 100 m
away. The force points where azimuth and polar angle, exchanged, send it; the moment
stands across that. A limit that the simulator's model names cuts the moment; its value
is not published, so that ours is declared.

Not taken over: that the push begins at a step of the simulator (here, as the wave
comes), and that the distance is that of the announcement (here, of the moment).
"""

import equinox as eqx
import jax.numpy as jnp
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
from jblast.vehicle.quadrotor.parameters import Vehicle

SPEED_M_S = 300.0
"""Of the plugin's wave, whatever the charge."""
MEANT_S, HELD_S = 1e-3, 4e-3
"""Over how long the impulse is meant to be given, and how long it is."""
FORCE, MOMENT = (2.2116, -2.1604, 0.0196), (4.8894, -0.0262, 5.4295)
"""a, n and b of an impulse $a^2 r^n Q + b$: N s and N m s of metres and kilograms."""
MOST_MOMENT_N_M = 1.0
"""Declared: a third of what the Hummingbird's rotors can do about its y axis."""


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
