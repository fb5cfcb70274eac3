"""Registry of the controllers of a vehicle, one record each.

A record is used by `jblast fly` (`controllers`), the tuning of gains and environments
for learners. State and command of a controller are
those of the class that `make` returns (`control.position_hold.Controller`): `start()`
returns the initial state, a call returns rotor speeds and the next state, and the
fields are gains. `register` adds a controller from any module.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from jblast.errors import InputError, require
from jblast.registry import Registry
from jblast.scene import VehicleSpec
from jblast.vehicle.control.cascade import Cascade
from jblast.vehicle.control.position_hold import (
    Gains,
    PositionHold,
    gains_from_parameters,
)
from jblast.vehicle.quadrotor import parameters_of


@dataclass(frozen=True, kw_only=True)
class ControllerKind:
    """Registry entry of one controller.

    Attributes:
        name: As in `jblast fly --controllers`.
        words: Adverbial phrase for reports: "with integral action".
        make: Function from the vehicle of a scene to a controller for its target and
            yaw, with a field `target_m` (east, north, up).
        with_gains: Function from target, gains and yaw to a controller with the loops
            of the SE(3) controller, whose gains can be tuned and whose target
            environments can move. It has the fields `target_m`, `gains` and
            `yaw_rad`, and its state is three numbers. None: the controller has other
            loops.
    """

    name: str
    words: str
    make: Callable[[VehicleSpec], Any]
    with_gains: Callable[[Any, Gains, Any], Any] | None = None


def hold_of(spec: VehicleSpec, *, integral: bool) -> PositionHold:
    """Return the SE(3) position controller for a vehicle's target and yaw.

    Args:
        spec: The vehicle; gains without a value are those of its model.
        integral: Whether the controller has integral action, regardless of the scene.

    Raises:
        InputError: A gain is invalid, or the vehicle flies a mission.
    """
    where, words = f"[vehicle] mission: {spec.mission}", "a vehicle without a mission"
    got = "one with a mission; jblast fly and world support missions"
    require(spec.mission is None, where, words, got)
    gains = parameters_of(spec.model) | spec.gains
    return PositionHold(
        target_m=spec.held,
        gains=gains_from_parameters(gains, integral=integral),
        yaw_rad=spec.yaw,
    )


def cascade_of(spec: VehicleSpec) -> Cascade:
    """Return PX4's cascade with the body-rate gain of the SE(3) controller.

    Raises:
        InputError: As `hold_of`.
    """
    hold = hold_of(spec, integral=False)
    return Cascade(hold.target_m, hold.gains.body_rate, hold.yaw_rad)


def controller_of(spec: VehicleSpec, name: str) -> Any:
    """Return a controller by name, for a vehicle's target and yaw.

    Args:
        spec: The vehicle.
        name: Name in `CONTROLLERS`.

    Raises:
        InputError: The name is unknown, or as `hold_of`.
    """
    return CONTROLLERS.named(name).make(spec)


def gains_controller(name: str) -> Callable[[Any, Gains, Any], Any]:
    """Return the `with_gains` of a controller.

    Raises:
        InputError: The name is unknown, or the controller has other loops.
    """
    made = CONTROLLERS.named(name).with_gains
    if made is None:
        with_them = [one for one, kind in CONTROLLERS.items() if kind.with_gains]
        raise InputError(
            f"controller {name!r}: expected a controller with the gains of the SE(3) "
            f"controller ({', '.join(with_them)}), got one with other loops"
        )
    return made


CONTROLLERS = Registry[ControllerKind](
    "controller",
    ControllerKind(
        name="with_integral",
        words="with integral action",
        make=lambda spec: hold_of(spec, integral=True),
        with_gains=PositionHold,
    ),
    ControllerKind(
        name="without_integral",
        words="without integral action",
        make=lambda spec: hold_of(spec, integral=False),
        with_gains=PositionHold,
    ),
    ControllerKind(
        name="cascade",
        words="by a cascade as PX4's",
        make=cascade_of,
    ),
)
"""Controllers by name: SE(3) with and without integral, and PX4's cascade."""
register = CONTROLLERS.register
