"""The impulse of a blast's wind within a step, as in `loads/blast/drag.py`."""

from functools import cache
from types import SimpleNamespace
from typing import no_type_check

import numpy as np
import warp as wp

from jblast.vehicle.loads.blast.quadrature import NODES, PLACES, SO_FAR, WEIGHTS
from jblast.vehicle.warp.kernels.body import body_functions
from jblast.vehicle.warp.kernels.wave import wave_functions

DRAG, FRONT, ROTORS = 1, 2, 4
"""Parts of a load, as bits."""

GAUSS = np.column_stack([PLACES, WEIGHTS, SO_FAR])
"""Of `Blasts.gauss`."""


@cache
@no_type_check
def drag_functions(real: type) -> SimpleNamespace:
    """Return types and functions of a wind's impulse.

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
        """As `passage.Passage`, with what does not change within a step."""

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
        """As `drag.WindImpulse`, and the velocity gained until each node."""

        body: vec3
        way: real
        square: real
        gained: mat_n

    Passage, Given = wp.struct(Passage), wp.struct(Given)

    @wp.func
    def drag_force(
        vehicle: Vehicle, attitude: mat33, density: real, past: vec3
    ) -> vec3:
        """As `drag.drag_force`."""
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
        """As `passage.front_impulse`; u: the wind's speed then, or at the front."""
        across = since * passage.front_speed / width(vehicle)
        crossed = wp.clamp(across + half, real(0.0), one)
        mass = passage.density * vehicle.volume * (one + vehicle.added_mass)
        return mass * crossed * u

    @wp.func
    def front_until(vehicle: Vehicle, passage: Passage, since: real) -> real:
        """Return what the front has given until then."""
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
        """One guess of impulses and velocities gained: `run` of `wind_impulse`."""
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
