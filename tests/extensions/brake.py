"""A controller that brakes: it damps velocities and keeps no position."""

from dataclasses import replace

import equinox as eqx

from jblast.vehicle import CONTROLLERS, ControllerKind, hold_of
from jblast.vehicle.control.position_hold import PositionHold, PreparedController


class Brake(PreparedController):
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

    def ready(self, vehicle):
        """Return the same with its allocation inverted, once for a flight."""
        return self.damped().ready(vehicle)

    def damped(self):
        """Return the hold with the gains that are left."""
        gains = self.hold.gains
        none = eqx.tree_at(lambda g: g.position, gains, 0.0 * gains.position)
        return replace(self.hold, gains=none)


CONTROLLERS.register(
    ControllerKind(
        name="brake",
        words="by a brake",
        make=lambda spec: Brake(hold_of(spec, integral=False)),
        type=Brake,
    )
)
