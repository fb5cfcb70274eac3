r"""Where a position hold really begins to swing up, against the limit that is claimed.

Near hover the loop knows times only as multiples of the step: a step longer by $s$ is
the same step on motors and gains faster by $s$, $\tau_m/s$, $s^2 k_p$, $s k_d$,
$s^2 k_R$, $s k_\omega$. So one program flies every vehicle at every step side by side.
"""

from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float

from jblast.errors import InputError
from jblast.vehicle import (
    Each,
    Gains,
    PositionHold,
    State,
    Vehicle,
    named,
    named_gains,
    simulate,
    step_limit,
)
from jblast.vehicle.quadrotor import PARAMETERS
from jblast.verification.stability.failure import FailureMode, verified

NAMES = tuple(PARAMETERS)
STEP = 1e-3
SHARES = np.append(np.linspace(0.9, 1.1, 21), np.arange(1.15, 2.01, 0.05))
"""Steps, as shares of the claimed limit."""
START = 1e-6
"""About the turn they start with [rad/s]."""
STEPS = 6000
EARLY, LATE = slice(15, 30), slice(45, 61)
"""Rows of a hundred steps between which a swing grows or dies away."""
HOME = (0.0, 0.0, 5.0)


class Swings(NamedTuple):
    """What became of small turns near hover.

    Attributes:
        limit_s: The claimed limits.
        early: Largest body rate in a stretch of each flight, at each share [rad/s].
        late: The same at its end; infinite where the flight is lost.
    """

    limit_s: Float[np.ndarray, " vehicle"]
    early: Float[np.ndarray, "vehicle share"]
    late: Float[np.ndarray, "vehicle share"]

    def up(self) -> Bool[np.ndarray, "vehicle share"]:
        """Return which swing up: rounding is left of those that died away."""
        grows = (self.late > self.early) & (self.late > 1e-3 * START)
        return grows | (self.late > 1e3 * START)


def hovering(vehicle: Vehicle, body_rate=(0.0, 0.0, 0.0)) -> State:
    """Return a vehicle level and at rest, but for a turn [rad/s]."""
    speed = jnp.sqrt(vehicle.mass_kg * 9.81 / 4 / vehicle.thrust_coefficient)
    level = jnp.array([0.0, 0.0, 0.0, 1.0])
    still, turn = jnp.zeros(3), jnp.asarray(body_rate)
    return State(jnp.asarray(HOME), still, level, turn, jnp.full(4, speed))


def quickened(gains: Gains, times: Float[Array, ""]) -> Gains:
    """Return gains of a loop so many times faster."""
    square = times * times
    return Gains(
        position=square * gains.position,
        velocity=times * gains.velocity,
        attitude=square * gains.attitude,
        body_rate=times * gains.body_rate,
        integral=square * times * gains.integral,
        integral_limit=gains.integral_limit,
    )


def swings(integrator: str) -> Swings:
    """Fly every named vehicle at every share of its limit, asked at every step.

    Args:
        integrator: "rk4" or "euler".
    """
    limits, vehicles, holds = [], [], []
    for name in NAMES:
        vehicle, gains = named(name), named_gains(name)
        limits.append(step_limit(integrator, float(vehicle.motor_lag_s), gains))
        for share in SHARES:
            times = jnp.asarray(share * limits[-1] / STEP)
            lag = vehicle.motor_lag_s / times
            bare = eqx.tree_at(lambda v: v.motor_lag_s, named(name), lag)
            vehicles.append(eqx.tree_at(lambda v: v.body, bare, None))
            holds.append(PositionHold(HOME, quickened(gains, times)))
    starts = [hovering(vehicle, (START, 2 * START, START)) for vehicle in vehicles]

    @jax.jit  # the steps past a limit fly only where the limit is not known
    def rates(fleet, starts, holds):
        flown = simulate(
            fleet,
            starts,
            duration_s=STEPS * STEP,
            step_s=STEP,
            integrator=integrator,
            control=Each(holds),
            store_every=100,
        )
        return jnp.linalg.norm(flown.body_rate_rad_s, axis=-1)

    spin = np.asarray(rates(stacked(vehicles), stacked(starts), stacked(holds)))
    # a lane that is lost has grown without end
    spin = np.where(np.isfinite(spin), spin, np.inf)
    early, late = (
        spin[:, rows].max(axis=1).reshape(len(NAMES), SHARES.size)
        for rows in (EARLY, LATE)
    )
    return Swings(np.array(limits), early, late)


def hold_failures() -> list[FailureMode]:
    """Measure where each vehicle's hold swings up, by either integrator."""
    return [
        mode
        for integrator, words in (("rk4", "RK4"), ("euler", "semi-implicit Euler"))
        for mode in _failures(integrator, words)
    ]


def _failures(integrator: str, words: str) -> list[FailureMode]:
    found, modes = swings(integrator), []
    for name, limit, up, late in zip(
        NAMES, found.limit_s, found.up(), found.late, strict=True
    ):
        first = int(np.argmax(up))
        last = "lost" if np.isinf(late[first + 1]) else f"{late[first + 1]:.1g} rad/s"
        kept = SHARES[first] > 0.99 and up[first:].any()
        kept = kept and _refused(name, integrator, limit)
        modes.append(
            FailureMode(
                area="flights",
                method=f"{name}, position hold, {words}",
                failure="a step too long: a turn of 1e-6 rad/s swings up",
                boundary=1e3 * float(limit * SHARES[first]),
                unit="ms",
                beyond=f"{1e3 * limit * SHARES[first + 1]:.3g} ms: {last} after "
                f"{STEPS:,} steps",
                response=verified("refuses", kept, f"{name}, {integrator}"),
                message=f"past {1e3 * limit:.4g} ms, motors' and loop's eigenvalues, "
                "with that limit",
            )
        )
    return modes


def _refused(name: str, integrator: str, limit: float) -> bool:
    """Whether a step just past a limit is refused, and one just within it is not."""
    vehicle, hold = named(name), PositionHold(HOME, named_gains(name))

    def flies(step: float) -> bool:
        try:
            simulate(
                vehicle,
                hovering(vehicle),
                duration_s=step,
                step_s=step,
                integrator=integrator,
                control=hold,
            )
        except InputError:
            return False
        return True

    return flies(0.999 * limit) and not flies(1.001 * limit)


def stacked(trees: list) -> Any:
    """Return trees with the same leaves as one, a row each; names are dropped."""
    first = jax.tree.structure(trees[0])
    leaves = [
        jnp.stack(part) for part in zip(*map(jax.tree.leaves, trees), strict=True)
    ]
    return jax.tree.unflatten(first, leaves)
