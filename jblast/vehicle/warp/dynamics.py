"""The equations of `vehicle.dynamics` as Warp functions, in one precision.

In single precision a short step's increment loses digits against the state: at 0.1 ms
the error after a flight of 2.5 s would be 2.5 mm. The rounding error of each sum is
therefore stored and added to the next one (Kahan 1965).
"""

from functools import cache
from types import SimpleNamespace
from typing import no_type_check

import warp as wp

from jblast.constants import FLIGHT_GRAVITY


@cache
@no_type_check
def body_functions(real: type) -> SimpleNamespace:
    """Return types and functions of a rigid body with four rotors.

    Args:
        real: `wp.float32` or `wp.float64`.
    """
    vec3, vec4 = wp.types.vector(3, real), wp.types.vector(4, real)
    mat33, mat44 = wp.types.matrix((3, 3), real), wp.types.matrix((4, 4), real)
    mat43 = wp.types.matrix((4, 3), real)
    gravity = wp.constant(real(FLIGHT_GRAVITY))

    class Vehicle:
        """Fields of `Vehicle` and `Body`, two inverse matrices and the motors' rate."""

        mass: real
        inertia: mat33
        inverse_inertia: mat33
        inverse_allocation: mat44
        rotor_position: mat43
        rotor_direction: vec4
        thrust_coefficient: real
        moment_coefficient: real
        rotor_drag: vec3
        translational_lift: real
        frame_drag: vec3
        motor_rate: real
        speed_min: real
        speed_max: real
        area: vec3
        drag_coefficient: real
        volume: real
        added_mass: real
        pressure_centre: vec3

    class StateComponents:
        """A state, or its rates."""

        position: vec3
        velocity: vec3
        quaternion: vec4
        body_rate: vec3
        rotor_speed: vec4

    class Wrench:
        """A force and a moment about the centre of mass."""

        force: vec3
        moment: vec3

    Vehicle, StateComponents, Wrench = (
        wp.struct(Vehicle),
        wp.struct(StateComponents),
        wp.struct(Wrench),
    )

    @wp.func
    def rotation(q: vec4) -> mat33:
        """As `state.rotation`: the quaternion has any length but zero."""
        s = real(2.0) / wp.dot(q, q)
        i = q[0] * s
        j = q[1] * s
        k = q[2] * s
        return mat33(
            real(1.0) - (j * q[1] + k * q[2]),
            i * q[1] - k * q[3],
            i * q[2] + j * q[3],
            i * q[1] + k * q[3],
            real(1.0) - (i * q[0] + k * q[2]),
            j * q[2] - i * q[3],
            i * q[2] - j * q[3],
            j * q[2] + i * q[3],
            real(1.0) - (i * q[0] + j * q[1]),
        )

    @wp.func
    def turning(q: vec4, w: vec3) -> vec4:
        """As `state.turning`."""
        v = vec3(q[0], q[1], q[2])
        a = real(0.5) * (q[3] * w + wp.cross(v, w))
        return vec4(a[0], a[1], a[2], real(-0.5) * wp.dot(v, w))

    @wp.func
    def air_wrench(vehicle: Vehicle, speed: vec4, u: vec3, w: vec3) -> Wrench:
        """As `dynamics.air_wrench`, along body axes; u: velocity through the air."""
        total = Wrench()
        # No guard at rest as in JAX: it is for derivatives, which a kernel does not
        # have.
        total.force = -wp.length(u) * wp.cw_mul(vehicle.frame_drag, u)
        total.moment = vec3(real(0.0))
        for i in range(4):
            arm = vehicle.rotor_position[i]
            at = u + wp.cross(w, arm)
            square = speed[i] * speed[i]
            thrust = vehicle.thrust_coefficient * square
            thrust += vehicle.translational_lift * (at[0] * at[0] + at[1] * at[1])
            pull = -speed[i] * wp.cw_mul(vehicle.rotor_drag, at)
            pull[2] = pull[2] + thrust
            total.force += pull
            total.moment += wp.cross(arm, pull)
            spin = vehicle.rotor_direction[i] * vehicle.moment_coefficient * square
            total.moment[2] = total.moment[2] + spin
        return total

    @wp.func
    def rates(
        vehicle: Vehicle,
        motion: StateComponents,
        command: vec4,
        wind: vec3,
        impulse_wrench: Wrench,
    ) -> StateComponents:
        """As `dynamics.rates`."""
        attitude = rotation(motion.quaternion)
        w = motion.body_rate
        u = wp.transpose(attitude) @ (motion.velocity - wind)
        air = air_wrench(vehicle, motion.rotor_speed, u, w)
        spin = wp.cross(w, vehicle.inertia @ w)
        rate = StateComponents()
        rate.position = motion.velocity
        rate.velocity = (attitude @ air.force + impulse_wrench.force) / vehicle.mass
        rate.velocity[2] = rate.velocity[2] - gravity
        rate.quaternion = turning(motion.quaternion, w)
        rate.body_rate = vehicle.inverse_inertia @ (
            air.moment + impulse_wrench.moment - spin
        )
        for i in range(4):
            target = wp.clamp(command[i], vehicle.speed_min, vehicle.speed_max)
            rate.rotor_speed[i] = (target - motion.rotor_speed[i]) * vehicle.motor_rate
        return rate

    @wp.func
    def moved(
        motion: StateComponents, step: real, rate: StateComponents
    ) -> StateComponents:
        """Return a state advanced linearly with given rates."""
        now = StateComponents()
        now.position = motion.position + step * rate.position
        now.velocity = motion.velocity + step * rate.velocity
        now.quaternion = motion.quaternion + step * rate.quaternion
        now.body_rate = motion.body_rate + step * rate.body_rate
        now.rotor_speed = motion.rotor_speed + step * rate.rotor_speed
        return now

    return SimpleNamespace(
        vec3=vec3,
        vec4=vec4,
        mat33=mat33,
        Vehicle=Vehicle,
        StateComponents=StateComponents,
        Wrench=Wrench,
        rotation=rotation,
        turning=turning,
        air_wrench=air_wrench,
        rates=rates,
        moved=moved,
    )


