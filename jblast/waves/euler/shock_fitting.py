r"""The fitted shock: how fast it runs into still air, from what pushes it.

The flow behind reaches the front along a characteristic that carries
$J = p + Z u$ with $Z = \rho c$. Across the front, in an ideal gas at rest,

$$\frac{p}{P_0} = 1 + \frac{2\gamma}{\gamma+1}(M^2-1), \qquad
u = \frac{2c_0}{\gamma+1}\left(M - \frac1M\right)$$

and $p(M) + Z u(M) = J$ decides the Mach number $M$ by Newton's method: the solution of
the Riemann problem between the flow and the air, with its inner wave an acoustic one
(Toro 2009, section 9.3). What is behind the front at its face is extrapolated from the
last three cells, third order.
"""

from typing import NamedTuple

import jax.numpy as jnp
from jaxtyping import Array, Float

from jblast.waves.euler.gas import Gas
from jblast.waves.euler.state import Ambient, Primitives

NEWTON_STEPS = 3
"""From the Mach number of the extrapolated pressure, third order itself."""
WEAKEST = 1e-9
"""Of $p/P_0 - 1$ for the first guess: Newton needs M above 0, not above 1."""


class Front(NamedTuple):
    """The shock, or what stands for it at a wall.

    Attributes:
        speed: [m/s].
        pressure: Behind it [Pa].
        velocity: Behind it [m/s].
    """

    speed: Float[Array, "..."]
    pressure: Float[Array, "..."]
    velocity: Float[Array, "..."]


def extrapolated(means: Float[Array, "cell ..."]) -> Float[Array, "..."]:
    """Return the value at the outer face of a parabola with the last three means."""
    return (11.0 * means[-1] - 7.0 * means[-2] + 2.0 * means[-3]) / 6.0


def jump(
    mach: Float[Array, "..."], ambient: Ambient
) -> tuple[Float[Array, "..."], Float[Array, "..."]]:
    """Return pressure [Pa] and velocity [m/s] behind a shock of a Mach number."""
    gamma, sound = ambient.gas.gamma, sound_speed(ambient)
    rise = 2.0 * gamma / (gamma + 1.0) * (mach - 1.0) * (mach + 1.0)
    velocity = 2.0 * sound / (gamma + 1.0) * (mach - 1.0) * (mach + 1.0) / mach
    return ambient.pressure * (1.0 + rise), velocity


def sound_speed(ambient: Ambient) -> Float[Array, "..."]:
    """Return the speed of sound ahead [m/s]."""
    return jnp.sqrt(ambient.gas.gamma * ambient.pressure / ambient.density)


def fitted_front(cells: Primitives, gas: Gas, ambient: Ambient) -> Front:
    """Return the shock that the outermost cells drive.

    Args:
        cells: Means of the cells.
        gas: Of the last cells.
        ambient: The still air ahead.
    """
    behind = Primitives(*(extrapolated(q) for q in cells))
    # Right after a start the parabola may overshoot; the last mean is always positive.
    good = jnp.minimum(behind.density, behind.pressure) > 0.0
    behind = Primitives(
        *(jnp.where(good, q, means[-1]) for q, means in zip(behind, cells, strict=True))
    )
    stiffness = gas.stiffness(behind.density, behind.pressure)
    impedance = jnp.sqrt(behind.density * stiffness)
    drive = behind.pressure + impedance * behind.velocity
    gamma, sound = ambient.gas.gamma, sound_speed(ambient)
    rise = jnp.maximum(behind.pressure / ambient.pressure - 1.0, WEAKEST)
    mach = jnp.sqrt(1.0 + (gamma + 1.0) / (2.0 * gamma) * rise)
    for _ in range(NEWTON_STEPS):
        pressure, velocity = jump(mach, ambient)
        slope = ambient.pressure * 4.0 * gamma * mach + impedance * 2.0 * sound * (
            1.0 + 1.0 / (mach * mach)
        )
        away = pressure + impedance * velocity - drive
        mach = mach - (gamma + 1.0) * away / slope
    pressure, velocity = jump(mach, ambient)
    return Front(mach * sound, pressure, velocity)
