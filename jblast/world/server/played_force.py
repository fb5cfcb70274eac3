"""The force of a packet as a load: what a client without laws of its own flies by."""

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Float

from jblast.types import as_float_array
from jblast.vehicle import State, Vehicle
from jblast.world.server.payload import Packet


class PlayedForce(eqx.Module):
    """A pulse of forces that were staged, whatever the vehicle does meanwhile.

    Attributes:
        rows: Force, world [N], and moment, body [N m], of each step.
        rate_hz: Steps a second; the first begins with the flight.
    """

    rows: Float[Array, "step 6"] = eqx.field(converter=as_float_array)
    rate_hz: Float[Array, ""] = eqx.field(converter=as_float_array)

    def impulse(
        self,
        start_s: Float[Array, ""],
        end_s: Float[Array, ""],
        state: State,
        vehicle: Vehicle,
    ) -> tuple[Float[Array, "3"], Float[Array, "3"]]:
        """Return what is given between two times: impulse and angular impulse."""
        edges = jnp.arange(self.rows.shape[0] + 1, dtype=float) / self.rate_hz
        until = jnp.clip(end_s, edges[:-1], edges[1:])
        since = jnp.clip(start_s, edges[:-1], edges[1:])
        given = (until - since) @ self.rows
        return given[:3], given[3:]


def played_force(packet: Packet, packets_hz: float) -> PlayedForce:
    """Return the force of a packet, for a flight as long as it.

    Args:
        packet: Of one who senses force.
        packets_hz: Packets a second.
    """
    assert packet.force is not None, "who senses force is sent it"
    rate = packet.force.rate_hz
    rows = jnp.asarray(packet.force.samples)
    if not rows.size:
        rows = jnp.zeros((round(rate / packets_hz), 6))
    return PlayedForce(rows, jnp.asarray(rate))
