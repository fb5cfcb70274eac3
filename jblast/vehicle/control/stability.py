r"""Stability of the SE(3) position controller near hover: margins and step limit.

Near hover the controlled vehicle decouples into chains of integrals. Each is driven by
the command, constant over the controller's period, through the motors' lag, $\dot a =
(a_{cmd} - a)/\tau_m$:

- sideways: $\dot x = v$, $\dot v = g\theta$, $\dot\theta = \omega$, $\dot\omega = a$;
- upward: $\dot x = v$, $\dot v = a$; heading: $\dot\theta = \omega$, $\dot\omega = a$.

Largest step. Over a period each chain is a matrix: the integrator's own steps, then the
controller's command. The loop is stable while no eigenvalue exceeds 1 in magnitude. The
motors alone, $\dot\Omega = -\Omega/\tau_m$, decay under RK4 while
$|1 + z + z^2/2 + z^3/6 + z^4/24| < 1$, $z = -h/\tau_m$, up to $h = 2.785\,\tau_m$.
Far from hover, in saturation or at large attitude errors, a stable step can still be
too coarse.

Margins. Each loop is broken where the rotors are commanded, behind the lag $\tau_m$ and
a dead time $T$:

- sideways: $L(s) = \frac{e^{-sT}}{\tau_m s + 1}
  \left[\frac{k_\omega}{s} + \frac{k_R}{s^2}
  + k_R\left(\frac{k_d}{s^3} + \frac{k_p}{s^4} + \frac{k_i}{s^5}\right)\right]$;
- upward: $\left[\frac{k_d}{s} + \frac{k_p}{s^2} + \frac{k_i}{s^3}\right]$;
- heading: $\left[\frac{k_\omega}{s} + \frac{k_R}{s^2}\right]$, each with the same lag.

With a motor lead $\lambda$ (`allocation.lead_compensated`) the brackets are $\lambda$
times as large, and $\lambda - 1$ more, because the rotors' own speed is fed back. A
command that is constant over a period is late by half of it on average. The gain margin
is the factor by which the rotors' response may grow or shrink before the loop
oscillates, where $L$ is real and negative; the phase margin is the angle by which it
may lag, where $|L| = 1$ (Skogestad and Postlethwaite 2005, section 2.4). Margins are
interpolated between the frequencies of a fine grid and are differentiable. They are
meaningless unless the loop is stable (`decay_rate`).
"""

from functools import lru_cache
from typing import NamedTuple

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float

from jblast.constants import FLIGHT_GRAVITY
from jblast.vehicle.control.position_hold import Gains

LOOPS = ("east", "north", "upward", "heading")
FREQUENCY = np.geomspace(1e-3, 1e5, 6001)
"""Frequency grid [rad/s], 750 points per decade.

Margins are interpolated between points 0.3 % apart. The range spans eight decades
around the loops' crossover frequencies of 1 to 100 rad/s.
"""
MOTOR_LIMIT = 2.785293563405282
"""Step over motor lag at which the growth factor of a step is 1."""


class Margins(NamedTuple):
    """Stability margins of loops; infinite if the loop has no such limit.

    Attributes:
        up_db: Gain margin of a growing rotor response [dB].
        down_db: Gain margin of a shrinking rotor response [dB].
        phase_deg: Phase margin, of lag or lead [degrees].
        distance: Minimum of $|1 + L|$ [-].
    """

    up_db: Float[Array, "*loop"]
    down_db: Float[Array, "*loop"]
    phase_deg: Float[Array, "*loop"]
    distance: Float[Array, "*loop"]

    @property
    def gain_db(self) -> Float[Array, "*loop"]:
        """The smaller of both gain margins [dB]."""
        return jnp.minimum(self.up_db, self.down_db)


def hold_margins(
    gains: Gains, motor_lag_s: Float[Array, ""] | float, dead_time_s: float
) -> Margins:
    """Return the stability margins of a controller's loops, in the order of `LOOPS`.

    Args:
        gains: Controller gains.
        motor_lag_s: Time constant of the motors [s].
        dead_time_s: Dead time of each loop: half the controller's period and all other
            delays [s].
    """
    return loop_margins(*hold_loops(gains, motor_lag_s, dead_time_s))


