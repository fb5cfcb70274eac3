"""Controllers of a vehicle: one record for each, by name.

A record holds what `jblast fly` (`controllers`), the tuning of gains, environments for
learners and the choice between JAX and Warp need to know of a controller. Its state and
its command are those of the class `make` returns (`control.position_hold.Controller`):
`start()` is the state, a call gives rotor speeds and the next state, and the fields are
its gains. `register` adds a controller from any module.
"""

from collections.abc import Callable
from dataclasses import dataclass
from types import SimpleNamespace
from typing import Any, NamedTuple

from jaxtyping import Array, Float

from jblast.errors import InputError
from jblast.lazy import resolved
from jblast.registry import Registry
from jblast.scene import VehicleSpec
from jblast.vehicle.control.cascade import Cascade
from jblast.vehicle.control.position_hold import (
    NAMED_GAINS,
    Gains,
    ObservedHold,
    PositionHold,
    gains_from_parameters,
)


class ControllerKernel(NamedTuple):
    """A controller as Warp functions.

    Attributes:
        functions: From `wp.float32` or `wp.float64` to `order_of(rows, lane)` and
            `hold(vehicle, order, motion, state, period)`, as in
            `warp.position_hold.hold_functions`. The state is three numbers, zero at
            the start.
        orders: From a controller to the rows that `order_of` reads, (..., row).
        refused: From a controller to the option that the functions do not have, in
            words; "" where they fly it.
    """

    functions: Callable[[Any], SimpleNamespace]
    orders: Callable[[Any], Float[Array, "*batch row"]]
    refused: Callable[[Any], str]


@dataclass(frozen=True, kw_only=True)
class ControllerKind:
    """All that the package needs to know of one controller.

    Attributes:
        name: As in `jblast fly --controllers`.
        words: Adverbial phrase for reports: "with integral action".
        make: From the vehicle of a scene to the controller of its target and yaw, which
            has a `target_m`, east, north, up.
        type: Class of the controllers that `make` returns.
        with_gains: From target, gains and yaw to such a controller, if it has the loops
            of the SE(3) hold, so that their gains can be tuned and environments can
            move its target: then `ready` returns a module whose field `hold` is the
            controller with its `target_m`, `gains` and `yaw_rad`, and its state is
            three numbers. None: neither.
        kernel: Its Warp functions (`ControllerKernel`) or their place; None: JAX flies
            it on every device.
    """

    name: str
    words: str
    make: Callable[[VehicleSpec], Any]
    type: type
    with_gains: Callable[[Any, Gains, Any], Any] | None = None
    kernel: ControllerKernel | str | None = None


def hold_of(spec: VehicleSpec, *, integral: bool) -> PositionHold:
    """Return the hold of its target and yaw.

    Args:
        spec: The vehicle; gains it does not name are its model's.
        integral: Whether the hold has integral action, whatever gains the scene has.

    Raises:
        InputError: A gain cannot be used, or the vehicle flies a mission.
    """
    if spec.mission is not None:
        raise InputError(
            f"[vehicle] mission: {spec.mission}: expected a vehicle that holds its "
            "place, got one with a mission, which jblast fly flies and nothing else "
            "does yet"
        )
    gains = NAMED_GAINS[spec.model] | spec.gains
    if not integral:
        gains = {name: value for name, value in gains.items() if name != "ki_pos"}
    return PositionHold(
        target_m=spec.held,
        gains=gains_from_parameters(gains),
        yaw_rad=spec.yaw,
    )


def cascade_of(spec: VehicleSpec) -> Cascade:
    """Return PX4's cascade for its target and yaw, with the hold's gain of body rates.

    Raises:
        InputError: As `hold_of`.
    """
    hold = hold_of(spec, integral=False)
    return Cascade(hold.target_m, hold.gains.body_rate, hold.yaw_rad)


def controller_of(spec: VehicleSpec, name: str) -> Any:
    """Return a controller for its target and yaw.

    Args:
        spec: The vehicle.
        name: Of `CONTROLLERS`.

    Raises:
        InputError: There is none of that name, or as `hold_of`.
    """
    return CONTROLLERS.named(name).make(spec)


def gains_controller(name: str) -> Callable[[Any, Gains, Any], Any]:
    """Return the `with_gains` of a controller.

    Raises:
        InputError: There is none of that name, or it has other loops.
    """
    made = CONTROLLERS.named(name).with_gains
    if made is None:
        with_them = [one for one, kind in CONTROLLERS.items() if kind.with_gains]
        raise InputError(
            f"controller {name!r}: expected one with the gains of an SE(3) hold, "
            f"{', '.join(with_them)}; got one with other loops"
        )
    return made


def kernel_of(controller: Any) -> ControllerKernel | None:
    """Return the Warp functions of a controller, imported now; None: it has none."""
    for kind in CONTROLLERS.values():
        # a subclass may do something else
        if kind.kernel is not None and type(controller) is kind.type:
            return resolved(kind.kernel)
    return None


CONTROLLERS = Registry[ControllerKind](
    "controller",
    ControllerKind(
        name="with_integral",
        words="with integral action",
        make=lambda spec: hold_of(spec, integral=True),
        type=PositionHold,
        with_gains=PositionHold,
        kernel="jblast.vehicle.warp.position_hold:KERNEL",
    ),
    ControllerKind(
        name="without_integral",
        words="without integral action",
        make=lambda spec: hold_of(spec, integral=False),
        type=PositionHold,
        with_gains=PositionHold,
        kernel="jblast.vehicle.warp.position_hold:KERNEL",
    ),
    ControllerKind(
        name="cascade",
        words="by a cascade as PX4's",
        make=cascade_of,
        type=Cascade,
    ),
    ControllerKind(
        name="observer",
        words="with an observer",
        make=lambda spec: ObservedHold(hold_of(spec, integral=False)),
        type=ObservedHold,
    ),
)
"""By name: the SE(3) hold with its integral or without, PX4's cascade, the SE(3) hold
with a disturbance observer; `register` adds one from any module."""
register = CONTROLLERS.register
