"""What a step adds to a state, and what rounding leaves over (Kahan 1965).

In single precision a short step's gain is lost against the state: at 0.1 ms a flight of
2.5 s would be 2.5 mm off. What each sum rounds away is kept and added to the next.
"""

from functools import cache
from types import SimpleNamespace
from typing import no_type_check

import warp as wp

from jblast.vehicle.warp.kernels.body import body_functions


@cache
@no_type_check
def sum_functions(real: type) -> SimpleNamespace:
    """Return the type and the function of a sum.

    Args:
        real: `wp.float32` or `wp.float64`, which needs nothing kept.
    """
    body = body_functions(real)
    StateComponents, vec4 = body.StateComponents, body.vec4
    one, half = wp.constant(real(1.0)), wp.constant(real(0.5))

    class Sum:
        """A state, and what is left over."""

        motion: StateComponents
        left: StateComponents

    Sum = wp.struct(Sum)

    @wp.func
    def lengthened(q: vec4, gain: vec4) -> vec4:
        """Return a gain that ends at length 1, to first order in how far it is off."""
        end = q + gain
        return gain + half * (one - wp.dot(end, end)) * end

    @wp.func
    def plain(before: Sum, gain: StateComponents) -> Sum:
        """Return the sum as it is rounded."""
        after = Sum()
        gain.quaternion = lengthened(before.motion.quaternion, gain.quaternion)
        after.motion = body.moved(before.motion, one, gain)
        return after

    @wp.func
    def compensated(before: Sum, gain: StateComponents) -> Sum:
        """Return the sum, with what was left over before."""
        gain.quaternion = lengthened(before.motion.quaternion, gain.quaternion)
        more = body.moved(gain, one, before.left)
        after = Sum()
        after.motion = body.moved(before.motion, one, more)
        added = body.moved(after.motion, -one, before.motion)
        after.left = body.moved(more, -one, added)
        return after

    add = compensated if real is wp.float32 else plain
    return SimpleNamespace(Sum=Sum, add=add)
