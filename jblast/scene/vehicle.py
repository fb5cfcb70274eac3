"""The vehicle as a scene tells it: which one, where it starts, what it holds."""

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Float

from jblast.types import as_float_array


class VehicleSpec(eqx.Module):
    """A vehicle that holds its place, or flies a mission.

    What its model is made of `vehicle` knows.

    Attributes:
        model: A name of `reader.schema.VEHICLE_MODELS`.
        position: Of the start: east, north, up [m].
        target: The place to hold: east, north, up [m]; None: that of the start.
        velocity: At the start: east, north, up [m/s].
        yaw: Heading at the start and held, from east to north [rad].
        integral: Whether the hold has integral action; None: the scene does not say.
        gains: Of the hold, by the names kp_pos, kd_pos, ki_pos (3), kp_att, kd_att,
            integral_limit and motor_lead; what is left out is the model's own.
        mission: File of the plan that it flies; None: it holds its place.
        placed: Whether `position` is known; else a mission starts at its plan's home.
    """

    model: str = eqx.field(static=True)
    position: Float[Array, "3"] = eqx.field(converter=as_float_array)
    target: Float[Array, "3"] | None = None
    velocity: Float[Array, "3"] = eqx.field(
        converter=as_float_array, default_factory=lambda: jnp.zeros(3)
    )
    yaw: Float[Array, ""] = eqx.field(converter=as_float_array, default=0.0)
    integral: bool | None = eqx.field(static=True, default=None)
    gains: dict[str, Float[Array, "..."]] = eqx.field(default_factory=dict)
    mission: str | None = eqx.field(static=True, default=None)
    placed: bool = eqx.field(static=True, default=True)

    @property
    def held(self) -> Float[Array, "3"]:
        """The place that it holds: east, north, up [m]."""
        return self.position if self.target is None else self.target
