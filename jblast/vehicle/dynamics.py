r"""Equations of motion of a quadrotor in a wind, and a step of time.

The equations are those of RotorPy 3.0.0. World axes are east, north, up; $R$ takes body
to world axes.

- lag: $\dot\Omega_i = (\Omega_i^{cmd} - \Omega_i)/\tau_m$, with the clipped command;
- air: $u = R^T(v - v_{wind})$, at a rotor $u_i = u + \omega \times r_i$;
- thrust: $T_i = k_\eta \Omega_i^2 + k_h (u_{ix}^2 + u_{iy}^2)$ along body z;
- rotor drag: $H_i = -\Omega_i\,\mathrm{diag}(k_d, k_d, k_z)\,u_i$;
- frame drag, at the centre of mass: $D = -|u|\,\mathrm{diag}(c_D)\,u$;
- moment: $M = \sum_i r_i \times (T_i z + H_i) + z \sum_i \epsilon_i k_m \Omega_i^2$;
- $m\dot v = R(\sum_i T_i z + H_i + D) - m g z + F$, $\dot x = v$;
- $J\dot\omega = M + N - \omega \times J\omega$, $\dot q = q \otimes (\omega, 0)/2$,

with the force $F$ and the moment $N$ of the loads.

RK4 evaluates the rates at the beginning, twice in the middle and at the end of a step.
Every step ends with the quaternion scaled to length 1. The exact flow preserves the
length, so the correction is no larger than the step's own error and the order of the
method is unchanged.
"""

import functools
import operator
from collections.abc import Callable

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from jblast.constants import FLIGHT_GRAVITY
from jblast.vehicle.quadrotor import Vehicle
from jblast.vehicle.state import (
    Four,
    Number,
    StateComponents,
    Vector,
    add,
    cross,
    dot,
    four,
    root,
    rows,
    three,
    times,
    turned,
    turned_back,
    turning,
    unit,
)

Wrench = tuple[Vector, Vector]
"""A force, world axes [N], and a moment about the centre of mass, body axes [N m]."""
Rates = Callable[[int, StateComponents], StateComponents]
"""Rates at the beginning (0), in the middle (1) or at the end (2) of a step."""


def air_wrench(vehicle: Vehicle, motion: StateComponents, wind: Vector) -> Wrench:
    """Force and moment of rotors and frame in moving air, both along body axes.

    Args:
        vehicle: The vehicle.
        motion: State of the vehicle.
        wind: Velocity of the air, world [m/s].

    Returns:
        Force [N] and moment about the centre of mass [N m].
    """
    past = add(motion.velocity, (-wind[0], -wind[1], -wind[2]))
    u, w = turned_back(motion.quaternion, past), motion.body_rate
    speeds, arms = motion.rotor_speed, [three(r) for r in vehicle.rotor_position_m]

    def total(*factors: list[Number]) -> Number:
        """Sum over the rotors of speed times factors."""
        a, b, c, d = (
            functools.reduce(operator.mul, each) for each in zip(*factors, strict=True)
        )
        return a * speeds[0] + b * speeds[1] + c * speeds[2] + d * speeds[3]

    # Rotor drag is linear in the rotor speeds. Sums of speeds times positions, shared
    # by all components, take a quarter of the work of a loop over rotors.
    r_x, r_y, r_z = ([arm[n] for arm in arms] for n in range(3))
    a_x, a_y, a_z = total(r_x), total(r_y), total(r_z)
    a_xx, a_yy, a_zz = total(r_x, r_x), total(r_y, r_y), total(r_z, r_z)
    a_xy, a_yz, a_xz = total(r_x, r_y), total(r_y, r_z), total(r_x, r_z)
    all_speeds = speeds[0] + speeds[1] + speeds[2] + speeds[3]
    k_x, k_y, k_z = three(vehicle.rotor_drag)
    drag = _frame_drag(vehicle, u)
    thrust, roll, pitch, yaw = _thrusts(vehicle, u, w, speeds, arms)
    force = (
        drag[0] - k_x * (all_speeds * u[0] + w[1] * a_z - w[2] * a_y),
        drag[1] - k_y * (all_speeds * u[1] + w[2] * a_x - w[0] * a_z),
        drag[2] - k_z * (all_speeds * u[2] + w[0] * a_y - w[1] * a_x) + thrust,
    )
    moment = (
        roll
        - k_z * (a_y * u[2] + w[0] * a_yy - w[1] * a_xy)
        + k_y * (a_z * u[1] + w[2] * a_xz - w[0] * a_zz),
        pitch
        - k_x * (a_z * u[0] + w[1] * a_zz - w[2] * a_yz)
        + k_z * (a_x * u[2] + w[0] * a_xy - w[1] * a_xx),
        yaw
        - k_y * (a_x * u[1] + w[2] * a_xx - w[0] * a_xz)
        + k_x * (a_y * u[0] + w[1] * a_yz - w[2] * a_yy),
    )
    return force, moment