@cache
@no_type_check
def sum_functions(real: type) -> SimpleNamespace:
    """Return type and function of a compensated sum.

    Args:
        real: `wp.float32`, or `wp.float64`, which needs no compensation.
    """
    body = body_functions(real)
    StateComponents, vec4 = body.StateComponents, body.vec4
    one, half = wp.constant(real(1.0)), wp.constant(real(0.5))

    class Sum:
        """A state and the rounding error of its sum."""

        motion: StateComponents
        left: StateComponents

    Sum = wp.struct(Sum)

    @wp.func
    def lengthened(q: vec4, gain: vec4) -> vec4:
        """Return a quaternion increment that ends at length 1, to first order."""
        end = q + gain
        return gain + half * (one - wp.dot(end, end)) * end

    @wp.func
    def plain(before: Sum, gain: StateComponents) -> Sum:
        """Return the rounded sum."""
        after = Sum()
        gain.quaternion = lengthened(before.motion.quaternion, gain.quaternion)
        after.motion = body.moved(before.motion, one, gain)
        return after

    @wp.func
    def compensated(before: Sum, gain: StateComponents) -> Sum:
        """Return the sum including the previous rounding error (Kahan)."""
        gain.quaternion = lengthened(before.motion.quaternion, gain.quaternion)
        more = body.moved(gain, one, before.left)
        after = Sum()
        after.motion = body.moved(before.motion, one, more)
        # Gain of the rounded sum; the rest of the increment is carried over.
        added = body.moved(after.motion, -one, before.motion)
        after.left = body.moved(more, -one, added)
        return after

    # In float64 the rounding is 1e-9 of that in float32: compensation would only cost
    # time.
    add = compensated if real is wp.float32 else plain
    return SimpleNamespace(Sum=Sum, add=add)
