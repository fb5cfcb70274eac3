r"""Fluxes through a face that overtakes mass: HLLC, seen from the mass.

Two waves of mass flux $Q_l$ and $Q_r$ leave the contact (Toro 2009, *Riemann Solvers
and Numerical Methods for Fluid Dynamics*, section 10.4, with $Q = \rho|S - u|$), where

$$u^* = \frac{Q_l u_l + Q_r u_r + p_l - p_r}{Q_l + Q_r}, \qquad
p^* = p_l + Q_l(u_l - u^*)$$

A wave is as fast as the shock that would take the whole difference in velocity,
$Q = \rho b + \sqrt{\rho\cdot\rho c^2 + (\rho b)^2}$ with
$b = s \max(u_l - u_r, 0)$ ($s$: `gas.py`): never too slow, so positivity is kept.

A face that stands in the gas is the contact: $u^*$, $p^*$, $p^*u^*$. One that overtakes
the mass flux $m \ge 0$ samples the star state outside the contact, or past
$m = Q_r$ the undisturbed one. Both are, with $\theta = \min(m/Q_r, 1)$,

$$\dot V = m/\rho_r + u^* - \theta(u^*-u_r), \quad
\dot P = m u_r - [p^* - \theta(p^*-p_r)], \quad
\dot E = m E_r - [p^*u^* - \theta(p^*u^* - p_ru_r)]$$

All is given through an area and in a time, whose product is called impulse here.
"""

from typing import NamedTuple

import jax.numpy as jnp
from jaxtyping import Array, Float

from jblast.waves.euler.gas import Gas
from jblast.waves.euler.state import Primitives


class Flux(NamedTuple):
    """What the cell inside a face gains through it.

    Attributes:
        volume: [m3]; what the face itself sweeps.
        momentum: [kg m/s].
        energy: [J].
    """

    volume: Float[Array, "..."]
    momentum: Float[Array, "..."]
    energy: Float[Array, "..."]


def wave_mass_flux(
    side: Primitives, approach: Float[Array, "..."], gas: Gas
) -> Float[Array, "..."]:
    r"""Return $Q$ of the wave that enters a side [kg/(m2 s)].

    Args:
        side: The state there.
        approach: $\max(u_l - u_r, 0)$ [m/s].
        gas: Of that side.
    """
    steep = side.density * (gas.shock_slope() * approach)
    sound = side.density * gas.stiffness(side.density, side.pressure)
    return steep + jnp.sqrt(sound + steep * steep)


def face_flux(
    left: Primitives,
    right: Primitives,
    overtaken: Float[Array, "..."],
    impulse: Float[Array, "..."],
    left_gas: Gas,
    right_gas: Gas,
) -> Flux:
    """Return what goes through faces.

    Args:
        left: State just inside.
        right: State just outside.
        overtaken: Mass that goes through the moving face [kg], not negative.
        impulse: Area of the face times time [m2 s].
        left_gas: The gas inside.
        right_gas: The gas outside.
    """
    approach = jnp.maximum(left.velocity - right.velocity, 0.0)
    q_l = wave_mass_flux(left, approach, left_gas)
    q_r = wave_mass_flux(right, approach, right_gas)
    u = (
        q_l * left.velocity + q_r * right.velocity + (left.pressure - right.pressure)
    ) / (q_l + q_r)
    p = left.pressure + q_l * (left.velocity - u)
    # A step of no length sweeps nothing: 0/0 is kept out, also of the derivative.
    most = jnp.where(impulse > 0.0, impulse, 1.0) * q_r
    theta = jnp.minimum(overtaken / most, 1.0)
    internal = right_gas.energy(right.density, right.pressure)
    carried = overtaken / right.density
    energy = internal * carried + 0.5 * overtaken * right.velocity * right.velocity
    return Flux(
        carried + impulse * (u - theta * (u - right.velocity)),
        overtaken * right.velocity - impulse * (p - theta * (p - right.pressure)),
        energy - impulse * (p * u - theta * (p * u - right.pressure * right.velocity)),
    )