def _thrusts(
    vehicle: Vehicle, u: Vector, w: Vector, speeds: Four, arms: list[Vector]
) -> Four:
    """Thrust of all rotors [N] and its moments about the body's axes [N m]."""
    squares = [speed * speed for speed in speeds]
    each = []
    for square, arm in zip(squares, arms, strict=True):
        x = u[0] + w[1] * arm[2] - w[2] * arm[1]
        y = u[1] + w[2] * arm[0] - w[0] * arm[2]
        lift = vehicle.translational_lift * (x * x + y * y)
        each.append(vehicle.thrust_coefficient * square + lift)
    spins = four(vehicle.rotor_direction * vehicle.moment_coefficient)
    f_1, f_2, f_3, f_4 = each
    (x_1, y_1, _), (x_2, y_2, _), (x_3, y_3, _), (x_4, y_4, _) = arms
    return (
        f_1 + f_2 + f_3 + f_4,
        f_1 * y_1 + f_2 * y_2 + f_3 * y_3 + f_4 * y_4,
        -(f_1 * x_1 + f_2 * x_2 + f_3 * x_3 + f_4 * x_4),
        spins[0] * squares[0]
        + spins[1] * squares[1]
        + spins[2] * squares[2]
        + spins[3] * squares[3],
    )


def rates(
    vehicle: Vehicle,
    motion: StateComponents,
    command: Four,
    wind: Vector,
    load: Wrench,
) -> StateComponents:
    """Rates of a vehicle's state.

    Args:
        vehicle: The vehicle.
        motion: State of the vehicle.
        command: Rotor speed commands [rad/s].
        wind: Velocity of the air, world [m/s].
        load: Force and moment other than air and weight.

    Returns:
        Time derivative of each component.
    """
    w, m = motion.body_rate, vehicle.mass_kg
    force, moment = air_wrench(vehicle, motion, wind)
    # XLA stores quotients but recomputes products for every number that uses them. So
    # everything is divided by the mass, and the inertia is inverted by cofactors.
    pull = (force[0] / m, force[1] / m, force[2] / m)
    twist = (moment[0] / m, moment[1] / m, moment[2] / m)
    x, y, z = turned(motion.quaternion, pull)
    p, q, r = rows(vehicle.inertia_kg_m2)  # columns too: it is symmetric
    p, q, r = ((a / m, b / m, c / m) for a, b, c in (p, q, r))
    spin = cross(w, times((p, q, r), w))
    turn = tuple(a + b / m - c for a, b, c in zip(twist, load[1], spin, strict=True))
    across = (cross(q, r), cross(r, p), cross(p, q))
    whole = dot(p, across[0])
    e, f, g = times(across, (turn[0], turn[1], turn[2]))
    low, high = vehicle.rotor_speed_min_rad_s, vehicle.rotor_speed_max_rad_s
    a, b, c, d = (jnp.clip(speed, low, high) for speed in command)
    speeds, lag = motion.rotor_speed, vehicle.motor_lag_s
    return StateComponents(
        position=motion.velocity,
        velocity=(
            x + load[0][0] / m,
            y + load[0][1] / m,
            z + load[0][2] / m - FLIGHT_GRAVITY,
        ),
        quaternion=turning(motion.quaternion, w),
        body_rate=(e / whole, f / whole, g / whole),
        rotor_speed=(
            (a - speeds[0]) / lag,
            (b - speeds[1]) / lag,
            (c - speeds[2]) / lag,
            (d - speeds[3]) / lag,
        ),
    )


def net_wrench(
    vehicle: Vehicle, motion: StateComponents, rate: StateComponents
) -> Wrench:
    """Force [N], world, and moment [N m], body, that correspond to given rates."""
    m, (x, y, z) = vehicle.mass_kg, rate.velocity
    inertia = rows(vehicle.inertia_kg_m2)
    spin = cross(motion.body_rate, times(inertia, motion.body_rate))
    return (m * x, m * y, m * z), add(times(inertia, rate.body_rate), spin)


def _frame_drag(vehicle: Vehicle, u: Vector) -> Vector:
    """Drag of the frame; its gradient at rest is zero, not NaN."""
    speed = root(dot(u, u))
    c_x, c_y, c_z = three(vehicle.frame_drag)
    return -speed * c_x * u[0], -speed * c_y * u[1], -speed * c_z * u[2]


def rk4_step(
    rates: Rates, motion: StateComponents, step: Float[Array, ""]
) -> StateComponents:
    """Return the increment of a step of the classical fourth-order Runge-Kutta method.

    Args:
        rates: Function from stage and state to rates.
        motion: State at the beginning.
        step: Length of the step [s].
    """
    half = step / 2
    first = rates(0, motion)
    second = rates(1, _moved(motion, half, first))
    third = rates(1, _moved(motion, half, second))
    fourth = rates(2, _moved(motion, step, third))
    return jax.tree.map(
        lambda a, b, c, d: step / 6 * (a + 2 * (b + c) + d),
        first,
        second,
        third,
        fourth,
    )


def normal(motion: StateComponents) -> StateComponents:
    """Scale the quaternion to length 1."""
    return motion._replace(quaternion=unit(motion.quaternion))


def _moved(
    motion: StateComponents, step: Float[Array, ""], rate: StateComponents
) -> StateComponents:
    return jax.tree.map(lambda x, dx: x + step * dx, motion, rate)
