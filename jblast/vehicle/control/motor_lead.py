r"""Motors that are asked for more than is wanted, so that they answer sooner.

A motor that lags, $\dot\Omega = (\Omega_{cmd} - \Omega) / \tau_m$, is asked for

$$\Omega_{cmd} = \Omega + \lambda\,(\Omega_{wanted} - \Omega),$$

with its own speed, which a speed controller that reports revolutions tells; then it
goes as one of the lag $\tau_m / \lambda$, as long as the command is one that it can
have. Above the greatest speed and below the least it is cut, and the motor lags as
before. Errors of the speed told are made $\lambda - 1$ times as large.
"""

import jax.numpy as jnp
from jaxtyping import Array, Float

from jblast.vehicle.quadrotor.parameters import Vehicle


def led(
    vehicle: Vehicle,
    lead: Float[Array, ""],
    speeds: Float[Array, "4"],
    wanted: Float[Array, "4"],
) -> Float[Array, "4"]:
    r"""Return the rotor speeds to ask for [rad/s], within their limits.

    Args:
        vehicle: The vehicle.
        lead: $\lambda$, 1 and more.
        speeds: Of the rotors as they turn [rad/s].
        wanted: Of them [rad/s].
    """
    asked = speeds + lead * (wanted - speeds)
    slow, fast = vehicle.rotor_speed_min_rad_s, vehicle.rotor_speed_max_rad_s
    return jnp.minimum(jnp.maximum(asked, slow), fast)
