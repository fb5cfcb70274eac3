r"""A plan as a table of legs: arrays, so that a batch flies a batch of plans.

A leg is a path of constant curvature, straight or circular:
$p(s) = p_0 + t\,\sin(\kappa s)/\kappa + n\,(1 - \cos \kappa s)/\kappa$, with the
velocity along $t\cos\kappa s + n\sin\kappa s$. The table of a plan is padded with legs
that are never entered, because its last leg is a landing or a hold without end.
"""

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float, Int

from jblast.types import as_float_array


class Legs(eqx.Module):
    r"""Legs, in the order in which they are flown.

    Attributes:
        start_m: $p_0$: east, north, up.
        along: $t$: unit vector.
        inward: $n$: unit vector to the middle of the circle; zero: straight.
        curvature_per_m: $\kappa$.
        length_m: To its end.
        speed_m_s: Most on the way.
        end_speed_m_s: Most at its end, so that what follows can be braked for.
        goal_m: The waypoint.
        acceptance_m: How near the vehicle must come to it.
        hold_s: How long it stays there; infinite: for ever.
        yaw_rad: Heading from east to north; NaN: as it is.
        waits: Whether the set point stops at its end until the vehicle has come and
            stayed; else it passes.
        lands: Whether it ends on the ground.
        visit: Which item it belongs to, as they are flown, from 0.
    """

    start_m: Float[Array, "*batch leg 3"] = eqx.field(converter=as_float_array)
    along: Float[Array, "*batch leg 3"] = eqx.field(converter=as_float_array)
    inward: Float[Array, "*batch leg 3"] = eqx.field(converter=as_float_array)
    curvature_per_m: Float[Array, "*batch leg"] = eqx.field(converter=as_float_array)
    length_m: Float[Array, "*batch leg"] = eqx.field(converter=as_float_array)
    speed_m_s: Float[Array, "*batch leg"] = eqx.field(converter=as_float_array)
    end_speed_m_s: Float[Array, "*batch leg"] = eqx.field(converter=as_float_array)
    goal_m: Float[Array, "*batch leg 3"] = eqx.field(converter=as_float_array)
    acceptance_m: Float[Array, "*batch leg"] = eqx.field(converter=as_float_array)
    hold_s: Float[Array, "*batch leg"] = eqx.field(converter=as_float_array)
    yaw_rad: Float[Array, "*batch leg"] = eqx.field(converter=as_float_array)
    waits: Bool[Array, "*batch leg"] = eqx.field(converter=jnp.asarray)
    lands: Bool[Array, "*batch leg"] = eqx.field(converter=jnp.asarray)
    visit: Int[Array, "*batch leg"] = eqx.field(
        converter=lambda x: jnp.asarray(x, jnp.int32)
    )

    @property
    def count(self) -> int:
        """Legs in the table, padding included."""
        return self.length_m.shape[-1]

    def padded(self, count: int) -> "Legs":
        """Return the table with its last leg repeated up to so many.

        The last is never left, so what stands behind it is never flown.
        """
        missing = count - self.count
        if missing < 0:
            raise ValueError(f"expected at least {self.count} legs, got {count}")
        widths = {1: [(0, missing)], 2: [(0, missing), (0, 0)]}
        return Legs(
            *(
                np.pad(np.asarray(getattr(self, name)), widths[dims], mode="edge")
                for name, dims in FIELDS.items()
            )
        )


FIELDS = {
    "start_m": 2,
    "along": 2,
    "inward": 2,
    "curvature_per_m": 1,
    "length_m": 1,
    "speed_m_s": 1,
    "end_speed_m_s": 1,
    "goal_m": 2,
    "acceptance_m": 1,
    "hold_s": 1,
    "yaw_rad": 1,
    "waits": 1,
    "lands": 1,
    "visit": 1,
}
"""Of `Legs`, with their number of axes without a batch."""


def point_on(
    legs: Legs, leg: Int[Array, ""], along_m: Float[Array, ""]
) -> tuple[Float[Array, "3"], Float[Array, "3"], Float[Array, "3"]]:
    """Return a point of a leg, the way there, and the way to the circle's middle.

    Args:
        legs: One plan's.
        leg: Which.
        along_m: From its start [m].
    """
    curvature = legs.curvature_per_m[leg]
    is_round = curvature > 0
    bend = jnp.where(is_round, curvature, 1.0)
    angle = curvature * along_m
    sine, cosine = jnp.sin(angle), jnp.cos(angle)
    ahead = jnp.where(is_round, sine / bend, along_m)
    aside = jnp.where(is_round, (1 - cosine) / bend, 0.0)
    tangent, normal = legs.along[leg], legs.inward[leg]
    place = legs.start_m[leg] + ahead * tangent + aside * normal
    way = cosine * tangent + sine * normal
    return place, way, cosine * normal - sine * tangent
