"""Starts of flights, and flights made by hand."""

import jax
import jax.numpy as jnp
import numpy as np

from jblast.vehicle import State, Trajectory, Vehicle

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
    return State(jnp.asarray(position, float), **{**rest, **parts})


def tumbling(vehicle: Vehicle) -> State:
    """Thrown: moving, turned and turning about every axis."""
    return at_hover(
        vehicle,
        velocity_m_s=np.array([1.0, -2.0, 0.5]),
        quaternion=np.array([0.3, -0.2, 0.4, 0.8]) / np.sqrt(0.93),
        body_rate_rad_s=np.array([3.0, -2.0, 4.0]),
    )


def stacked(trees):
    """Side by side, as the vehicles of a batch."""
    return jax.tree.map(lambda *leaves: jnp.stack(leaves), *trees)


def by_hand(time_s, position_m, **parts) -> Trajectory:
    """Rows of a flight, level and at rest but for what is given."""
    place = jnp.asarray(position_m, float)
    still, size = jnp.zeros_like(place), place.shape[:-1]
    rest = {
        "velocity_m_s": still,
        "quaternion": jnp.broadcast_to(jnp.array([0.0, 0.0, 0.0, 1.0]), (*size, 4)),
        "body_rate_rad_s": still,
        "rotor_speed_rad_s": jnp.zeros((*size, 4)),
        "force_n": still,
        "moment_n_m": still,
        "lost": jnp.zeros(size[:-1], bool),
    }
    given = {name: jnp.asarray(values) for name, values in parts.items()}
    return Trajectory(jnp.asarray(time_s), place, **{**rest, **given})
