"""A controller that brakes: it damps velocities and keeps no position."""

from dataclasses import replace

import equinox as eqx
import jax.numpy as jnp

from jblast.vehicle import CONTROLLERS, ControllerKind, PositionHold, hold_of


class Brake(eqx.Module):
    """The SE(3) hold without its gains of the position.

    Attributes:
        hold: The hold; its target is the position that errors are measured from.
    """

    hold: PositionHold

    @property
    def target_m(self):
        """East, north, up [m]."""
        return self.hold.target_m

    def start(self):
        """Return the state at the start."""
        return self.hold.start()

    def __call__(self, time_s, state, vehicle, memory, period_s):
        """Return rotor speeds [rad/s] and the next state."""
        none = replace(self.hold.gains, position=jnp.zeros(3))
        return replace(self.hold, gains=none)(time_s, state, vehicle, memory, period_s)


CONTROLLERS.register(
    ControllerKind(
        name="brake",
        words="by a brake",
        make=lambda spec: Brake(hold_of(spec, integral=False)),
    )
)
