r"""A wave that steepens, exactly: smooth flow to measure the order of the scheme by.

A wave running to the right into gas at rest keeps each velocity on a straight path,
with $c = c_0 + \frac{\gamma-1}{2}u$ (Riemann 1860; Whitham 1974, section 6.8),

$$u(x,t) = u_0\big(x - (u+c)\,t\big), \quad \rho = \rho_0 (c/c_0)^{2/(\gamma-1)}, \quad
p = p_0 (c/c_0)^{2\gamma/(\gamma-1)}$$

until paths meet. Here $u_0 = A\cos^4(\pi x/2)$ within $|x| < 1$: four times smooth.
"""

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from jblast.types import as_float_array
from jblast.waves.euler.gas import IdealGas
from jblast.waves.euler.initial.shock_tube import start_tube
from jblast.waves.euler.state import Flow, FlowState, Primitives

AMPLITUDE = 0.1
"""Of the velocity, in speeds of sound: the first paths meet at t = 4.1."""
GAMMA = 1.4
REACH = (-2.0, 4.0)
"""The tube; the wave does not come to its end before t = 3."""
FIXED_POINT_STEPS = 60
"""Each leaves the share t/4.1 of the error: half at t = 2, 1e-18 of it in the end."""


def simple_wave(
    place: Float[Array, "..."], time: Float[Array, ""] | float
) -> Primitives:
    """Return the flow at places and a time, with density and sound speed 1 ahead."""

    def closer(_, velocity):
        start = place - (1.0 + (GAMMA + 1.0) / 2.0 * velocity) * time
        shape = jnp.cos(0.5 * jnp.pi * jnp.clip(start, -1.0, 1.0)) ** 4
        return AMPLITUDE * shape

    velocity = jax.lax.fori_loop(0, FIXED_POINT_STEPS, closer, jnp.zeros_like(place))
    sound = 1.0 + (GAMMA - 1.0) / 2.0 * velocity
    density = sound ** (2.0 / (GAMMA - 1.0))
    return Primitives(density, velocity, density**GAMMA / GAMMA)


def simple_wave_means(
    faces: Float[Array, " face"], time: Float[Array, ""] | float
) -> Primitives:
    """Return mean density, momentum over mass, and pressure of the mean energy."""
    nodes, weights = (
        jnp.asarray(array, faces.dtype) for array in np.polynomial.legendre.leggauss(6)
    )
    width = jnp.diff(faces)[:, None]
    flow = simple_wave(faces[:-1, None] + width * (nodes[None] + 1.0) / 2.0, time)
    density, momentum, kinetic, pressure = (
        jnp.sum(q * weights[None] / 2.0, axis=1)
        for q in (
            flow.density,
            flow.density * flow.velocity,
            0.5 * flow.density * flow.velocity**2,
            flow.pressure,
        )
    )
    velocity = momentum / density
    rest = kinetic - 0.5 * momentum * velocity
    return Primitives(density, velocity, pressure + (GAMMA - 1.0) * rest)


def start_simple_wave(
    cells: int, *, overtaking: float = 0.0, limited: bool = True
) -> tuple[Flow, FlowState]:
    """Return the wave in a tube.

    Args:
        cells: How many.
        overtaking: Mass flux through the faces halfway, in density times sound speed;
            it falls to zero at the ends.
        limited: Whether slopes are limited.
    """
    faces = as_float_array(jnp.linspace(*REACH, cells + 1))
    along = (faces - REACH[0]) / (REACH[1] - REACH[0])
    rate = overtaking * 4.0 * along * (1.0 - along)
    gas = IdealGas(jnp.asarray(GAMMA, faces.dtype))
    filled = simple_wave_means(faces, 0.0)
    return start_tube(faces, filled, gas, rate=rate, limited=limited)
