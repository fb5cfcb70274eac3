"""Quadrotors: parameters read from a table of names, and three named models.

Crazyflie and Hummingbird: parameter sets of RotorPy 3.0.0 (MIT).

Iris: PX4's default airframe of simulation, from PX4-SITL_gazebo-classic,
models/iris/iris.sdf.jinja: mass and inertia of base_link (the assembly with rotors and
IMU weighs 1.535 kg), rotors 0 to 3 in its order, with the model's unequal arms.
timeConstantUp is the lag; the model decelerates with 0.025 s, which a single lag cannot
represent. momentConstant is a length: k_m is 0.06 m times k_eta. The reaction to a
counter-clockwise rotor is clockwise: direction -1. rotorDragCoefficient is k_d. The
model has no k_z: its motors lose the share |u_z|/25 m/s of the thrust
(gazebo_motor_model.cpp), which at hover is k_z = k_eta 794/25 in a climb; in a descent
the sign differs. The model has no frame drag: 0.

The properties for blast loads are declared from outer dimensions; none has been
measured. Areas: half of the bounding box from the side, a third from above.
Crazyflie: 92 x 92 x 29 mm (Bitcraze data sheet). Hummingbird: hub 0.1 x 0.1 x 0.12 m
with arms of 0.17 m (RotorS, hummingbird.xacro), as a box of 0.34 x 0.34 x 0.12 m.
Iris: 0.47 x 0.47 x 0.11 m (collision box of the model). Volumes: mass over 1500 kg/m3,
solid parts. The added mass is that of a sphere (Lamb 1932, art. 92), the drag
coefficient that of a cube, 1.05 (Hoerner 1965, chapter 3). The centre of pressure lies
a tenth of the box's height above the centre of mass.
"""

import math
import tomllib
from collections.abc import Mapping
from pathlib import Path
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax.core import Tracer
from jaxtyping import Array, Float

from jblast.errors import InputError, nearest, require
from jblast.types import as_numbers

POSITIVE = 1e-12
"""Least mass, lag and thrust coefficient: less than those of any vehicle."""


class Part(NamedTuple):
    """A parameter of a vehicle.

    Attributes:
        shape: Shape of its numbers.
        least: The least number.
        default: Value if it is missing; None: it is required.
    """

    shape: tuple[int, ...] = ()
    least: float = -math.inf
    default: Any = None


INTEGRAL_LIMIT_M_S2 = 5.0
"""Default limit of the integral along each axis; declared.

Half of g, a tilt of 27 degrees: it leaves room for braking below the limit of 45.
"""
BODY = {
    "body_area": Part((3,), least=0),
    "body_drag_coefficient": Part(least=0),
    "body_volume": Part(least=0),
    "added_mass_coefficient": Part(least=0),
    "pressure_centre": Part((3,)),
}
"""Properties for blast loads: all or none, in the order of `Body`."""
GAINS = {
    **dict.fromkeys(("kp_pos", "kd_pos"), Part((3,), least=0)),
    "ki_pos": Part((3,), least=0, default=(0, 0, 0)),
    **dict.fromkeys(("kp_att", "kd_att"), Part(least=0)),
    "integral_limit": Part(least=0, default=INTEGRAL_LIMIT_M_S2),
    "motor_lead": Part(least=1),
}
"""Gains of a controller, which the equations do not use."""
PARTS = {
    "mass": Part(least=POSITIVE),
    **dict.fromkeys(("Ixx", "Iyy", "Izz"), Part()),
    **dict.fromkeys(("Ixy", "Iyz", "Ixz"), Part(default=0)),
    "num_rotors": Part(default=4),
    "rotor_pos": Part((4, 3)),
    "rotor_directions": Part((4,)),
    "k_eta": Part(least=POSITIVE),
    "k_m": Part(least=0),
    **dict.fromkeys(("k_d", "k_z", "c_Dx", "c_Dy", "c_Dz"), Part(least=0, default=0)),
    "k_h": Part(default=0),
    "tau_m": Part(least=POSITIVE),
    "rotor_speed_min": Part(least=0, default=0),
    "rotor_speed_max": Part(least=0),
    **BODY,
    **GAINS,
}
"""Parameters by RotorPy's names, in SI units."""
IGNORED = ("rotor_radius", "rI", "k_flap", "motor_noise_std", "k_w", "k_v")
"""RotorPy's names that nothing uses."""


