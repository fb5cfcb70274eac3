"""The Warp functions of the brake: those of the hold, without gains of the position."""

from jblast.vehicle import ControllerKernel
from jblast.vehicle.warp.position_hold import hold_functions, orders

KERNEL = ControllerKernel(
    functions=hold_functions,
    orders=lambda brake: orders(brake.damped()),
    refused=lambda brake: "",
)
