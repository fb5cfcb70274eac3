r"""Stability margins of the position hold near hover, as functions of its gains.

Near hover the hold falls apart into the chains of `step_limit.py`. Each loop is broken
where the rotors are commanded, behind the motors' lag $\tau_m$ and a dead time $T$:

- sideways: $L(s) = \frac{e^{-sT}}{\tau_m s + 1}
  \left[\frac{k_\omega}{s} + \frac{k_R}{s^2}
  + k_R\left(\frac{k_d}{s^3} + \frac{k_p}{s^4} + \frac{k_i}{s^5}\right)\right]$;
- upward: $\left[\frac{k_d}{s} + \frac{k_p}{s^2} + \frac{k_i}{s^3}\right]$;
- heading: $\left[\frac{k_\omega}{s} + \frac{k_R}{s^2}\right]$, each with the same lag.

With a lead $\lambda$ of the motors (`motor_lead.py`) the brackets are $\lambda$ times
as large, and $\lambda - 1$ more: the rotors' own speed is fed back, too.

A command that is held over a period is late by half of it, on the whole. Margins of a
loop: by what the rotors' answer may grow, or shrink, before it swings for ever, where
$L$ is real and negative; and by what angle it may lag, where $|L| = 1$ (Skogestad and
Postlethwaite 2005, section 2.4). They are found between the frequencies of a fine grid
and are differentiable; they say nothing unless the loop is stable (`is_stable`).
"""

from typing import NamedTuple

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float

from jblast.vehicle.control.gains import Gains
from jblast.vehicle.control.step_limit import chains, growth

LOOPS = ("east", "north", "upward", "heading")
FREQUENCY = np.geomspace(1e-3, 1e5, 6001)
"""Of the grid [rad/s]; 750 a decade."""


class Margins(NamedTuple):
    """Margins of loops; infinite: nothing of the kind makes the loop swing.

    Attributes:
        up_db: By what the answer of the rotors may grow [dB].
        down_db: By what it may shrink [dB].
        phase_deg: By what it may lag, or lead [degrees].
        distance: Least of $|1 + L|$.
    """

    up_db: Float[Array, "*loop"]
    down_db: Float[Array, "*loop"]
    phase_deg: Float[Array, "*loop"]
    distance: Float[Array, "*loop"]

    @property
    def gain_db(self) -> Float[Array, "*loop"]:
        """By what the answer of the rotors may grow or shrink [dB]."""
        return jnp.minimum(self.up_db, self.down_db)


def hold_margins(
    gains: Gains, motor_lag_s: Float[Array, ""] | float, dead_time_s: float
) -> Margins:
    """Return the margins of a hold's loops, in the order of `LOOPS`.

    Args:
        gains: Of the hold.
        motor_lag_s: Of the motors [s].
        dead_time_s: Of each loop: half the period over which a command is held, and
            whatever else delays it [s].
    """
    return loop_margins(*hold_loops(gains, motor_lag_s, dead_time_s))


def hold_loops(
    gains: Gains, motor_lag_s: Float[Array, ""] | float, dead_time_s: float
) -> tuple[Float[Array, "loop frequency"], Float[Array, "loop frequency"]]:
    """Return ln of |L|, and the angle of -L [rad], at the frequencies of the grid.

    Args:
        gains: Of the hold.
        motor_lag_s: Of the motors [s].
        dead_time_s: Of each loop [s].
    """
    k_p, k_d, k_i = gains.position, gains.velocity, gains.integral
    k_r, k_w = gains.attitude, gains.body_rate
    none = jnp.zeros_like(k_r)
    rows = [[k_w, k_r, k_r * k_d[n], k_r * k_p[n], k_r * k_i[n]] for n in (0, 1)]
    rows.append([k_d[2], k_p[2], k_i[2], none, none])
    rows.append([k_w, k_r, none, none, none])
    w = jnp.asarray(FREQUENCY, k_r.dtype)[None, :]
    # of L i w: the powers of 1 / (i w) are 1, -i, -1, i, 1 over those of w
    factors = gains.lead * jnp.moveaxis(jnp.asarray(rows), 1, 0)[..., None]
    one, two, three, four, five = factors
    real = one - three / w**2 + five / w**4
    imaginary = (gains.lead - 1) * w - two / w + four / w**3
    lag = motor_lag_s * w
    size = 0.5 * jnp.log(real**2 + imaginary**2) - jnp.log(w) - 0.5 * jnp.log1p(lag**2)
    # -L = i (i w L) / w
    angle = jnp.arctan2(imaginary, real) + jnp.pi / 2 - jnp.arctan(lag)
    angle = angle - dead_time_s * w
    return size, angle - 2 * jnp.pi * jnp.round(angle / (2 * jnp.pi))


def loop_margins(
    size: Float[Array, "loop frequency"], angle: Float[Array, "loop frequency"]
) -> Margins:
    """Return the margins of loops.

    Args:
        size: ln of |L| along rising frequencies.
        angle: Of -L, within half a turn [rad].
    """
    decibels = 20 / jnp.log(10.0)
    at_one = _between(size, angle)
    phase = _least(jnp.abs(at_one.value), at_one.crosses)
    # a jump from one end of the angles to the other is no crossing
    near = jnp.abs(angle[..., 1:] - angle[..., :-1]) < jnp.pi
    at_real = _between(angle, size)
    crosses = at_real.crosses & near
    up = _least(-at_real.value, crosses & (at_real.value < 0))
    down = _least(at_real.value, crosses & (at_real.value >= 0))
    big = jnp.exp(jnp.minimum(size, 20.0))
    away = (big - 1) ** 2 + 4 * big * jnp.sin(angle / 2) ** 2
    return Margins(
        decibels * up,
        decibels * down,
        jnp.degrees(phase),
        jnp.sqrt(jnp.min(away, axis=-1)),
    )


def is_stable(gains: Gains, motor_lag_s: float, period_s: float) -> bool:
    """Whether the hold comes back near hover, asked over and over again.

    Args:
        gains: Of the hold.
        motor_lag_s: Of the motors [s].
        period_s: Over which its answer is held [s].
    """
    # an integral without a gain stays where it is: it grows by 1
    longest = growth("rk4", chains(gains, float(motor_lag_s)), period_s, 1)
    return longest <= 1 + 1e-9


class _Crossings(NamedTuple):
    crosses: Bool[Array, "loop place"]
    value: Float[Array, "loop place"]


def _between(
    zero: Float[Array, "loop frequency"], value: Float[Array, "loop frequency"]
) -> _Crossings:
    """Return where one curve crosses zero, and what another is there."""
    before, after = zero[..., :-1], zero[..., 1:]
    crosses = (before < 0) != (after < 0)
    rise = jnp.where(crosses, after - before, 1.0)
    share = jnp.where(crosses, -before / rise, 0.0)
    low, high = value[..., :-1], value[..., 1:]
    return _Crossings(crosses, low + share * (high - low))


def _least(
    values: Float[Array, "loop place"], some: Bool[Array, "loop place"]
) -> Float[Array, " loop"]:
    return jnp.min(jnp.where(some, values, jnp.inf), axis=-1)
