"""A quadrotor's parameters, and how they are read from a table of names."""

from collections.abc import Mapping
from typing import Any

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jax.core import Tracer
from jaxtyping import Array, Float

from jblast.errors import InputError, nearest
from jblast.vehicle.quadrotor.body import BODY, Body, read_body
from jblast.vehicle.quadrotor.numbers import floats, number, numbers


class Vehicle(eqx.Module):
    r"""A quadrotor. Body axes: x ahead, y left, z up, origin at the centre of mass.

    Leading axes, the same of every array, are those of a batch of vehicles.

    Attributes:
        mass_kg: $m$.
        inertia_kg_m2: $J$ about the centre of mass, body axes.
        rotor_position_m: $r_i$.
        rotor_direction: $\epsilon_i$, 1 or -1: sign of the yaw moment on the body.
        thrust_coefficient: $k_\eta$ [N s2/rad2].
        moment_coefficient: $k_m$ [N m s2/rad2].
        rotor_drag: $(k_d, k_d, k_z)$ [N s2/(rad m)].
        translational_lift: $k_h$ [N s2/m2].
        frame_drag: $(c_{Dx}, c_{Dy}, c_{Dz})$ [N s2/m2].
        motor_lag_s: $\tau_m$.
        rotor_speed_min_rad_s: Least speed a command may ask for.
        rotor_speed_max_rad_s: Greatest.
        body: What a blast acts on; None where it is not known.
        name: "" if it has none.
    """

    mass_kg: Float[Array, "*batch"] = eqx.field(converter=floats)
    inertia_kg_m2: Float[Array, "*batch 3 3"] = eqx.field(converter=floats)
    rotor_position_m: Float[Array, "*batch 4 3"] = eqx.field(converter=floats)
    rotor_direction: Float[Array, "*batch 4"] = eqx.field(converter=floats)
    thrust_coefficient: Float[Array, "*batch"] = eqx.field(converter=floats)
    moment_coefficient: Float[Array, "*batch"] = eqx.field(converter=floats)
    rotor_drag: Float[Array, "*batch 3"] = eqx.field(converter=floats)
    translational_lift: Float[Array, "*batch"] = eqx.field(converter=floats)
    frame_drag: Float[Array, "*batch 3"] = eqx.field(converter=floats)
    motor_lag_s: Float[Array, "*batch"] = eqx.field(converter=floats)
    rotor_speed_min_rad_s: Float[Array, "*batch"] = eqx.field(converter=floats)
    rotor_speed_max_rad_s: Float[Array, "*batch"] = eqx.field(converter=floats)
    body: Body | None = None
    name: str = eqx.field(static=True, default="")


USED = (
    *("mass", "Ixx", "Iyy", "Izz", "Ixy", "Iyz", "Ixz", "num_rotors", "rotor_pos"),
    *("rotor_directions", "c_Dx", "c_Dy", "c_Dz", "k_eta", "k_m", "k_d", "k_z", "k_h"),
    *("tau_m", "rotor_speed_min", "rotor_speed_max", *BODY),
)
IGNORED = (
    *("rotor_radius", "rI", "k_flap", "motor_noise_std", "k_w", "k_v"),
    *("kp_att", "kd_att", "kp_pos", "kd_pos", "ki_pos", "integral_limit"),
    "motor_lead",
)
"""Names of RotorPy's without a part in the equations, and a controller's gains."""


