r"""Riemann's problem in an ideal gas, solved exactly: the reference, and a start.

Toro (2009), *Riemann Solvers and Numerical Methods for Fluid Dynamics*, chapter 4. The
velocity that each side takes at a pressure $p$ differs from its own by (eqs. 4.6, 4.7)

$$f(p) = (p-p_k)\sqrt{\frac{A_k}{p+B_k}} \;\; (p>p_k), \qquad
f(p) = \frac{2c_k}{\gamma-1}\left[\left(\frac{p}{p_k}\right)^{\frac{\gamma-1}{2\gamma}}
- 1\right] \;\; (p\le p_k)$$

with $A = 2/((\gamma+1)\rho)$ and $B = p_k(\gamma-1)/(\gamma+1)$; $p^*$ solves
$f_l + f_r + u_r - u_l = 0$ (eq. 4.5).
"""

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from jblast.waves.euler.state import IdealGas, Primitives

NEWTON_STEPS = 30
"""Concave and rising, so Newton from below arrives; from ln p it does so for any."""


def _difference(pressure, side: Primitives, gamma):
    """Return $f$ [m/s]."""
    sound = jnp.sqrt(gamma * side.pressure / side.density)
    a = 2.0 / ((gamma + 1.0) * side.density)
    b = side.pressure * (gamma - 1.0) / (gamma + 1.0)
    shock = (pressure - side.pressure) * jnp.sqrt(a / (pressure + b))
    power = (gamma - 1.0) / (2.0 * gamma)
    fan = 2.0 * sound / (gamma - 1.0) * ((pressure / side.pressure) ** power - 1.0)
    return jnp.where(pressure > side.pressure, shock, fan)


def star_state(
    left: Primitives, right: Primitives, gas: IdealGas
) -> tuple[Float[Array, ""], Float[Array, ""]]:
    """Return pressure [Pa] and velocity [m/s] at the contact.

    Args:
        left: State on the left.
        right: State on the right; the two do not draw apart so fast as to leave vacuum.
        gas: On both sides.
    """

    def apart(log_pressure):
        pressure = jnp.exp(log_pressure)
        waves = [_difference(pressure, side, gas.gamma) for side in (left, right)]
        return waves[0] + waves[1] + right.velocity - left.velocity

    def closer(_, log_pressure):
        value, slope = jax.jvp(apart, (log_pressure,), (jnp.ones_like(log_pressure),))
        return log_pressure - value / slope

    start = jnp.log(jnp.minimum(left.pressure, right.pressure))
    pressure = jnp.exp(jax.lax.fori_loop(0, NEWTON_STEPS, closer, start))
    pull = _difference(pressure, right, gas.gamma)
    push = _difference(pressure, left, gas.gamma)
    velocity = 0.5 * (left.velocity + right.velocity + pull - push)
    return pressure, velocity


def riemann_profile(
    left: Primitives,
    right: Primitives,
    gas: IdealGas,
    speed: Float[Array, "..."],
) -> Primitives:
    """Return the solution along rays.

    Args:
        left: State on the left.
        right: State on the right.
        gas: On both sides.
        speed: Of the rays, distance from the first interface over time [m/s].
    """
    pressure, velocity = star_state(left, right, gas)
    inside = [
        _side(state, sign, pressure, velocity, gas.gamma, speed)
        for state, sign in ((left, 1.0), (right, -1.0))
    ]
    at_left = speed < velocity
    return Primitives(*(jnp.where(at_left, a, b) for a, b in zip(*inside, strict=True)))


def _side(side: Primitives, sign, pressure, velocity, gamma, speed):
    """Return what rays on one side of the contact meet, the right side mirrored."""
    xi, u, star = sign * speed, sign * side.velocity, sign * velocity
    sound = jnp.sqrt(gamma * side.pressure / side.density)
    ratio = pressure / side.pressure
    weak = (gamma - 1.0) / (gamma + 1.0)
    # a shock, eqs. 4.50 and 4.52
    front = u - sound * jnp.sqrt(
        (gamma + 1.0) / (2.0 * gamma) * ratio + (gamma - 1.0) / (2.0 * gamma)
    )
    dense = side.density * (ratio + weak) / (weak * ratio + 1.0)
    # or a fan, eqs. 4.53 to 4.56
    thin = side.density * ratio ** (1.0 / gamma)
    tail = star - sound * ratio ** ((gamma - 1.0) / (2.0 * gamma))
    within = jnp.maximum(2.0 / (gamma + 1.0) + weak / sound * (u - xi), 1e-12)
    fan = Primitives(
        side.density * within ** (2.0 / (gamma - 1.0)),
        2.0 / (gamma + 1.0) * (sound + (gamma - 1.0) / 2.0 * u + xi),
        side.pressure * within ** (2.0 * gamma / (gamma - 1.0)),
    )
    is_shock = pressure > side.pressure
    undisturbed = xi < jnp.where(is_shock, front, u - sound)
    behind = Primitives(jnp.where(is_shock, dense, thin), star, pressure)
    at_star = is_shock | (xi > tail)
    met = [
        jnp.where(undisturbed, q, jnp.where(at_star, s, f))
        for q, s, f in zip((side.density, u, side.pressure), behind, fan, strict=True)
    ]
    return Primitives(met[0], sign * met[1], met[2])
