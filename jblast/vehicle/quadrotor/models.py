"""Vehicles by name, each number with its source.

Crazyflie and Hummingbird: the parameter sets that RotorPy 3.0.0 (MIT) ships.

Iris: PX4's default airframe of simulation, from PX4-SITL_gazebo-classic,
models/iris/iris.sdf.jinja: mass and inertia of base_link (the assembly with rotors and
IMU weighs 1.535 kg), rotors 0 to 3 in its order, whose arms are of unequal length there
too. timeConstantUp is the lag; the model slows down with 0.025 s, which one lag cannot
tell. momentConstant is a length: k_m is 0.06 m times k_eta. The reaction to a rotor
that turns counter-clockwise is clockwise: direction -1. rotorDragCoefficient is k_d. It
has no k_z: its motor model takes the share |u_z|/25 m/s off the thrust
(gazebo_motor_model.cpp), which at hover is k_z = k_eta 794/25 in a climb; in a descent
the sign differs. Frame drag is not in the model: 0.

What a blast acts on is declared, from outer measures, until somebody measures it. The
areas: half of the box seen from a side, a third from above. Crazyflie: 92 x 92 x 29 mm
(Bitcraze data sheet). Hummingbird: hub 0.1 x 0.1 x 0.12 m with arms of 0.17 m (RotorS,
hummingbird.xacro), taken as a box of 0.34 x 0.34 x 0.12 m. Iris: 0.47 x 0.47 x 0.11 m
(collision box of the model). Volumes: mass over 1500 kg/m3, solid parts. The added mass
is a sphere's (Lamb 1932, art. 92), the drag coefficient a cube's, 1.05 (Hoerner 1965,
chapter 3). The centre of pressure: a tenth of the box's height above that of mass.
"""

from typing import Any

from jblast.errors import InputError, nearest
from jblast.vehicle.quadrotor.parameters import Vehicle, from_parameters


def _square(arm: float) -> list[list[float]]:
    """Return places of rotors that stand the same way ahead and aside [m]."""
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


def named(name: str) -> Vehicle:
    """Return a vehicle by its name: "crazyflie", "hummingbird" or "iris".

    Raises:
        InputError: There is none of that name.
    """
    if name not in PARAMETERS:
        raise InputError(
            f"vehicle {name!r}: expected {', '.join(PARAMETERS)}"
            f"{nearest(str(name), PARAMETERS)}"
        )
    return from_parameters(PARAMETERS[name], name=name)
