"""Gains of the position hold, and those of the vehicles with a name."""

from collections.abc import Mapping
from typing import Any

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Float

from jblast.errors import InputError, nearest
from jblast.vehicle.quadrotor.numbers import floats, number, numbers


class Gains(eqx.Module):
    """Gains of an SE(3) position hold.

    Attributes:
        position: $k_p$ of the position, east, north, up [1/s2].
        velocity: $k_d$ of the position [1/s].
        attitude: $k_p$ of the attitude [1/s2].
        body_rate: $k_d$ of the attitude [1/s].
        integral: $k_i$ of the position [1/s3]; zero: no integral action.
        integral_limit: Most the integral may ask for, along each axis [m/s2].
        motor_lead: By what factor the motors' lag is shortened (`motor_lead.py`) [-],
            1 and more; None: it is not.
    """

    position: Float[Array, "3"] = eqx.field(converter=floats)
    velocity: Float[Array, "3"] = eqx.field(converter=floats)
    attitude: Float[Array, ""] = eqx.field(converter=floats)
    body_rate: Float[Array, ""] = eqx.field(converter=floats)
    integral: Float[Array, "3"] = eqx.field(
        converter=floats, default_factory=lambda: jnp.zeros(3)
    )
    integral_limit: Float[Array, ""] = eqx.field(converter=floats, default=5.0)
    motor_lead: Float[Array, ""] | None = eqx.field(
        converter=lambda x: None if x is None else floats(x), default=None
    )

    @property
    def lead(self) -> Float[Array, ""] | float:
        """The motors' lead; 1 where there is none [-]."""
        return 1.0 if self.motor_lead is None else self.motor_lead


# RotorPy 3.0.0's. Declared are those of the Iris' attitude, 12 rad/s and a damping of
# 0.8 before the motors' lag, for PX4's own loops do not translate, and all of the
# integral: a quarter of k_p, which takes an offset out in some 4 s.
NAMED = {
    name: {
        "kp_pos": [6.5, 6.5, 15.0],
        "kd_pos": [4.0, 4.0, 9.0],
        "ki_pos": [1.6, 1.6, 3.75],
        "kp_att": attitude,
        "kd_att": rate,
    }
    for name, attitude, rate in (
        ("crazyflie", 310.0, 57.0),
        ("hummingbird", 544.0, 46.64),
        ("iris", 150.0, 20.0),
    )
}


def named_gains(name: str, *, integral: bool = False) -> Gains:
    """Return the gains of a vehicle with a name.

    Args:
        name: "crazyflie", "hummingbird" or "iris".
        integral: Whether the hold has integral action.

    Raises:
        InputError: There are none of that name.
    """
    if name not in NAMED:
        raise InputError(
            f"gains of {name!r}: expected {', '.join(NAMED)}{nearest(str(name), NAMED)}"
        )
    gains = NAMED[name]
    dropped = () if integral else ("ki_pos",)
    return gains_from_parameters({k: v for k, v in gains.items() if k not in dropped})


def gains_from_parameters(parameters: Mapping[str, Any]) -> Gains:
    """Read gains by RotorPy's names: kp_pos, kd_pos, kp_att, kd_att.

    `ki_pos` (3), `integral_limit` and `motor_lead` may be left out; what else is there
    is a vehicle's and not looked at.

    Args:
        parameters: Numbers by name.

    Raises:
        InputError: One is missing, no number, or negative, or the lead is below 1.
    """
    lead = None
    if "motor_lead" in parameters:
        lead = number(parameters, "motor_lead", least=1.0)
    three = (3,)
    return Gains(
        position=numbers(parameters.get("kp_pos"), "kp_pos", three, least=0.0),
        velocity=numbers(parameters.get("kd_pos"), "kd_pos", three, least=0.0),
        attitude=number(parameters, "kp_att", least=0.0),
        body_rate=number(parameters, "kd_att", least=0.0),
        integral=numbers(
            parameters.get("ki_pos", [0.0, 0.0, 0.0]), "ki_pos", three, least=0.0
        ),
        integral_limit=number(parameters, "integral_limit", least=0.0, default=5.0),
        motor_lead=lead,
    )
