"""Starts of flights, and the equations of a quadrotor once more, in plain NumPy."""

from itertools import pairwise

import jax.numpy as jnp
import numpy as np
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation

from jblast.vehicle import State, Vehicle

GRAVITY = 9.81


def hover_speed(vehicle: Vehicle) -> float:
    """Rotor speed at which the thrust is the weight [rad/s]."""
    weight = float(vehicle.mass_kg) * GRAVITY
    return float(np.sqrt(weight / (4 * float(vehicle.thrust_coefficient))))


def at_hover(vehicle: Vehicle, position=(0.0, 0.0, 5.0), **parts) -> State:
    """Level and at rest, the rotors at the speed of hover, but for what is given."""
    rest = {
        "velocity_m_s": np.zeros(3),
        "quaternion": np.array([0.0, 0.0, 0.0, 1.0]),
        "body_rate_rad_s": np.zeros(3),
        "rotor_speed_rad_s": np.full(4, hover_speed(vehicle)),
    }
    return State(jnp.asarray(position), **{**rest, **parts})


def tumbling(vehicle: Vehicle) -> State:
    """Thrown: moving, turned and turning about every axis."""
    return at_hover(
        vehicle,
        velocity_m_s=np.array([1.0, -2.0, 0.5]),
        quaternion=np.array([0.3, -0.2, 0.4, 0.8]) / np.sqrt(0.93),
        body_rate_rad_s=np.array([3.0, -2.0, 4.0]),
    )


def by_scipy(vehicle, state, commands, held_s, duration_s, wind, edges=()):
    """Integrate a flight to 1e-12, stopping wherever something jumps.

    Returns:
        Position and quaternion at each command's end.
    """
    at = {k: np.asarray(v) for k, v in vars(vehicle).items() if hasattr(v, "shape")}
    inverse = np.linalg.inv(at["inertia_kg_m2"])
    k_drag = at["rotor_drag"]

    def rates(time, y, command):
        v, q, w, speed = y[3:6], y[6:10], y[10:13], y[13:]
        turn = Rotation.from_quat(q).as_matrix()
        u = turn.T @ (v - wind(time))
        force = -np.linalg.norm(u) * at["frame_drag"] * u
        moment = np.zeros(3)
        for n in range(4):
            arm = at["rotor_position_m"][n]
            u_n = u + np.cross(w, arm)
            thrust = at["thrust_coefficient"] * speed[n] ** 2
            thrust += at["translational_lift"] * (u_n[0] ** 2 + u_n[1] ** 2)
            pull = np.array([0, 0, thrust]) - speed[n] * k_drag * u_n
            force = force + pull
            moment = moment + np.cross(arm, pull)
            spin = at["rotor_direction"][n] * at["moment_coefficient"] * speed[n] ** 2
            moment = moment + np.array([0, 0, spin])
        gyro = np.cross(w, at["inertia_kg_m2"] @ w)
        x, y_, z, s = q
        matrix = np.array([[s, -z, y_], [z, s, -x], [-y_, x, s], [-x, -y_, -z]])
        low, high = at["rotor_speed_min_rad_s"], at["rotor_speed_max_rad_s"]
        asked = np.clip(command, low, high)
        return np.concatenate(
            [
                v,
                turn @ force / at["mass_kg"] - np.array([0, 0, GRAVITY]),
                matrix @ w / 2,
                inverse @ (moment - gyro),
                (asked - speed) / at["motor_lag_s"],
            ]
        )

    y = np.concatenate([np.asarray(part) for part in vars(state).values()])
    held = np.arange(round(duration_s / held_s) + 1) * held_s
    places = [y[:10]]
    for n, (begin, end) in enumerate(pairwise(held)):
        stops = [begin, *(t for t in edges if begin + 1e-9 < t < end - 1e-9), end]
        for a, b in pairwise(stops):
            answer = solve_ivp(
                # a jump at an edge is seen from inside
                lambda t, y, a=a + 1e-12, b=b - 1e-12, n=n: rates(
                    min(max(t, a), b), y, commands[n]
                ),
                (a, b),
                y,
                method="DOP853",
                rtol=1e-11,
                atol=1e-12,
            )
            y = answer.y[:, -1]
        places.append(y[:10])
    return np.array(places)
