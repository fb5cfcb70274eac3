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

from collections.abc import Mapping
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax.core import Tracer
from jaxtyping import Array, Float

from jblast.errors import InputError, nearest, shown
from jblast.types import as_numbers

BODY = (
    "body_area",
    "body_drag_coefficient",
    "body_volume",
    "added_mass_coefficient",
    "pressure_centre",
)
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
"""RotorPy's names that the equations do not use, and a controller's gains."""


def _square(arm: float) -> list[list[float]]:
    """Return the positions of four rotors in a square of side 2 `arm` [m]."""
    return [[arm, arm, 0.0], [arm, -arm, 0.0], [-arm, -arm, 0.0], [-arm, arm, 0.0]]


PARAMETERS: dict[str, dict[str, Any]] = {
    "crazyflie": {
        "mass": 0.03,
        "Ixx": 1.43e-05,
        "Iyy": 1.43e-05,
        "Izz": 2.89e-05,
        "rotor_pos": _square(0.030405591590739998),
        "rotor_directions": [1, -1, 1, -1],
        "k_eta": 2.3e-08,
        "k_m": 7.8e-10,
        "k_d": 1.02506e-06,
        "k_z": 7.553e-07,
        "tau_m": 0.072,
        "rotor_speed_max": 2500,
        "body_area": [1.3e-3, 1.3e-3, 2.8e-3],
        "body_drag_coefficient": 1.05,
        "body_volume": 2.0e-5,
        "added_mass_coefficient": 0.5,
        "pressure_centre": [0.0, 0.0, 0.003],
    },
    "hummingbird": {
        "mass": 0.5,
        "Ixx": 0.00365,
        "Iyy": 0.00368,
        "Izz": 0.00703,
        "rotor_pos": _square(0.12020815280060002),
        "rotor_directions": [1, -1, 1, -1],
        "c_Dx": 0.005,
        "c_Dy": 0.005,
        "c_Dz": 0.01,
        "k_eta": 5.57e-06,
        "k_m": 1.36e-07,
        "k_d": 0.000119,
        "k_z": 0.000232,
        "k_h": 0.00339,
        "tau_m": 0.005,
        "rotor_speed_max": 1500,
        "body_area": [0.020, 0.020, 0.039],
        "body_drag_coefficient": 1.05,
        "body_volume": 3.3e-4,
        "added_mass_coefficient": 0.5,
        "pressure_centre": [0.0, 0.0, 0.012],
    },
    "iris": {
        "mass": 1.5,
        "Ixx": 0.029125,
        "Iyy": 0.029125,
        "Izz": 0.055225,
        "rotor_pos": [
            [0.13, -0.22, 0.023],
            [-0.13, 0.2, 0.023],
            [0.13, 0.22, 0.023],
            [-0.13, -0.2, 0.023],
        ],
        "rotor_directions": [-1, -1, 1, 1],
        "k_eta": 5.84e-06,
        "k_m": 0.06 * 5.84e-06,
        "k_d": 0.000175,
        "k_z": 5.84e-06 * 794 / 25,
        "tau_m": 0.0125,
        "rotor_speed_max": 1100,
        "body_area": [0.026, 0.026, 0.074],
        "body_drag_coefficient": 1.05,
        "body_volume": 1.0e-3,
        "added_mass_coefficient": 0.5,
        "pressure_centre": [0.0, 0.0, 0.011],
    },
}


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
    if name not in PARAMETERS:
        raise InputError(
            f"vehicle {name!r}: expected {', '.join(PARAMETERS)}"
            f"{nearest(str(name), PARAMETERS)}"
        )
    return from_parameters(PARAMETERS[name], name=name)


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
    # The sum is traced if either of them is.
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
    """Return the inertia matrix, checked to be positive definite."""
    xx, yy, zz = (number(parameters, key) for key in ("Ixx", "Iyy", "Izz"))
    xy, yz, xz = (number(parameters, key, default=0.0) for key in ("Ixy", "Iyz", "Ixz"))
    # RotorPy's products of inertia are entries of the matrix, without a minus sign.
    matrix = jnp.stack([xx, xy, xz, xy, yy, yz, xz, yz, zz]).reshape(3, 3)
    if not isinstance(matrix, Tracer):
        # Positive entries of the diagonal do not exclude an axis of negative inertia.
        least = np.linalg.eigvalsh(np.asarray(matrix))[0]
        if not least > 0:
            raise InputError(
                "vehicle parameters Ixx, Iyy, Izz, Ixy, Iyz, Ixz: expected a positive "
                f"definite inertia, got one of least principal value {least:g} kg m2"
            )
    return matrix


