r"""Forces, moments and rates of a quadrotor in a wind.

RotorPy 3.0.0's equations. World axes east, north, up; $R$ takes body to world.

- lag: $\dot\Omega_i = (\Omega_i^{cmd} - \Omega_i)/\tau_m$, the command clipped;
- air: $u = R^T(v - v_{wind})$, at a rotor $u_i = u + \omega \times r_i$;
- thrust: $T_i = k_\eta \Omega_i^2 + k_h (u_{ix}^2 + u_{iy}^2)$ along body z;
- rotor drag: $H_i = -\Omega_i\,\mathrm{diag}(k_d, k_d, k_z)\,u_i$;
- frame drag, at the centre of mass: $D = -|u|\,\mathrm{diag}(c_D)\,u$;
- moment: $M = \sum_i r_i \times (T_i z + H_i) + z \sum_i \epsilon_i k_m \Omega_i^2$;
- $m\dot v = R(\sum_i T_i z + H_i + D) - m g z + F$, $\dot x = v$;
- $J\dot\omega = M + N - \omega \times J\omega$, $\dot q = q \otimes (\omega, 0)/2$,

with the force $F$ and the moment $N$ of the loads.
"""

import jax.numpy as jnp
from jaxtyping import Array, Float

from jblast.constants import FLIGHT_GRAVITY
from jblast.vehicle.motion import (
    Motion,
    Rows,
    Vector,
    add,
    cross,
    dot,
    four,
    rotation,
    rows,
    three,
    times,
    times_transposed,
    turning,
)
from jblast.vehicle.parameters import Vehicle

Wrench = tuple[Vector, Vector]
"""A force, world axes [N], and a moment about the centre of mass, body axes [N m]."""


def inverse_inertia(vehicle: Vehicle) -> Float[Array, "3 3"]:
    """Return $J^{-1}$ [1/(kg m2)]."""
    return jnp.linalg.inv(vehicle.inertia_kg_m2)


def air_wrench(
    vehicle: Vehicle, motion: Motion, attitude: Rows, wind: Vector
) -> Wrench:
    """Force and moment of rotors and frame in moving air, both along body axes.

    Args:
        vehicle: The vehicle.
        motion: Its state.
        attitude: $R$ of that state.
        wind: Velocity of the air, world [m/s].

    Returns:
        Force [N] and moment about the centre of mass [N m].
    """
    k_x, k_y, k_z = three(vehicle.rotor_drag)
    u = times_transposed(attitude, add(motion.velocity, (-wind[0], -wind[1], -wind[2])))
    force = _frame_drag(vehicle, u)
    moment = (0 * u[0], 0 * u[1], 0 * u[2])
    directions = four(vehicle.rotor_direction)
    for position, direction, speed in zip(
        vehicle.rotor_position_m, directions, motion.rotor_speed, strict=True
    ):
        arm = three(position)
        x, y, z = add(u, cross(motion.body_rate, arm))
        square = speed * speed
        thrust = vehicle.thrust_coefficient * square
        thrust = thrust + vehicle.translational_lift * (x * x + y * y)
        pull = (-speed * k_x * x, -speed * k_y * y, thrust - speed * k_z * z)
        force, moment = add(force, pull), add(moment, cross(arm, pull))
        spin = direction * vehicle.moment_coefficient * square
        moment = (moment[0], moment[1], moment[2] + spin)
    return force, moment


def rates(
    vehicle: Vehicle,
    inverse: Float[Array, "3 3"],
    motion: Motion,
    command: Float[Array, "4"],
    wind: Vector,
    load: Wrench,
) -> Motion:
    """Rates of a vehicle's state.

    Args:
        vehicle: The vehicle.
        inverse: Of its inertia.
        motion: Its state.
        command: Rotor speeds asked for [rad/s].
        wind: Velocity of the air, world [m/s].
        load: Of everything that is neither air nor weight.

    Returns:
        Time derivative of each component.
    """
    attitude, w = rotation(motion.quaternion), motion.body_rate
    force, moment = air_wrench(vehicle, motion, attitude, wind)
    m = vehicle.mass_kg
    # Both per kilogram: XLA keeps a quotient, and calculates a sum of products again
    # for each number that needs it.
    pull = (force[0] / m, force[1] / m, force[2] / m)
    twist = (moment[0] / m, moment[1] / m, moment[2] / m)
    x, y, z = times(attitude, pull)
    a, b, c = cross(w, times(rows(vehicle.inertia_kg_m2), w))
    g, h, i = add(load[1], (-a, -b, -c))
    turn = (m * twist[0] + g, m * twist[1] + h, m * twist[2] + i)
    low, high = vehicle.rotor_speed_min_rad_s, vehicle.rotor_speed_max_rad_s
    lag = four(jnp.clip(command, low, high))
    speeds = motion.rotor_speed
    return Motion(
        position=motion.velocity,
        velocity=(
            x + load[0][0] / m,
            y + load[0][1] / m,
            z + load[0][2] / m - FLIGHT_GRAVITY,
        ),
        quaternion=turning(motion.quaternion, w),
        body_rate=times(rows(inverse), turn),
        rotor_speed=(
            (lag[0] - speeds[0]) / vehicle.motor_lag_s,
            (lag[1] - speeds[1]) / vehicle.motor_lag_s,
            (lag[2] - speeds[2]) / vehicle.motor_lag_s,
            (lag[3] - speeds[3]) / vehicle.motor_lag_s,
        ),
    )


def net_wrench(vehicle: Vehicle, motion: Motion, rate: Motion) -> Wrench:
    """Force [N], world, and moment [N m], body, that make these rates of a state."""
    m, (x, y, z) = vehicle.mass_kg, rate.velocity
    inertia = rows(vehicle.inertia_kg_m2)
    spin = cross(motion.body_rate, times(inertia, motion.body_rate))
    return (m * x, m * y, m * z), add(times(inertia, rate.body_rate), spin)


def _frame_drag(vehicle: Vehicle, u: Vector) -> Vector:
    """Drag of the frame; its gradient at rest is zero, not NaN."""
    square = dot(u, u)
    moving = square > 0
    speed = jnp.where(moving, jnp.sqrt(jnp.where(moving, square, 1)), 0)
    c_x, c_y, c_z = three(vehicle.frame_drag)
    return -speed * c_x * u[0], -speed * c_y * u[1], -speed * c_z * u[2]