def from_parameters(parameters: Mapping[str, Any], *, name: str = "") -> Vehicle:
    """Read a quadrotor from RotorPy's names, in SI units.

    Flapping (`k_flap`), motor noise and the inner gains `k_w` and `k_v` have no part in
    the equations here and are ignored, whatever their value. Aerodynamic coefficients,
    products of inertia and the least rotor speed are zero where they are left out. What
    a blast acts on has the names `body_area` (3), `body_drag_coefficient`,
    `body_volume`, `added_mass_coefficient` and `pressure_centre` (3): all or none.

    Args:
        parameters: Numbers by name; `rotor_pos` has a row (3) for each rotor, a list
            or by the names r1 to r4.
        name: Of the vehicle.

    Raises:
        InputError: A name is unknown or missing, a number is none or out of its range,
            the inertia is not positive definite, there are not four rotors. Values are
            not looked at inside jit or grad.
    """
    for key in parameters:
        if key not in USED + IGNORED:
            raise InputError(
                f"vehicle parameter {key!r}: no such name{nearest(str(key), USED)}"
            )

    def get(key: str, least: float | None = None, **options: Any) -> Any:
        return number(parameters, key, least=least, **options)

    if "num_rotors" in parameters and get("num_rotors") != 4:
        raise InputError(
            f"vehicle parameter num_rotors: expected 4, got {parameters['num_rotors']}"
        )
    low = get("rotor_speed_min", 0.0, default=0.0)
    high = get("rotor_speed_max", 0.0)
    if not isinstance(low + high, Tracer) and low >= high:
        raise InputError(
            "vehicle parameter rotor_speed_max: expected more than rotor_speed_min, "
            f"got {float(high):g} and {float(low):g} rad/s"
        )
    sideways = get("k_d", 0.0, default=0.0)
    return Vehicle(
        mass_kg=get("mass", 0.0, positive=True),
        inertia_kg_m2=_inertia(parameters),
        rotor_position_m=numbers(_rotors(parameters), "rotor_pos", (4, 3)),
        rotor_direction=_directions(parameters),
        thrust_coefficient=get("k_eta", 0.0, positive=True),
        moment_coefficient=get("k_m", 0.0),
        rotor_drag=jnp.stack([sideways, sideways, get("k_z", 0.0, default=0.0)]),
        translational_lift=get("k_h", default=0.0),
        frame_drag=jnp.stack([get(f"c_D{axis}", 0.0, default=0.0) for axis in "xyz"]),
        motor_lag_s=get("tau_m", 0.0, positive=True),
        rotor_speed_min_rad_s=low,
        rotor_speed_max_rad_s=high,
        body=read_body(parameters),
        name=name,
    )


def _inertia(parameters: Mapping[str, Any]) -> Float[Array, "3 3"]:
    """Return the matrix, which must be positive definite; RotorPy's signs."""
    xx, yy, zz = (number(parameters, key) for key in ("Ixx", "Iyy", "Izz"))
    xy, yz, xz = (number(parameters, key, default=0.0) for key in ("Ixy", "Iyz", "Ixz"))
    matrix = jnp.stack([xx, xy, xz, xy, yy, yz, xz, yz, zz]).reshape(3, 3)
    if not isinstance(matrix, Tracer):
        least = np.linalg.eigvalsh(np.asarray(matrix))[0]
        if not least > 0:
            raise InputError(
                "vehicle parameters Ixx, Iyy, Izz, Ixy, Iyz, Ixz: expected a positive "
                f"definite inertia, got one of least principal value {least:g} kg m2"
            )
    return matrix


def _rotors(parameters: Mapping[str, Any]) -> Any:
    """Return the rows of the rotors, in the order of their names."""
    rows = parameters.get("rotor_pos")
    if isinstance(rows, Mapping):
        if sorted(rows) != ["r1", "r2", "r3", "r4"]:
            raise InputError(
                "vehicle parameter rotor_pos: expected four rotors, r1 to r4, got "
                + ", ".join(map(str, rows))
            )
        rows = [rows[key] for key in sorted(rows)]
    return rows


def _directions(parameters: Mapping[str, Any]) -> Float[Array, "4"]:
    """Return the signs of the rotors' yaw moments."""
    signs = numbers(parameters.get("rotor_directions"), "rotor_directions", (4,))
    if not isinstance(signs, Tracer) and not bool(jnp.all(abs(signs) == 1)):
        raise InputError(
            "vehicle parameter rotor_directions: expected 1 or -1 for each rotor, "
            f"got {signs.tolist()}"
        )
    return signs
