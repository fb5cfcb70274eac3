"""The position hold of `control.py` as functions of Warp, in one precision."""

from functools import cache
from types import SimpleNamespace
from typing import no_type_check

import warp as wp

from jblast.constants import FLIGHT_GRAVITY
from jblast.vehicle.kernels.body import body_functions


@cache
@no_type_check
def hold_functions(real: type) -> SimpleNamespace:
    """Return types and functions of the position hold.

    Args:
        real: `wp.float32` or `wp.float64`.
    """
    body = body_functions(real)
    vec3, vec4, mat33 = body.vec3, body.vec4, body.mat33
    Craft, Motion = body.Craft, body.Motion
    gravity = wp.constant(real(FLIGHT_GRAVITY))

    class Order:
        """Where to stay, the heading as a vector, and `Gains`."""

        target: vec3
        heading: vec3
        position: vec3
        velocity: vec3
        integral: vec3
        attitude: real
        body_rate: real
        limit: real

    class Answer:
        """Rotor speeds asked for, and the integral afterwards."""

        command: vec4
        integral: vec3

    Order, Answer = wp.struct(Order), wp.struct(Answer)

    @wp.func
    def order_of(rows: wp.array2d[real], lane: int) -> Order:
        """Read an order: a row a number, a column a vehicle, or one for all."""
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
        return v * (real(1.0) / wp.sqrt(wp.dot(v, v)))

    @wp.func
    def column(m: mat33, n: int) -> vec3:
        """Return a column."""
        return vec3(m[0, n], m[1, n], m[2, n])

    @wp.func
    def attitude_error(pull: vec3, heading: vec3, attitude: mat33) -> vec3:
        """Return how far the attitude is from the one a pull and a heading ask for."""
        b_3 = unit(pull)
        b_2 = unit(wp.cross(b_3, heading))
        b_1 = wp.cross(b_2, b_3)
        x = column(attitude, 0)
        y = column(attitude, 1)
        z = column(attitude, 2)
        return real(0.5) * vec3(
            wp.dot(b_3, y) - wp.dot(b_2, z),
            wp.dot(b_1, z) - wp.dot(b_3, x),
            wp.dot(b_2, x) - wp.dot(b_1, y),
        )

    @wp.func
    def rotor_speeds(craft: Craft, thrust: real, moment: vec3) -> vec4:
        """As `control.rotor_speeds`."""
        wanted = vec4(thrust, moment[0], moment[1], moment[2])
        each = craft.inverse_allocation @ wanted
        speeds = vec4(real(0.0))
        for i in range(4):
            speed = wp.sqrt(wp.abs(each[i]) / craft.thrust_coefficient)
            speeds[i] = wp.where(each[i] < real(0.0), -speed, speed)
        return speeds

    @wp.func
    def hold(
        craft: Craft,
        order: Order,
        motion: Motion,
        so_far: vec3,
        period: real,
    ) -> Answer:
        """As `control.PositionHold`."""
        away = motion.position - order.target
        sums = so_far - period * wp.cw_mul(order.integral, away)
        for i in range(3):
            sums[i] = wp.clamp(sums[i], -order.limit, order.limit)
        pull = sums - wp.cw_mul(order.position, away)
        pull -= wp.cw_mul(order.velocity, motion.velocity)
        pull[2] = pull[2] + gravity
        attitude = body.rotation(motion.quaternion)
        thrust = craft.mass * wp.dot(pull, column(attitude, 2))
        w = motion.body_rate
        error = attitude_error(pull, order.heading, attitude)
        turn = -order.attitude * error - order.body_rate * w
        moment = craft.inertia @ turn + wp.cross(w, craft.inertia @ w)
        answer = Answer()
        answer.command = rotor_speeds(craft, thrust, moment)
        answer.integral = sums
        return answer

    return SimpleNamespace(order_of=order_of, hold=hold)
