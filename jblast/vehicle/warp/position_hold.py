"""The SE(3) controller of `vehicle.control.position_hold` as Warp functions."""

from functools import cache
from types import SimpleNamespace
from typing import no_type_check

import jax.numpy as jnp
import warp as wp
from jaxtyping import Array, Float

from jblast.constants import FLIGHT_GRAVITY
from jblast.vehicle.control.allocation import STANDSTILL_SHARE
from jblast.vehicle.control.position_hold import (
    DESCENT_M_S,
    THRUST_FLOOR,
    TILT_SLOPE,
    PositionHold,
)
from jblast.vehicle.controllers import ControllerKernel
from jblast.vehicle.warp.dynamics import body_functions


@cache
@no_type_check
def hold_functions(real: type) -> SimpleNamespace:
    """Return types and functions of the position controller.

    Args:
        real: `wp.float32` or `wp.float64`.
    """
    body = body_functions(real)
    vec3, vec4, mat33 = body.vec3, body.vec4, body.mat33
    Vehicle, StateComponents = body.Vehicle, body.StateComponents
    gravity = wp.constant(real(FLIGHT_GRAVITY))
    floor = wp.constant(real(THRUST_FLOOR * FLIGHT_GRAVITY))
    descent, slope = wp.constant(real(DESCENT_M_S)), wp.constant(real(TILT_SLOPE))
    slowest, one = wp.constant(real(STANDSTILL_SHARE)), wp.constant(real(1.0))

    class Order:
        """Target, desired heading as a vector, and `Gains`."""

        target: vec3
        heading: vec3
        position: vec3
        velocity: vec3
        integral: vec3
        attitude: real
        body_rate: real
        limit: real

    class Answer:
        """Rotor speed commands and the updated integral."""

        command: vec4
        integral: vec3

    Order, Answer = wp.struct(Order), wp.struct(Answer)

    @wp.func
    def order_of(rows: wp.array2d[real], lane: int) -> Order:
        """Read an order; rows are numbers, columns vehicles, or one for all."""
        # A single column serves every vehicle of the batch.
        n = wp.min(lane, rows.shape[1] - 1)
        order = Order()
        for i in range(3):
            order.target[i] = rows[i, n]
            order.heading[i] = rows[3 + i, n]
            order.position[i] = rows[6 + i, n]
            order.velocity[i] = rows[9 + i, n]
            order.integral[i] = rows[12 + i, n]
        order.attitude = rows[15, n]
        order.body_rate = rows[16, n]
        order.limit = rows[17, n]
        return order

    @wp.func
    def unit(v: vec3) -> vec3:
        """Vector of length 1; zero has no direction and gives NaN."""
        # One division and three products: a division takes several times as long.
        return v * (real(1.0) / wp.sqrt(wp.dot(v, v)))

    @wp.func
    def column(m: mat33, n: int) -> vec3:
        """Return a column."""
        return vec3(m[0, n], m[1, n], m[2, n])

    @wp.func
    def attitude_error(pull: vec3, heading: vec3, attitude: mat33) -> vec3:
        """Return the attitude error from the attitude for a pull and a heading."""
        x = column(attitude, 0)
        y = column(attitude, 1)
        z = column(attitude, 2)
        aim = heading  # as `position_hold._heading`
        across = aim[1] * x[0] - aim[0] * x[1]
        if aim[0] * x[0] + aim[1] * x[1] < wp.abs(across):
            side = wp.where(across < real(0.0), -one, one)
            aim = vec3(x[0] - side * x[1], x[1] + side * x[0], real(0.0))
        b_3 = unit(pull)
        b_2 = unit(wp.cross(b_3, aim))
        b_1 = wp.cross(b_2, b_3)
        return real(0.5) * vec3(
            wp.dot(b_3, y) - wp.dot(b_2, z),
            wp.dot(b_1, z) - wp.dot(b_3, x),
            wp.dot(b_2, x) - wp.dot(b_1, y),
        )

    @wp.func
    def feasible_share(room: real, requested: real) -> real:
        """As `allocation._feasible_share`."""
        share = one
        # A branch, because without a request and without room the quotient is 0/0.
        if requested > room:
            share = room / requested
        return share

    @wp.func
    def speeds_within(vehicle: Vehicle, lift: real, moment: vec3) -> vec4:
        """As `allocation.speeds_within`."""
        b = vehicle.inverse_allocation
        k = vehicle.thrust_coefficient
        least = k * vehicle.speed_min * vehicle.speed_min
        most = k * vehicle.speed_max * vehicle.speed_max
        low, high, tilt, turn = vec4(), vec4(), vec4(), vec4()
        for i in range(4):
            low[i] = least / b[i, 0]
            high[i] = most / b[i, 0]
            tilt[i] = (b[i, 1] * moment[0] + b[i, 2] * moment[1]) / b[i, 0]
            turn[i] = b[i, 3] * moment[2] / b[i, 0]
        room = wp.max(wp.min(high) - wp.max(low), real(0.0))
        tilt = feasible_share(room, wp.max(tilt) - wp.min(tilt)) * tilt
        thrust = wp.min(wp.max(lift, wp.max(low - tilt)), wp.min(high - tilt))
        share = one
        for i in range(4):
            level = tilt[i] + thrust
            space = wp.where(turn[i] > real(0.0), high[i] - level, level - low[i])
            share = wp.min(share, feasible_share(space, wp.abs(turn[i])))
        standing = slowest * slowest * vehicle.speed_max * vehicle.speed_max
        speeds = vec4(real(0.0))
        for i in range(4):
            square = b[i, 0] * (tilt[i] + thrust + share * turn[i]) / k
            if square > standing:
                speeds[i] = wp.sqrt(square)
        return speeds

    @wp.func
    def hold(
        vehicle: Vehicle,
        order: Order,
        motion: StateComponents,
        so_far: vec3,
        period: real,
    ) -> Answer:
        """As `position_hold.PositionHold`, and `pull_within`."""
        away = motion.position - order.target
        gained = -period * wp.cw_mul(order.integral, away)
        sums = so_far + gained
        for i in range(3):
            sums[i] = wp.clamp(sums[i], -order.limit, order.limit)
        back = -order.position[2] * away[2]
        dive = -order.velocity[2] * descent
        pull = sums - wp.cw_mul(order.velocity, motion.velocity)
        pull[0] = pull[0] - order.position[0] * away[0]
        pull[1] = pull[1] - order.position[1] * away[1]
        up = pull[2] + wp.max(back, dive) + gravity
        speed = vehicle.speed_max
        most = real(4.0) * vehicle.thrust_coefficient * speed * speed / vehicle.mass
        limited = wp.min(wp.max(up, floor), most)
        # Anti-windup: the integral does not grow while the limit that it drives into
        # acts.
        if ((back < dive or up < floor) and gained[2] < real(0.0)) or (
            up > most and gained[2] > real(0.0)
        ):
            sums[2] = so_far[2]
        across = slope * limited
        square = pull[0] * pull[0] + pull[1] * pull[1]
        if square > across * across:
            share = across / wp.sqrt(square)
            for i in range(2):
                if gained[i] * pull[i] > real(0.0):
                    sums[i] = so_far[i]
                pull[i] = share * pull[i]
        pull[2] = limited
        attitude = body.rotation(motion.quaternion)
        thrust = vehicle.mass * wp.max(wp.dot(pull, column(attitude, 2)), floor)
        w = motion.body_rate
        error = attitude_error(pull, order.heading, attitude)
        turn = -order.attitude * error - order.body_rate * w
        moment = vehicle.inertia @ turn + wp.cross(w, vehicle.inertia @ w)
        answer = Answer()
        answer.command = speeds_within(vehicle, thrust, moment)
        answer.integral = sums
        return answer

    return SimpleNamespace(order_of=order_of, hold=hold)


def orders(hold: PositionHold) -> Float[Array, "*batch row"]:
    """Return the numbers of a controller in the rows that `order_of` reads."""
    yaw, k = hold.yaw_rad[..., None], hold.gains
    # The last number of the heading is a zero of the shape of the batch.
    order = [hold.target_m, jnp.cos(yaw), jnp.sin(yaw), 0 * yaw]
    order += [k.position, k.velocity, k.integral]
    order += [x[..., None] for x in (k.attitude, k.body_rate, k.integral_limit)]
    return jnp.concatenate(order, axis=-1)


def refused(hold: PositionHold) -> str:
    """Return the unsupported option of a controller; "" if none."""
    return "control with a motor_lead" if hold.gains.motor_lead is not None else ""


KERNEL = ControllerKernel(hold_functions, orders, refused)
