"""The charges of a load, side by side, as a vehicle meets them within a step."""

from collections.abc import Callable

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float

from jblast.scene import Scene
from jblast.types import as_float_array
from jblast.vehicle.dynamics.state import State
from jblast.waves.paths import slant_range

NEAREST_M = 0.1
"""Nearer than that everything is as it is there."""


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


def blasts_of(scene: Scene) -> Blasts:
    """Return a scene's charges."""
    charges = scene.charges
    return Blasts(
        jnp.stack([jnp.stack(charge.position_m) for charge in charges]),
        jnp.stack([charge.time_s for charge in charges]),
        jnp.stack([charge.tnt_mass("peak_overpressure_pa") for charge in charges]),
    )
