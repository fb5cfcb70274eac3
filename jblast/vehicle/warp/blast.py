"""The load of a blast within a step as Warp functions, in one precision.

The equations are those of `vehicle.loads.blast` and `vehicle.loads.blast_wave`,
function by function: the tabulated wave, the impulse of its wind by Gauss's rule, and
its total impulse on a vehicle.
"""

from functools import cache
from types import SimpleNamespace
from typing import no_type_check

import numpy as np
import warp as wp

from jblast.constants import FLIGHT_GRAVITY
from jblast.scene.charge import BURSTS
from jblast.vehicle.loads.blast_wave import (
    NODES,
    PLACES,
    SO_FAR,
    WEIGHTS,
    WaveCurves,
    wave_curves,
)
from jblast.vehicle.warp.dynamics import body_functions

DRAG, FRONT, ROTORS = 1, 2, 4
"""Parts of a load, as bits: powers of two, so that one integer has any combination."""
GAUSS = np.column_stack([PLACES, WEIGHTS, SO_FAR])
"""Table of `Blasts.gauss`."""
COLUMNS = (
    *("east", "north", "up", "time", "nearest", "log_scale", "log_impulse_scale"),
    *("time_scale", "sound_speed", "wind_east", "wind_north", "wind_up", "density"),
)
"""Numbers of a blast: position, time, $S_d$ times the curves' first node, ln S_d, ln
S_d of the mass for impulses, its $S_t$, and the air."""


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
        """Impulse, angular impulse, and whether no later step receives any."""

        impulse: vec3
        turn: vec3
        over: bool

    Push = wp.struct(Push)

    @wp.func
    def blown(
        vehicle: Vehicle, motion: StateComponents, air: vec3, attitude: mat33
    ) -> Wrench:
        """Wrench of the rotors in air past the vehicle; force along world axes."""
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
        """As `BlastLoad.impulse`, for one blast."""
        n = wave.lane_of(blasts, lane)
        parts = blasts.parts[b]
        step = end - start
        total = Push()
        near = wave.way_to(blasts, b, n, motion.position)
        first = wave.since_arrival(blasts, b, n, near, start)
        if wp.isinf(first) and first < real(0.0):  # it never happens
            total.over = True
            return total
        # Before the front reaches the vehicle there is nothing to integrate. The margin
        # covers half of the crossing and twice the vehicle's own way.
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
        # Twice the duration, since a vehicle may still move along with the wave.
        total.over = first > real(2.0) * gone
        return total

    return SimpleNamespace(blast_impulse=blast_impulse)