def hold_loops(
    gains: Gains, motor_lag_s: Float[Array, ""] | float, dead_time_s: float
) -> tuple[Float[Array, "loop frequency"], Float[Array, "loop frequency"]]:
    """Return ln of |L|, and the angle of -L [rad], at the frequencies of the grid.

    Args:
        gains: Controller gains.
        motor_lag_s: Time constant of the motors [s].
        dead_time_s: Dead time of each loop [s].
    """
    k_p, k_d, k_i = gains.position, gains.velocity, gains.integral
    k_r, k_w = gains.attitude, gains.body_rate
    none = jnp.zeros_like(k_r)
    rows = [[k_w, k_r, k_r * k_d[n], k_r * k_p[n], k_r * k_i[n]] for n in (0, 1)]
    rows.append([k_d[2], k_p[2], k_i[2], none, none])
    rows.append([k_w, k_r, none, none, none])
    w = jnp.asarray(FREQUENCY, k_r.dtype)[None, :]
    # Numerator of i w L: the powers of 1 / (i w) are 1, -i, -1, i, 1 over those of w.
    factors = gains.lead * jnp.moveaxis(jnp.asarray(rows), 1, 0)[..., None]
    one, two, three, four, five = factors
    real = one - three / w**2 + five / w**4
    imaginary = (gains.lead - 1) * w - two / w + four / w**3
    lag = motor_lag_s * w
    # In logarithms, because |L| spans 40 decades over the grid.
    size = 0.5 * jnp.log(real**2 + imaginary**2) - jnp.log(w) - 0.5 * jnp.log1p(lag**2)
    # The angle of -L = i (i w L) / w is zero where L is real and negative.
    angle = jnp.arctan2(imaginary, real) + jnp.pi / 2 - jnp.arctan(lag)
    angle = angle - dead_time_s * w
    return size, angle - 2 * jnp.pi * jnp.round(angle / (2 * jnp.pi))


def loop_margins(
    size: Float[Array, "loop frequency"], angle: Float[Array, "loop frequency"]
) -> Margins:
    """Return the margins of loops.

    Args:
        size: ln of |L| at increasing frequencies.
        angle: Angle of -L, within half a turn [rad].
    """
    decibels = 20 / jnp.log(10.0)
    at_one = _between(size, angle)
    phase = _least(jnp.abs(at_one.value), at_one.crosses)
    # A jump by a whole turn, where the angle wraps around, is not a crossing.
    near = jnp.abs(angle[..., 1:] - angle[..., :-1]) < jnp.pi
    at_real = _between(angle, size)
    crosses = at_real.crosses & near
    up = _least(-at_real.value, crosses & (at_real.value < 0))
    down = _least(at_real.value, crosses & (at_real.value >= 0))
    # Far above 1, |1 + L| is about |L| and never the minimum: the cap only avoids
    # overflow.
    big = jnp.exp(jnp.minimum(size, 20.0))
    away = (big - 1) ** 2 + 4 * big * jnp.sin(angle / 2) ** 2
    return Margins(
        decibels * up,
        decibels * down,
        jnp.degrees(phase),
        jnp.sqrt(jnp.min(away, axis=-1)),
    )


def decay_rate(gains: Gains, motor_lag_s: float, period_s: float) -> float:
    """Return the decay rate of the controlled vehicle near hover, by its slowest mode.

    It is negative if the vehicle is unstable.

    Args:
        gains: Controller gains.
        motor_lag_s: Time constant of the motors [s].
        period_s: Period of the controller [s].
    """
    # An unused integral stays constant: its eigenvalue is 1, up to rounding.
    largest = growth(chains(gains, float(motor_lag_s)), period_s, 1)
    return (1 + 1e-9 - largest) / period_s


class _Crossings(NamedTuple):
    crosses: Bool[Array, "loop place"]
    value: Float[Array, "loop place"]


def _between(
    zero: Float[Array, "loop frequency"], value: Float[Array, "loop frequency"]
) -> _Crossings:
    """Return the zero crossings of one curve and the values of another there."""
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


def step_limit(motor_lag_s: float, gains: Gains | None = None, held: int = 1) -> float:
    """Return the largest stable step [s].

    A loop that is unstable at any step has no such limit; then the limit of the motors
    alone is returned.

    Args:
        motor_lag_s: Time constant of the motors [s].
        gains: Controller gains; None for flights without a controller.
        held: Steps per controller period.
    """
    motors = MOTOR_LIMIT * motor_lag_s
    if gains is None:
        return motors
    by_axis = (gains.position, gains.velocity, gains.integral)
    numbers = (*by_axis, gains.attitude, gains.body_rate, gains.lead)
    by_value = tuple(float(x) for part in numbers for x in np.ravel(part))
    return _controlled_limit(float(motor_lag_s), by_value, held)


