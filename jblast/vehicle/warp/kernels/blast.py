"""The impulse of a blast within a step, as in `loads/blast/load.py`."""

from functools import cache
from types import SimpleNamespace
from typing import no_type_check

import warp as wp

from jblast.constants import FLIGHT_GRAVITY
from jblast.vehicle.warp.kernels.body import body_functions
from jblast.vehicle.warp.kernels.drag import ROTORS, drag_functions
from jblast.vehicle.warp.kernels.wave import wave_functions


@cache
@no_type_check
def blast_functions(real: type) -> SimpleNamespace:
    """Return the function of a blast's impulse.

    Args:
        real: `wp.float32` or `wp.float64`.
    """
    body, wave, drag = body_functions(real), wave_functions(real), drag_functions(real)
    vec3, mat33, Blasts = body.vec3, body.mat33, wave.Blasts
    Vehicle, StateComponents, Wrench = body.Vehicle, body.StateComponents, body.Wrench
    one, half = wp.constant(real(1.0)), wp.constant(real(0.5))
    gravity = wp.constant(real(FLIGHT_GRAVITY))
    # a quotient of literals within a kernel would be of single precision
    rankine = wp.constant(real(6.0 / 7.0))

    class Push:
        """Impulse and angular impulse; whether the wave has gone by, or never comes."""

        impulse: vec3
        turn: vec3
        over: bool

    Push = wp.struct(Push)

    @wp.func
    def blown(
        vehicle: Vehicle, motion: StateComponents, air: vec3, attitude: mat33
    ) -> Wrench:
        """Wrench of the rotors alone; air: past the vehicle; force along world axes."""
        u = wp.transpose(attitude) @ (-air)
        frame = -wp.length(u) * wp.cw_mul(vehicle.frame_drag, u)
        wrench = body.air_wrench(vehicle, motion.rotor_speed, u, motion.body_rate)
        wrench.force = attitude @ (wrench.force - frame)
        return wrench

    @wp.func
    def blast_impulse(
        vehicle: Vehicle,
        blasts: Blasts,
        b: int,
        lane: int,
        start: real,
        end: real,
        motion: StateComponents,
    ) -> Push:
        """As `BlastLoad.impulse`, of one blast."""
        n = wave.lane_of(blasts, lane)
        parts = blasts.parts[b]
        step = end - start
        total = Push()
        near = wave.way_to(blasts, b, n, motion.position)
        first = wave.since_arrival(blasts, b, n, near, start)
        if wp.isinf(first) and first < real(0.0):  # it never happens
            total.over = True
            return total
        # by the step's end its first half may cross, as the vehicle flies to meet it
        nearer = wp.length(motion.velocity) * real(2.0) * step + drag.width(vehicle)
        if first + step + nearer / near.speed < real(0.0):
            return total
        passage = drag.Passage()
        passage.attitude = body.rotation(motion.quaternion)
        ambient = vec3(
            blasts.rows[b, 9, n], blasts.rows[b, 10, n], blasts.rows[b, 11, n]
        )
        passage.air = ambient - motion.velocity
        still = blown(vehicle, motion, passage.air, passage.attitude)
        u = wp.transpose(passage.attitude) @ (-passage.air)
        frame = -wp.length(u) * wp.cw_mul(vehicle.frame_drag, u)
        flies = still.force + passage.attitude @ frame
        passage.acceleration = flies / vehicle.mass
        passage.acceleration[2] = passage.acceleration[2] - gravity
        way = (motion.velocity + passage.acceleration * (half * step)) * step
        passage.start = first
        later = wave.way_to(blasts, b, n, motion.position + way)
        passage.end = wave.since_arrival(blasts, b, n, later, end)
        span = passage.end - passage.start
        passage.rate = span / step
        met = wp.clamp(-passage.start / span, real(0.0), one)
        there = wave.way_to(blasts, b, n, motion.position + met * way)
        long = wave.wave_at(blasts, b, n, there.distance).duration * half
        left = wp.min(one, met + long / step)
        place = motion.position + (met + left) * half * way
        middle = wave.way_to(blasts, b, n, place)
        passage.away = middle.away
        passage.wave = wave.wave_at(blasts, b, n, middle.distance)
        fast = wp.sqrt(one + rankine * passage.wave.peak)
        passage.front_speed = passage.wave.sound_speed * fast
        passage.density = blasts.rows[b, 12, n]
        moment_linear = vec3(real(0.0))
        moment_square = vec3(real(0.0))
        if (parts & ROTORS) != 0:
            probe = passage.wave.sound_speed / real(10.0)
            wind = probe * passage.away
            ahead = blown(vehicle, motion, passage.air + wind, passage.attitude)
            back = blown(vehicle, motion, passage.air - wind, passage.attitude)
            by = one / (real(2.0) * probe)
            curved = by / probe
            passage.linear = (ahead.force - back.force) * by
            moment_linear = (ahead.moment - back.moment) * by
            passage.square = (
                ahead.force + back.force - real(2.0) * still.force
            ) * curved
            moment_square = ahead.moment + back.moment - real(2.0) * still.moment
            moment_square = moment_square * curved
        guess = drag.run(
            vehicle, passage, parts, blasts.gauss, passage.end, drag.mat_n()
        )
        pushed = guess.body + guess.way * passage.linear + guess.square * passage.square
        later_s = wp.dot(passage.away, pushed) / vehicle.mass * step * half
        over = middle.speed * fast
        end_s = wp.max(passage.end - later_s / over, passage.start)
        given = drag.run(vehicle, passage, parts, blasts.gauss, end_s, guess.gained)
        total.impulse = given.body + given.way * passage.linear
        total.impulse += given.square * passage.square
        on_body = wp.transpose(passage.attitude) @ given.body
        total.turn = wp.cross(vehicle.pressure_centre, on_body)
        total.turn += given.way * moment_linear + given.square * moment_square
        gone = passage.wave.duration + passage.wave.suction_time
        total.over = first > real(2.0) * gone  # the vehicle may still move after it
        return total

    return SimpleNamespace(blast_impulse=blast_impulse)