def _rotors(parameters: Mapping[str, Any]) -> Any:
    """Return the rotor positions, sorted by the rotors' names."""
    rows = parameters.get("rotor_pos")
    if isinstance(rows, Mapping):
        if sorted(rows) != ["r1", "r2", "r3", "r4"]:
            raise InputError(
                "vehicle parameter rotor_pos: expected four rotors, r1 to r4, got "
                + ", ".join(map(str, rows))
            )
        # `rotor_directions` is a plain list, in the order r1 to r4.
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


def read_body(parameters: Mapping[str, Any]) -> Body | None:
    """Return the properties for blast loads; None if the table has none of them."""
    if not any(key in parameters for key in BODY):
        return None
    area = numbers(parameters.get("body_area"), "body_area", (3,), least=0.0)
    centre = numbers(parameters.get("pressure_centre"), "pressure_centre", (3,))
    drag, volume, added = (
        number(parameters, key, least=0.0)
        for key in ("body_drag_coefficient", "body_volume", "added_mass_coefficient")
    )
    return Body(area, drag, volume, added, centre)


def required_body(body: Body | None) -> Body:
    """Return the properties for blast loads.

    Raises:
        InputError: The vehicle has none.
    """
    if body is None:
        raise InputError(
            f"vehicle: expected {', '.join(BODY[:-1])} and {BODY[-1]} for blast loads, "
            "got none of them"
        )
    return body


def number(
    parameters: Mapping[str, Any],
    key: str,
    *,
    least: float | None = None,
    positive: bool = False,
    default: float | None = None,
) -> Float[Array, ""]:
    """Return one number of a table.

    Args:
        parameters: The table.
        key: Name of the number.
        least: Minimum.
        positive: Require a number above zero.
        default: Value of a missing number; None: the number is required.

    Raises:
        InputError: It is missing, not a number, not finite or too small.
    """
    if key not in parameters and default is None:
        raise InputError(f"vehicle parameter {key}: missing")
    value = numbers(parameters.get(key, default), key, (), least=least)
    if positive and not isinstance(value, Tracer) and not value > 0:
        raise InputError(
            f"vehicle parameter {key}: expected a positive number, got {float(value):g}"
        )
    return value


def numbers(
    value: Any, key: str, shape: tuple[int, ...], *, least: float | None = None
) -> Float[Array, "..."]:
    """Return numbers of a shape.

    Args:
        value: Array-like of floats.
        key: Name of the numbers.
        shape: Required shape.
        least: Minimum of each number.

    Raises:
        InputError: A value is not a number, not finite or too small, or the shape
            differs.
    """
    what = " x ".join(map(str, shape)) + " numbers" if shape else "a number"
    if not isinstance(value, jax.Array):
        try:
            # A missing value becomes an empty array, whose shape the message below
            # reports.
            value = np.asarray([] if value is None else value, dtype=float)
        except (TypeError, ValueError):
            raise InputError(
                f"vehicle parameter {key}: expected {what}, got {shown(value)}"
            ) from None
    array = as_numbers(value)
    if array.shape != shape:
        raise InputError(
            f"vehicle parameter {key}: expected {what}, got the shape {array.shape}"
        )
    # Inside jit only the shape is known.
    if isinstance(array, Tracer):
        return array
    if not bool(jnp.all(jnp.isfinite(array))):
        raise InputError(f"vehicle parameter {key}: expected {what}, got {array}")
    if least is not None and not bool(jnp.all(array >= least)):
        raise InputError(
            f"vehicle parameter {key}: expected {what} of at least {least:g}, "
            f"got {array}"
        )
    return array


def in_precision(tree: Any, dtype: np.dtype) -> Any:
    """Convert every array of floats to one precision, without weak types."""

    # A weakly typed array would compile the program once more.
    def converted(x: Any) -> Any:
        is_weak = getattr(x, "weak_type", False)  # NumPy's arrays never are
        if not eqx.is_inexact_array(x) or (x.dtype == dtype and not is_weak):
            return x
        return x.astype(dtype)

    return jax.tree.map(converted, tree)
