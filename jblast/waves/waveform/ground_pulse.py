r"""The pulse of a P wave in the ground: displacement and its slope, velocity.

$$s(t) = A\,u^2 e^{-u}, \qquad \dot s(t) = \frac{A}{\tau}\,u\,(2 - u)\,e^{-u}, \qquad
u = (t - t_0)/\tau \ge 0$$

the shortest pulse of this kind that begins without a step of the velocity and comes
back to rest. The shape is our choice: two numbers are known of the pulse, and it has
exactly these. The displacement is largest at $u = 2$, the velocity at
$u = 2 - \sqrt 2$, so a peak displacement $D$ and a peak velocity $v$ make

$$A = \frac{e^2}{4} D, \qquad
\tau = (2\sqrt 2 - 2)\,e^{\sqrt 2 - 2} \frac{A}{v} = 0.852 \frac{D}{v}$$
"""

import math
from typing import NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Array, ArrayLike, Float

from jblast.types import as_float_array, as_float_arrays

AMPLITUDE_OVER_PEAK = math.exp(2.0) / 4.0
FASTEST = (2.0 * math.sqrt(2.0) - 2.0) * math.exp(math.sqrt(2.0) - 2.0)
r"""Peak velocity over $A/\tau$ [-]."""


class GroundPulse(NamedTuple):
    r"""One pulse, or many: fields broadcast.

    Attributes:
        arrival_time: When it begins $t_0$ [s]; infinite if it never comes.
        amplitude: $A$ [m].
        time_constant: $\tau$ [s].
    """

    arrival_time: Float[Array, "..."]
    amplitude: Float[Array, "..."]
    time_constant: Float[Array, "..."]


@jax.jit
def ground_pulse_of(
    arrival_time: Float[ArrayLike, "..."],
    displacement: Float[ArrayLike, "..."],
    velocity: Float[ArrayLike, "..."],
) -> GroundPulse:
    """Return the pulse that has a peak displacement and a peak velocity.

    Args:
        arrival_time: When it begins [s].
        displacement: Peak displacement [m]; with a velocity of zero it has to be zero.
        velocity: Peak velocity [m/s].
    """
    arrival_time, displacement, velocity = as_float_arrays(
        arrival_time, displacement, velocity
    )
    amplitude = AMPLITUDE_OVER_PEAK * displacement
    moves = velocity > 0.0
    tau = FASTEST * amplitude / jnp.where(moves, velocity, 1.0)
    return GroundPulse(arrival_time, amplitude, jnp.where(moves, tau, 1.0))


@jax.jit
def ground_pulse_displacement(
    pulse: GroundPulse, time: Float[ArrayLike, "..."]
) -> Float[Array, "..."]:
    """Return the displacement at some instants [m]; zero before the arrival."""
    u = _since_arrival(pulse, time) / pulse.time_constant
    return pulse.amplitude * u**2 * jnp.exp(-u)


@jax.jit
def ground_pulse_velocity(
    pulse: GroundPulse, time: Float[ArrayLike, "..."]
) -> Float[Array, "..."]:
    """Return the velocity at some instants [m/s]; zero before the arrival."""
    u = _since_arrival(pulse, time) / pulse.time_constant
    return pulse.amplitude / pulse.time_constant * u * (2.0 - u) * jnp.exp(-u)


@jax.jit
def ground_pulse_velocity_mean(
    pulse: GroundPulse,
    start: Float[ArrayLike, "..."],
    stop: Float[ArrayLike, "..."],
) -> Float[Array, "..."]:
    r"""Return the mean velocity between two instants [m/s].

    The difference of the displacements, written so that nothing cancels:

    $$s(u + \delta) - s(u) = A\,e^{-u}\left[u^2 (e^{-\delta} - 1)
      + (2 u \delta + \delta^2)\,e^{-\delta}\right]$$

    Args:
        pulse: The pulse.
        start: Beginnings [s].
        stop: Ends [s], after them.
    """
    start, stop = as_float_arrays(start, stop)
    first = _since_arrival(pulse, start)
    # of a sample that holds the arrival only what comes after it counts
    inside = jnp.minimum(_since_arrival(pulse, stop), stop - start)
    u, delta = first / pulse.time_constant, inside / pulse.time_constant
    rise = u**2 * jnp.expm1(-delta) + (2.0 * u + delta) * delta * jnp.exp(-delta)
    return pulse.amplitude * jnp.exp(-u) * rise / (stop - start)


def _since_arrival(
    pulse: GroundPulse, time: Float[ArrayLike, "..."]
) -> Float[Array, "..."]:
    return jnp.maximum(as_float_array(time) - pulse.arrival_time, 0.0)