@cache
@no_type_check
def drag_functions(real: type) -> SimpleNamespace:
    """Return types and functions of the blast wind's impulse.

    Args:
        real: `wp.float32` or `wp.float64`.
    """
    body, wave = body_functions(real), wave_functions(real)
    vec3, mat33, Vehicle, Wave = body.vec3, body.mat33, body.Vehicle, wave.Wave
    mat_n = wp.types.matrix((2 * NODES, 3), real)
    vec_n = wp.types.vector(2 * NODES, real)
    one, half = wp.constant(real(1.0)), wp.constant(real(0.5))
    # a quotient of literals within a kernel would be of single precision
    sphere = wp.constant(real(4.0 / np.pi))

    class Passage:
        """As `blast_wave.Passage`, with the constants of a step."""

        wave: Wave
        away: vec3
        start: real
        end: real
        rate: real
        front_speed: real
        density: real
        attitude: mat33
        air: vec3
        acceleration: vec3
        linear: vec3
        square: vec3

    class Given:
        """As `blast.WindImpulse`, and the velocity gained until each node."""

        body: vec3
        way: real
        square: real
        gained: mat_n

    Passage, Given = wp.struct(Passage), wp.struct(Given)

    @wp.func
    def drag_force(
        vehicle: Vehicle, attitude: mat33, density: real, past: vec3
    ) -> vec3:
        """As `blast.drag_force`."""
        on = wp.cw_mul(vehicle.area, wp.transpose(attitude) @ past)
        return half * density * vehicle.drag_coefficient * wp.length(on) * past

    @wp.func
    def width(vehicle: Vehicle) -> real:
        """Diameter of the sphere of the mean area; a millimetre where there is none."""
        area = (vehicle.area[0] + vehicle.area[1] + vehicle.area[2]) / real(3.0)
        if area > real(0.0):
            return wp.sqrt(sphere * area)
        return real(1e-3)

    @wp.func
    def front_impulse(vehicle: Vehicle, passage: Passage, since: real, u: real) -> real:
        """As `blast_wave.front_impulse`; u: the wind's speed then, or at the front."""
        across = since * passage.front_speed / width(vehicle)
        crossed = wp.clamp(across + half, real(0.0), one)
        mass = passage.density * vehicle.volume * (one + vehicle.added_mass)
        return mass * crossed * u

    @wp.func
    def front_until(vehicle: Vehicle, passage: Passage, since: real) -> real:
        """Return the impulse of the front until a time since arrival."""
        inside = wp.max(since, real(0.0))
        p = wave.overpressure(passage.wave, inside)
        u = wave.wind_speed(passage.wave, inside, p)
        return front_impulse(vehicle, passage, since, u)

    @wp.func
    def run(
        vehicle: Vehicle,
        passage: Passage,
        parts: int,
        gauss: wp.array2d[real],
        end: real,
        gained: mat_n,
    ) -> Given:
        """One Picard iteration of impulses and velocities: `run` of `wind_impulse`."""
        given = Given()
        given.body = vec3(real(0.0))
        given.way = real(0.0)
        given.square = real(0.0)
        forces = mat_n()
        speeds = vec_n()
        before = front_until(vehicle, passage, passage.start)
        until = vec3(real(0.0))
        for phase in range(2):
            low = real(0.0)
            high = passage.wave.duration
            if phase == 1:
                low = high
                high = high + passage.wave.suction_time
            low = wp.clamp(low, passage.start, end)
            high = wp.clamp(high, passage.start, end)
            width = (high - low) / passage.rate
            total = vec3(real(0.0))
            for k in range(NODES):
                row = phase * NODES + k
                since = low + (high - low) * gauss[k, 0]
                share = width * gauss[k, 1]
                p = wave.overpressure(passage.wave, since)
                # Density ratio of a shock by Rankine and Hugoniot, for a ratio of 1.4
                # of the heat capacities.
                ratio = (real(7.0) + real(6.0) * p) / (real(7.0) + p)
                speed = wave.wind_speed(passage.wave, since, p)
                past_s = (since - passage.start) / passage.rate
                moved = gained[row] + past_s * passage.acceleration
                gone = passage.air - moved
                along = wp.dot(passage.away, moved)
                square = speed * (speed - real(2.0) * along)
                force = vec3(real(0.0))
                if (parts & DRAG) != 0:
                    past = speed * passage.away + gone
                    dense = passage.density * ratio
                    force = drag_force(vehicle, passage.attitude, dense, past)
                    # Only the excess over the drag in ambient air is due to the blast.
                    force -= drag_force(
                        vehicle, passage.attitude, passage.density, gone
                    )
                given.body += share * force
                given.way += share * speed
                given.square += share * square
                if (parts & ROTORS) != 0:
                    force += speed * passage.linear + square * passage.square
                forces[row] = force
                speeds[row] = speed
                total += share * force
            for j in range(NODES):
                row = phase * NODES + j
                part = vec3(real(0.0))
                for k in range(NODES):
                    part += gauss[j, 2 + k] * forces[phase * NODES + k]
                part = until + width * part
                if (parts & FRONT) != 0:
                    since = low + (high - low) * gauss[j, 0]
                    leap = front_impulse(vehicle, passage, since, speeds[row]) - before
                    part += leap * passage.away
                given.gained[row] = part / vehicle.mass
            until += total
        if (parts & FRONT) != 0:
            leap = front_until(vehicle, passage, end) - before
            given.body += leap * passage.away
        return given

    return SimpleNamespace(Passage=Passage, run=run, width=width, mat_n=mat_n)


def curve_table() -> np.ndarray:
    """Return the rows of all curves: (curve, interval, 4)."""
    return np.stack([curve.rows for burst in BURSTS for curve in wave_curves(burst)])


