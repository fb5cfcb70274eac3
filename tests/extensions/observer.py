r"""The SE(3) hold with a disturbance observer in place of its integral.

The disturbance follows from the motion, with the velocity $v$ of two samples a period
$T$ apart and the acceleration by rotors and weight
$u = \sum k \Omega^2 / m \; R z - g z$,

$$ \hat d \leftarrow \hat d + (1 - e^{-L T}) \left(\frac{v - v_{before}}{T} - u - \hat
d\right), $$

a first-order observer (Chen, Ballance, Gawthrop and O'Reilly 2000, eq. 9, with a gain
that does not depend on the state; exact for a force that is constant over a period).
The controller adds $-\hat d$ to its command, within its `integral_limit`. A blast that
changes the velocity within a period by $\Delta v$ gives $\hat d = L \Delta v$, whose
integral over time is $\Delta v$. The observer thus cancels exactly the velocity that
the blast added.
"""

import dataclasses

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Float

from jblast.constants import FLIGHT_GRAVITY
from jblast.vehicle import (
    CONTROLLERS,
    ControllerKind,
    Gains,
    PositionHold,
    State,
    Vehicle,
    hold_of,
)
from jblast.vehicle.quadrotor import floats
from jblast.vehicle.state import four, turned

OBSERVER_RATE = 4.0
"""Observer rate of named vehicles [1/s]; declared.

The value of their horizontal velocity gain: a faster observer amplifies noise of the
velocity, a slower one compensates a blast later than the controller brakes.
"""


class ObserverState(eqx.Module):
    """State of the disturbance observer between two samples.

    Attributes:
        push_m_s2: Estimate of the disturbance, world axes.
        velocity_m_s: Velocity at the previous sample.
        begun: 1 from the first sample on, 0 before.
    """

    push_m_s2: Float[Array, "3"]
    velocity_m_s: Float[Array, "3"]
    begun: Float[Array, ""]


class ObservedHold(eqx.Module):
    """Position controller that compensates an estimated disturbance.

    Attributes:
        hold: Target and gains; its integral gains are not used.
        observer_rate: $L$ [1/s].
    """

    hold: PositionHold
    observer_rate: Float[Array, ""] = eqx.field(converter=floats, default=OBSERVER_RATE)

    @property
    def gains(self) -> Gains:
        """Gains of the position controller; the step limit depends on them."""
        return self.hold.gains

    @property
    def target_m(self) -> Float[Array, "3"]:
        """Target of the position controller: east, north, up [m]."""
        return self.hold.target_m

    def start(self) -> ObserverState:
        """Return the observer's state at the start: zeros."""
        none = jnp.zeros_like(self.hold.target_m)
        return ObserverState(none, none, jnp.zeros_like(none[0]))

    def __call__(
        self,
        time_s: Float[Array, ""],
        state: State,
        vehicle: Vehicle,
        memory: ObserverState,
        period_s: Float[Array, ""],
    ) -> tuple[Float[Array, "4"], ObserverState]:
        """Return rotor speed commands [rad/s], shape (4,), and the next state."""
        gained = (state.velocity_m_s - memory.velocity_m_s) / period_s
        rest = gained - pull_of_rotors(state, vehicle) - memory.push_m_s2
        # Exact for a constant disturbance at any period; `begun` masks the first
        # sample, which has no velocity before it.
        share = -jnp.expm1(-self.observer_rate * period_s) * memory.begun
        push = memory.push_m_s2 + share * rest
        # The estimate takes the place of the integral, so that its limits apply to
        # both; with both, a steady wind would be compensated twice.
        without = dataclasses.replace(self.gains, integral=0 * self.gains.integral)
        hold = dataclasses.replace(self.hold, gains=without)
        speeds, _ = hold(time_s, state, vehicle, -push, period_s)
        return speeds, ObserverState(
            push, state.velocity_m_s, jnp.ones_like(memory.begun)
        )


def pull_of_rotors(state: State, vehicle: Vehicle) -> Float[Array, "3"]:
    """Return the acceleration by rotors in still air and weight [m/s2], world axes."""
    speed = state.rotor_speed_rad_s
    thrust = vehicle.thrust_coefficient * jnp.sum(speed * speed) / vehicle.mass_kg
    zero = jnp.zeros_like(thrust)
    up = jnp.stack(turned(four(state.quaternion), (zero, zero, thrust)))
    return up.at[2].add(-FLIGHT_GRAVITY)


CONTROLLERS.register(
    ControllerKind(
        name="observer",
        words="with an observer",
        make=lambda spec: ObservedHold(hold_of(spec, integral=False)),
    )
)
