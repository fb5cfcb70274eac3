r"""The largest step at which a flight near hover is stable.

Motors: $\dot\Omega = -\Omega/\tau_m$ decays under RK4 while
$|1 + z + z^2/2 + z^3/6 + z^4/24| < 1$, $z = -h/\tau_m$: up to $h = 2.785\,\tau_m$;
under Euler while $|1 - h/\tau_m| < 1$: up to $2\,\tau_m$.

Position hold: near hover it falls apart into three chains of integrals, each driven by
what the controller asks for and holds over its period, through the motors' lag,
$\dot a = (a_{cmd} - a)/\tau_m$:

- sideways: $\dot x = v$, $\dot v = g\theta$, $\dot\theta = \omega$, $\dot\omega = a$;
- upward: $\dot x = v$, $\dot v = a$; heading: $\dot\theta = \omega$, $\dot\omega = a$.

Over a period each is a matrix, the integrator's own steps and then the controller's
answer; the loop is stable while no eigenvalue is longer than 1. Far from hover, in
saturation or at great attitude errors a stable step can still be a coarse one.
"""

from functools import lru_cache

import numpy as np

from jblast.constants import FLIGHT_GRAVITY
from jblast.vehicle.control.gains import Gains

MOTOR_LIMIT = {"rk4": 2.785293563405282, "euler": 2.0}
"""Largest step over the motors' lag: where the growth of a step is 1."""


def step_limit(
    integrator: str, motor_lag_s: float, gains: Gains | None = None, held: int = 1
) -> float:
    """Return the largest stable step [s].

    A loop that is unstable at any step is not the step's fault: then the motors' limit
    is returned.

    Args:
        integrator: "rk4" or "euler".
        motor_lag_s: Of the motors [s].
        gains: Of the position hold; None for flight without.
        held: Steps over which the controller's answer is held.
    """
    motors = MOTOR_LIMIT[integrator] * motor_lag_s
    if gains is None:
        return motors
    asked = (gains.position, gains.velocity, gains.integral)
    numbers = (*asked, gains.attitude, gains.body_rate, gains.lead)
    by_value = tuple(float(x) for part in numbers for x in np.ravel(part))
    return _hold_limit(integrator, float(motor_lag_s), by_value, held)


@lru_cache(maxsize=64)
def _hold_limit(
    integrator: str, motor_lag_s: float, numbers: tuple[float, ...], held: int
) -> float:
    """Return the limit with a position hold: a search, kept for the next flight.

    Args:
        integrator: "rk4" or "euler".
        motor_lag_s: Of the motors [s].
        numbers: Of the gains: position, velocity, integral, attitude, body rate,
            and the motors' lead.
        held: Steps over which the controller's answer is held.
    """
    position, velocity, integral = np.reshape(numbers[:9], (3, 3))
    attitude, body_rate, lead = numbers[9:]
    gains = Gains(position, velocity, attitude, body_rate, integral, motor_lead=lead)
    motors, links = MOTOR_LIMIT[integrator] * motor_lag_s, chains(gains, motor_lag_s)

    def grows(step: float) -> bool:
        return growth(integrator, links, step, held) > 1 + 1e-9

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


def growth(integrator: str, chains: list, step: float, held: int) -> float:
    """Return the longest eigenvalue of a period of the closed loop.

    Args:
        integrator: "rk4" or "euler".
        chains: Rates and feedback of each chain.
        step: Of the integrator [s].
        held: Steps of a period.
    """
    longest = 0.0
    for matrix, feedback, integral in chains:
        size = len(matrix)
        advance = np.linalg.matrix_power(_advance(integrator, matrix, step), held)
        # state, integral: the integral takes this turn's error before it answers
        total = np.eye(size + 1)
        total[size, 0] = -integral * step * held
        command = np.append(feedback, 1.0) @ total
        period = np.zeros((size + 1, size + 1))
        period[:size, :size] = advance[:size, :size]
        period[:size] += np.outer(advance[:size, size], command)
        period[size] = total[size]
        longest = max(longest, np.abs(np.linalg.eigvals(period)).max())
    return float(longest)


def chains(gains: Gains, lag: float) -> list:
    """Return the rates of each chain, its command last, and what is fed back of it.

    Args:
        gains: Of the position hold.
        lag: Of the motors [s].
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
        tilt = k_r / g  # of the command per acceleration asked for
        back = np.array([-k_p[axis] * tilt, -k_d[axis] * tilt, -k_r, -k_w, 0.0])
        found.append((_integrals([1.0, g, 1.0, 1.0], lag), back, k_i[axis] * tilt))
    return [
        (rates, np.append(lead * back[:-1], 1 - lead), lead * integral)
        for rates, back, integral in found
    ]


def _integrals(links: list[float], lag: float) -> np.ndarray:
    """Rates of a chain of integrals that ends in a lag; last, of the command."""
    size = len(links) + 1
    rates = np.diag(np.append(links, 0.0)[: size - 1], 1)
    rates[-1, -1] = -1 / lag
    return np.hstack([rates, np.append(np.zeros(size - 1), 1 / lag)[:, None]])


def _advance(integrator: str, rates: np.ndarray, step: float) -> np.ndarray:
    """Matrix of one step on chain and command, which stays."""
    size = len(rates)
    square = np.vstack([rates, np.zeros(size + 1)])
    z, one = step * square, np.eye(size + 1)
    if integrator == "rk4":
        return one + z @ (one + z / 2 @ (one + z / 3 @ (one + z / 4)))
    total = one + z
    # place and angle move on with the new velocity and rate
    for n in range(0, size - 1, 2):
        total[n] = one[n] + z[n, n + 1] * total[n + 1]
    return total