PARAMETERS: dict[str, dict[str, Any]] = tomllib.loads(
    Path(__file__).with_name("models.toml").read_text()
)
"""Parameters of the named vehicles, gains included."""


def floats(value: Any) -> Float[Array, "..."]:
    """Convert a number, a nested list or an array to a float array."""
    return as_numbers(value if isinstance(value, Array) else jnp.asarray(value))


class Body(eqx.Module):
    """Properties for blast loads, except the rotors. Leading axes are those of a batch.

    Attributes:
        area_m2: Projected areas along the body's x, y and z axes [m2].
        drag_coefficient: Drag coefficient of these areas [-].
        volume_m3: Volume of the displaced air [m3].
        added_mass_coefficient: $C_m$ [-]: 0.5 for a sphere.
        pressure_centre_m: Centre of pressure, from the centre of mass, body axes [m].
    """

    area_m2: Float[Array, "*batch 3"] = eqx.field(converter=floats)
    drag_coefficient: Float[Array, "*batch"] = eqx.field(converter=floats)
    volume_m3: Float[Array, "*batch"] = eqx.field(converter=floats)
    added_mass_coefficient: Float[Array, "*batch"] = eqx.field(converter=floats)
    pressure_centre_m: Float[Array, "*batch 3"] = eqx.field(converter=floats)