@cache
@no_type_check
def wave_functions(real: type) -> SimpleNamespace:
    """Return types and functions of a wave at a position.

    Args:
        real: `wp.float32` or `wp.float64`.
    """
    vec3, vec4 = body_functions(real).vec3, body_functions(real).vec4
    table = wave_curves("surface").sound_fraction
    first, per_step = wp.constant(real(table.first)), wp.constant(real(1 / table.step))
    last_row = wp.constant(len(table.rows) - 1)
    own = wp.constant(len(WaveCurves._fields))
    names = {name: wp.constant(n) for n, name in enumerate(WaveCurves._fields)}
    ARRIVAL, PEAK, DURATION = names["sound_fraction"], names["peak"], names["duration"]
    DECAY, SUCTION = names["decay"], names["suction"]

    class Blasts:
        """Numbers of all blasts.

        `rows` has the axes blast, `COLUMNS`, and vehicle (or 1 for all). `burst` and
        `parts` select curves and parts of the load per blast. `gauss` has one row per
        node: position, weight, weights of the integral to the node.
        """

        count: int
        rows: wp.array3d[real]
        burst: wp.array[int]
        parts: wp.array[int]
        curves: wp.array2d[vec4]
        gauss: wp.array2d[real]

    class Way:
        """Distance, direction and sound speed from a blast to a position."""

        distance: real
        away: vec3
        speed: real

    class Wave:
        """As `loads.blast_wave.Wave`."""

        peak: real
        duration: real
        decay: real
        suction: real
        suction_time: real
        sound_speed: real
        afterflow: real

    Blasts, Way, Wave = wp.struct(Blasts), wp.struct(Way), wp.struct(Wave)

    @wp.func
    def lane_of(blasts: Blasts, lane: int) -> int:
        """Return the column of a vehicle's numbers."""
        return wp.min(lane, blasts.rows.shape[2] - 1)

    @wp.func
    def curve(blasts: Blasts, n: int, log_z: real) -> real:
        """Return the value of a curve, as `waves.tables.Table`."""
        position = (log_z - first) * per_step + real(1.0)
        row = wp.clamp(int(position), 0, last_row)
        t = position - real(row)
        c = blasts.curves[n, row]
        return c[0] + t * (c[1] + t * (c[2] + t * c[3]))

    @wp.func
    def way_to(blasts: Blasts, b: int, n: int, place: vec3) -> Way:
        """Return distance, direction and speed of sound along it."""
        off = place - vec3(
            blasts.rows[b, 0, n], blasts.rows[b, 1, n], blasts.rows[b, 2, n]
        )
        way = Way()
        way.distance = wp.max(wp.length(off), blasts.rows[b, 4, n])
        way.away = off / way.distance
        way.speed = blasts.rows[b, 8, n]
        way.speed += way.away[0] * blasts.rows[b, 9, n]
        way.speed += way.away[1] * blasts.rows[b, 10, n]
        return way

    @wp.func
    def since_arrival(blasts: Blasts, b: int, n: int, way: Way, time: real) -> real:
        """Return the time since the front's arrival at the end of a way."""
        log_z = wp.log(way.distance) - blasts.rows[b, 5, n]
        fraction = wp.exp(curve(blasts, blasts.burst[b] * own + ARRIVAL, log_z))
        return time - blasts.rows[b, 3, n] - way.distance / way.speed * fraction

    @wp.func
    def pulse_impulse(x: real, peak: real, duration: real, decay: real) -> real:
        """As `loads.blast_wave._pulse_impulse`."""
        left = wp.exp(-decay * x)
        gone = real(1.0) - left
        part = ((decay - real(1.0)) * gone + decay * x * left) / (decay * decay)
        return peak * duration * part

    @wp.func
    def wave_at(blasts: Blasts, b: int, n: int, distance: real) -> Wave:
        """As `loads.blast_wave.wave_at`."""
        log_r = wp.log(distance)
        log_z = log_r - blasts.rows[b, 5, n]
        row = blasts.burst[b] * own
        wave = Wave()
        wave.peak = wp.exp(curve(blasts, row + PEAK, log_z))
        wave.suction = wp.exp(curve(blasts, row + SUCTION, log_z))
        wave.decay = curve(blasts, row + DECAY, log_z)
        # The duration scales with the mass for impulses, which may differ from that for
        # pressures.
        own_z = log_r - blasts.rows[b, 6, n]
        wave.duration = wp.exp(curve(blasts, row + DURATION, own_z))
        wave.duration = wave.duration * blasts.rows[b, 7, n]
        # The integral of 6.75 s (1 - s)^2 is 9/16: the suction takes all of the
        # positive impulse back.
        impulse = pulse_impulse(real(1.0), wave.peak, wave.duration, wave.decay)
        wave.suction_time = real(16.0) / real(9.0) * impulse / wave.suction
        c = blasts.rows[b, 8, n]
        wave.sound_speed = c
        wave.afterflow = c * c / (real(1.4) * distance)
        return wave

    @wp.func
    def overpressure(wave: Wave, since: real) -> real:
        """As `loads.blast_wave.overpressure`."""
        if since < real(0.0):
            return real(0.0)
        x = wp.clamp(since / wave.duration, real(0.0), real(1.0))
        later = (since - wave.duration) / wave.suction_time
        s = wp.clamp(later, real(0.0), real(1.0))
        left = (real(1.0) - s) * (real(1.0) - s)
        pulse = wave.peak * (real(1.0) - x) * wp.exp(-wave.decay * x)
        # 6.75 is one over the largest value of s (1 - s)^2, that at s = 1/3.
        return pulse - real(6.75) * wave.suction * s * left

    @wp.func
    def wind_speed(wave: Wave, since: real, p: real) -> real:
        """As `loads.blast_wave.wind_speed`; p: the overpressure then."""
        x = wp.clamp(since / wave.duration, real(0.0), real(1.0))
        later = (since - wave.duration) / wave.suction_time
        s = wp.clamp(later, real(0.0), real(1.0))
        given = pulse_impulse(x, wave.peak, wave.duration, wave.decay)
        # The integral of s (1 - s)^2 from 0, over s^2.
        curved = real(0.5) - real(2.0) / real(3.0) * s + real(0.25) * s * s
        given -= wave.suction * wave.suction_time * real(6.75) * s * s * curved
        plane = real(5.0) / real(7.0) * wave.sound_speed * p
        plane = plane / wp.sqrt(real(1.0) + real(6.0) / real(7.0) * p)
        return plane + wave.afterflow * given

    return SimpleNamespace(
        Blasts=Blasts,
        Way=Way,
        Wave=Wave,
        lane_of=lane_of,
        way_to=way_to,
        since_arrival=since_arrival,
        wave_at=wave_at,
        overpressure=overpressure,
        wind_speed=wind_speed,
    )
