"""Pictures of an explosion from many sides, and which of them stand for a direction."""

from typing import Literal

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Float, Int, UInt8

from jblast.sensors.camera.rendering.baked.sides import nearest_side, three_sides
from jblast.sensors.camera.rendering.view_set import ViewSet
from jblast.types import as_float_array

FADING = 0.5
"""How long the last picture takes to fade, over its phase."""


class Pictures(ViewSet):
    """Pictures of an explosion on the ground.

    Attributes:
        frames: Heat; red, green, blue of soot and dust (sRGB); opacity; 8 bits each.
        direction: Unit vector from the blast to each viewer: east, north, up.
        up: Unit vector that is up in each view's pictures, across its direction.
        radius: Visible radius in each picture [px].
        spread: Covariance of the silhouette's columns with its rows, and variance of
            its rows, over the variance of its columns [-].
        box: First and last column, first and last row that show anything [px].
        height: Of the middle of the cloud above the ground at each phase, over its
            visible radius [-].
        phase: Of each frame: time since the burst over the fireball's duration, rising.
        anchor: (x, y) of the burst in each view's pictures [px].
        corners: Views around each triangle of the sphere of directions.
        inverses: Of the matrices whose columns are these directions.
        sides: How many views a picture is mixed of: the nearest, or three around it.
        windows: Whether no more of an image is looked at than may show some of a
            picture. Under `vmap`, where all branches are taken, it is slower.
        smoothed: Whether pictures shown smaller than they are lose what is finer than a
            pixel (`low_pass.py`). Under `vmap` that is done for all, wanted or not, and
            takes as long as the rest: leave it out where no picture is shown so small.
    """

    frames: UInt8[Array, "view frame size size 5"]
    direction: Float[Array, "view 3"] = eqx.field(converter=as_float_array)
    up: Float[Array, "view 3"] = eqx.field(converter=as_float_array)
    radius: Float[Array, "view frame"] = eqx.field(converter=as_float_array)
    spread: Float[Array, "view frame 2"] = eqx.field(converter=as_float_array)
    box: Float[Array, "view frame 4"] = eqx.field(converter=as_float_array)
    height: Float[Array, " frame"] = eqx.field(converter=as_float_array)
    phase: Float[Array, " frame"] = eqx.field(converter=as_float_array)
    anchor: Float[Array, "view 2"] = eqx.field(converter=as_float_array)
    corners: Int[Array, "triangle 3"]
    inverses: Float[Array, "triangle 3 3"] = eqx.field(converter=as_float_array)
    sides: Literal[1, 3] = eqx.field(static=True, default=1)
    windows: bool = eqx.field(static=True, default=True)
    smoothed: bool = eqx.field(static=True, default=True)

    def views_towards(
        self, towards: Float[Array, "3"]
    ) -> tuple[Int[Array, " side"], Float[Array, " side"]]:
        """Return which views are shown in a direction from the blast, and their parts.

        Args:
            towards: From the blast to the camera; its length does not matter.
        """
        if self.sides == 1:
            return nearest_side(self.direction, towards)
        return three_sides(self.corners, self.inverses, towards)

    def frames_at(
        self, phase: Float[Array, ""]
    ) -> tuple[Int[Array, "2"], Float[Array, "2"]]:
        """Return the two frames that a phase is between, and their parts."""
        last = len(self.phase) - 1
        before = jnp.searchsorted(self.phase, phase, side="right") - 1
        before = jnp.clip(before, 0, max(last - 1, 0))
        after = jnp.minimum(before + 1, last)
        apart = self.phase[after] - self.phase[before]
        some = apart > 0.0
        part = (phase - self.phase[before]) / jnp.where(some, apart, 1.0)
        part = jnp.where(some, jnp.clip(part, 0.0, 1.0), 0.0).astype(phase.dtype)
        end = self.phase[-1].astype(phase.dtype)
        there = jnp.clip(1.0 - (phase / end - 1.0) / FADING, 0.0, 1.0)
        there = jnp.where(phase > 0.0, there, 0.0)
        return jnp.stack([before, after]), there * jnp.stack([1.0 - part, part])