# Flights of one study share gains and steps, and the search solves some 150 eigenvalue
# problems for each chain.
@lru_cache(maxsize=64)
def _controlled_limit(
    motor_lag_s: float, numbers: tuple[float, ...], held: int
) -> float:
    """Return the largest stable step with a position controller [s].

    Args:
        motor_lag_s: Time constant of the motors [s].
        numbers: Gains: position, velocity, integral, attitude, body rate, motor lead.
        held: Steps per controller period.
    """
    position, velocity, integral = np.reshape(numbers[:9], (3, 3))
    attitude, body_rate, lead = numbers[9:]
    gains = Gains(position, velocity, attitude, body_rate, integral, motor_lead=lead)
    motors, links = MOTOR_LIMIT * motor_lag_s, chains(gains, motor_lag_s)

    def grows(step: float) -> bool:
        return growth(links, step, held) > 1 + 1e-9

    # A grid first, because stability need not be monotonic in the step: the first
    # unstable step counts. Bisection then resolves the limit to 2**-30 of a grid
    # interval.
    steps = motors * np.geomspace(1e-3 / held, 1, 120)
    if grows(steps[0]):
        return motors
    above = next((n for n, step in enumerate(steps) if grows(step)), None)
    if above is None:
        return motors
    stable, unstable = steps[above - 1], steps[above]
    for _ in range(30):
        middle = (stable + unstable) / 2
        stable, unstable = (stable, middle) if grows(middle) else (middle, unstable)
    return float(stable)


def growth(chains: list, step: float, held: int) -> float:
    """Return the largest eigenvalue magnitude of a period of the closed loop.

    Args:
        chains: Rates and feedback of each chain.
        step: Step of the integrator [s].
        held: Steps per controller period.
    """
    largest = 0.0
    for matrix, feedback, integral in chains:
        size = len(matrix)
        advance = np.linalg.matrix_power(_advance(matrix, step), held)
        # State and integral: the integral adds this sample's error before the command.
        total = np.eye(size + 1)
        total[size, 0] = -integral * step * held
        command = np.append(feedback, 1.0) @ total
        period = np.zeros((size + 1, size + 1))
        period[:size, :size] = advance[:size, :size]
        period[:size] += np.outer(advance[:size, size], command)
        period[size] = total[size]
        largest = max(largest, np.abs(np.linalg.eigvals(period)).max())
    return float(largest)


def chains(gains: Gains, lag: float) -> list:
    """Return rates (command in the last column), feedback and integral of each chain.

    Args:
        gains: Controller gains.
        lag: Time constant of the motors [s].
    """
    k_p, k_d, k_i = (
        np.asarray(x, float) for x in (gains.position, gains.velocity, gains.integral)
    )
    k_r, k_w, g = float(gains.attitude), float(gains.body_rate), FLIGHT_GRAVITY
    lead = float(gains.lead)
    found = [(_integrals([1.0, 1.0], lag), np.array([-k_r, -k_w, 0.0]), 0.0)]
    found.append(
        (_integrals([1.0, 1.0], lag), np.array([-k_p[2], -k_d[2], 0.0]), k_i[2])
    )
    for axis in (0, 1):
        tilt = k_r / g  # command per commanded acceleration: the tilt is a / g
        back = np.array([-k_p[axis] * tilt, -k_d[axis] * tilt, -k_r, -k_w, 0.0])
        found.append((_integrals([1.0, g, 1.0, 1.0], lag), back, k_i[axis] * tilt))
    return [
        (rates, np.append(lead * back[:-1], 1 - lead), lead * integral)
        for rates, back, integral in found
    ]


def _integrals(links: list[float], lag: float) -> np.ndarray:
    """Rates of a chain of integrals behind a lag; the last column is the command's."""
    size = len(links) + 1
    rates = np.diag(np.append(links, 0.0)[: size - 1], 1)
    rates[-1, -1] = -1 / lag
    return np.hstack([rates, np.append(np.zeros(size - 1), 1 / lag)[:, None]])


def _advance(rates: np.ndarray, step: float) -> np.ndarray:
    """Matrix of one step on chain and command, which is constant."""
    size = len(rates)
    square = np.vstack([rates, np.zeros(size + 1)])
    z, one = step * square, np.eye(size + 1)
    return one + z @ (one + z / 2 @ (one + z / 3 @ (one + z / 4)))