class Vehicle(eqx.Module):
    r"""A quadrotor. Body axes: x ahead, y left, z up, origin at the centre of mass.

    Leading axes, equal for all arrays, are those of a batch of vehicles.

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
        rotor_speed_min_rad_s: Minimum rotor speed.
        rotor_speed_max_rad_s: Maximum rotor speed.
        body: Properties for blast loads; None if unknown.
        name: Name of the vehicle; "" without one.
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


def named(name: str) -> Vehicle:
    """Return a vehicle by its name: "crazyflie", "hummingbird" or "iris".

    Raises:
        InputError: The name is unknown.
    """
    return from_parameters(parameters_of(name), name=name)


def parameters_of(name: str) -> dict[str, Any]:
    """Return the parameters and gains of a named vehicle.

    Raises:
        InputError: The name is unknown.
    """
    known = name in PARAMETERS
    words = ", ".join(PARAMETERS)
    require(known, f"vehicle {name!r}", words + nearest(str(name), PARAMETERS))
    return PARAMETERS[name]


def from_parameters(parameters: Mapping[str, Any], *, name: str = "") -> Vehicle:
    """Read a quadrotor from RotorPy's names, in SI units.

    Flapping (`k_flap`), motor noise and the inner gains `k_w` and `k_v` are not
    modelled and are ignored. Aerodynamic coefficients, products of inertia and the
    minimum rotor speed default to zero. The properties for blast loads are `body_area`
    (3), `body_drag_coefficient`, `body_volume`, `added_mass_coefficient` and
    `pressure_centre` (3): all or none.

    Args:
        parameters: Numbers by name; `rotor_pos` has a row (3) for each rotor, in a list
            or under the names r1 to r4.
        name: Name of the vehicle.

    Raises:
        InputError: A name is unknown or missing, a number is invalid or out of range,
            the inertia is not positive definite, or there are not four rotors. Values
            are not checked inside jit or grad.
    """
    # A misspelt optional name would leave its default without a warning.
    unknown = [key for key in parameters if key not in (*PARTS, *IGNORED)]
    if unknown:
        close = nearest(str(unknown[0]), PARTS)
        raise InputError(f"vehicle parameter {unknown[0]!r}: no such name{close}")
    if isinstance(rows := parameters.get("rotor_pos"), Mapping):
        if sorted(rows) != ["r1", "r2", "r3", "r4"]:
            raise InputError(
                "vehicle parameter rotor_pos: expected four rotors, r1 to r4, got "
                + ", ".join(map(str, rows))
            )
        # `rotor_directions` is a plain list, in the order r1 to r4.
        parameters = {**parameters, "rotor_pos": [rows[key] for key in sorted(rows)]}
    one = {key: read(parameters, key) for key in PARTS if key not in (*BODY, *GAINS)}
    # RotorPy's products of inertia are entries of the matrix, without a minus sign.
    entries = ("Ixx", "Ixy", "Ixz", "Ixy", "Iyy", "Iyz", "Ixz", "Iyz", "Izz")
    inertia = jnp.stack([one[key] for key in entries]).reshape(3, 3)
    low, high = one["rotor_speed_min"], one["rotor_speed_max"]
    # Positive entries of the diagonal do not exclude an axis of negative inertia.
    checks = (
        ("num_rotors", "4", lambda: one["num_rotors"] == 4),
        ("rotor_directions", "1 or -1", lambda: abs(one["rotor_directions"]) == 1),
        ("rotor_speed_max", "more than rotor_speed_min", lambda: high > low),
        (
            "Ixx, Iyy, Izz, Ixy, Iyz, Ixz",
            "a positive definite inertia",
            lambda: np.linalg.eigvalsh(np.asarray(inertia)) > 0,
        ),
    )
    if not any(isinstance(x, Tracer) for x in one.values()):
        for name, what, holds in checks:
            if not np.all(holds()):
                got = [one[key].tolist() for key in name.split(", ")]
                raise InputError(
                    f"vehicle parameter {name}: expected {what}, got "
                    + ", ".join(map(str, got))
                )
    return Vehicle(
        mass_kg=one["mass"],
        inertia_kg_m2=inertia,
        rotor_position_m=one["rotor_pos"],
        rotor_direction=one["rotor_directions"],
        thrust_coefficient=one["k_eta"],
        moment_coefficient=one["k_m"],
        rotor_drag=jnp.stack([one["k_d"], one["k_d"], one["k_z"]]),
        translational_lift=one["k_h"],
        frame_drag=jnp.stack([one[f"c_D{axis}"] for axis in "xyz"]),
        motor_lag_s=one["tau_m"],
        rotor_speed_min_rad_s=low,
        rotor_speed_max_rad_s=high,
        body=Body(*(read(parameters, key) for key in BODY))
        if any(key in parameters for key in BODY)
        else None,
        name=name,
    )


def required_body(body: Body | None) -> Body:
    """Return the properties for blast loads.

    Raises:
        InputError: The vehicle has none.
    """
    words = f"{', '.join(BODY)} for blast loads"
    require(body is not None, "vehicle", words, "none of them")
    assert body is not None
    return body


def read(parameters: Mapping[str, Any], key: str) -> Float[Array, "..."]:
    """Return a parameter of a vehicle.

    Args:
        parameters: Numbers by name.
        key: A name of `PARTS`.

    Raises:
        InputError: It is missing, not a number, not finite or too small, or has another
            shape.
    """
    part = PARTS[key]
    value = parameters.get(key, part.default)
    if value is None:
        raise InputError(f"vehicle parameter {key}: missing")
    what = " x ".join(map(str, part.shape)) + " numbers" if part.shape else "a number"
    if math.isfinite(part.least):
        what += f" of at least {part.least:g}"
    try:
        array = value if isinstance(value, Array) else np.array(value, float)
        fits = array.shape == part.shape
        # inside jit only the shape is known
        if not isinstance(array, Tracer):
            known = np.asarray(array)
            fits &= bool(np.all(np.isfinite(known) & (known >= part.least)))
    except (TypeError, ValueError):
        array, fits = value, False
    if not fits:
        raise InputError(f"vehicle parameter {key}: expected {what}, got {array!s}")
    return as_numbers(array)


def in_precision(tree: Any, dtype: np.dtype) -> Any:
    """Convert every array of floats to one precision, without weak types."""

    # A weakly typed array would compile the program once more.
    def converted(x: Any) -> Any:
        is_weak = getattr(x, "weak_type", False)  # NumPy's arrays never are
        if not eqx.is_inexact_array(x) or (x.dtype == dtype and not is_weak):
            return x
        return x.astype(dtype)

    return jax.tree.map(converted, tree)
