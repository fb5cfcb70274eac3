r"""A position hold with a disturbance observer in place of its integral.

What pushes a vehicle beside its own rotors is seen in its motion: with the velocity
$v$ of two turns a period $T$ apart and the pull of the rotors $u = \sum k \Omega^2 / m
\; R z - g z$ as they turn,

$$ \hat d \leftarrow \hat d + (1 - e^{-L T}) \left(\frac{v - v_{before}}{T} - u - \hat
d\right), $$

a first-order observer (Chen, Ballance, Gawthrop and O'Reilly 2000, eq. 9, with a gain
that does not depend on the state; here exact for a push that stays the same over a
turn). The hold asks for $-\hat d$ beside what its gains ask for, within its
`integral_limit`. A blast that throws the vehicle within a turn by $\Delta v$ makes
$\hat d = L \Delta v$, of which the sum over time is $\Delta v$: the observer brakes by
just what the blast gave.
"""

import dataclasses

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Float

from jblast.constants import FLIGHT_GRAVITY
from jblast.vehicle.control.gains import Gains
from jblast.vehicle.control.position_hold import Controller, PositionHold, Readied
from jblast.vehicle.dynamics.components import four, turned
from jblast.vehicle.dynamics.state import State
from jblast.vehicle.quadrotor.numbers import floats
from jblast.vehicle.quadrotor.parameters import Vehicle

OBSERVER_RATE = 4.0
"""Of named vehicles [1/s]: as quick as their holds brake sideways; declared."""


class Seen(eqx.Module):
    """What the observer remembers.

    Attributes:
        push_m_s2: Estimate of what pushes, world.
        velocity_m_s: At the turn before.
        begun: 1 from the first turn on, 0 before.
    """

    push_m_s2: Float[Array, "3"]
    velocity_m_s: Float[Array, "3"]
    begun: Float[Array, ""]


class ObservedHold(Readied):
    """Holds a place, and takes back what pushes.

    Attributes:
        hold: Where, and how hard; its integral gains are not used.
        observer_rate: $L$ [1/s].
    """

    hold: PositionHold
    observer_rate: Float[Array, ""] = eqx.field(converter=floats, default=OBSERVER_RATE)

    @property
    def gains(self) -> Gains:
        """Of the hold: by them the step is checked."""
        return self.hold.gains

    @property
    def target_m(self) -> Float[Array, "3"]:
        """Of the hold."""
        return self.hold.target_m

    def start(self) -> Seen:
        """Return what it remembers at the start: nothing."""
        none = jnp.zeros_like(self.hold.target_m)
        return Seen(none, none, jnp.zeros_like(none[0]))

    def ready(self, vehicle: Vehicle) -> Controller:
        """Return the same with its allocation inverted, once for a flight."""
        hold = self.hold
        without = dataclasses.replace(hold.gains, integral=0 * hold.gains.integral)
        hold = dataclasses.replace(hold, gains=without)
        return _Ready(self, hold.ready(vehicle))


class _Ready(eqx.Module):
    """An observed hold that need not invert its allocation at every turn."""

    whole: ObservedHold
    hold: Controller

    def start(self) -> Seen:
        return self.whole.start()

    def __call__(
        self,
        time_s: Float[Array, ""],
        state: State,
        vehicle: Vehicle,
        memory: Seen,
        period_s: Float[Array, ""],
    ) -> tuple[Float[Array, "4"], Seen]:
        gained = (state.velocity_m_s - memory.velocity_m_s) / period_s
        rest = gained - pull_of_rotors(state, vehicle) - memory.push_m_s2
        share = -jnp.expm1(-self.whole.observer_rate * period_s) * memory.begun
        push = memory.push_m_s2 + share * rest
        speeds, _ = self.hold(time_s, state, vehicle, -push, period_s)
        return speeds, Seen(push, state.velocity_m_s, jnp.ones_like(memory.begun))


def pull_of_rotors(state: State, vehicle: Vehicle) -> Float[Array, "3"]:
    """Return the acceleration that rotors in still air and the weight give [m/s2]."""
    speed = state.rotor_speed_rad_s
    thrust = vehicle.thrust_coefficient * jnp.sum(speed * speed) / vehicle.mass_kg
    zero = jnp.zeros_like(thrust)
    up = jnp.stack(turned(four(state.quaternion), (zero, zero, thrust)))
    return up.at[2].add(-FLIGHT_GRAVITY)
