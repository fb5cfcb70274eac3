"""One step of a flight, as in `integrators.py`, and what acts within it."""

from functools import cache
from types import SimpleNamespace
from typing import no_type_check

import warp as wp

from jblast.vehicle.warp.kernels.body import body_functions
from jblast.vehicle.warp.kernels.gusts import gust_functions
from jblast.vehicle.warp.kernels.wave import wave_functions


@cache
@no_type_check
def step_functions(real: type) -> SimpleNamespace:
    """Return types and functions of a step.

    Args:
        real: `wp.float32` or `wp.float64`.
    """
    body, gust, wave = body_functions(real), gust_functions(real), wave_functions(real)
    vec4, Vehicle, StateComponents, Wrench = (
        body.vec4,
        body.Vehicle,
        body.StateComponents,
        body.Wrench,
    )
    half, third = wp.constant(real(0.5)), wp.constant(real(1.0 / 3.0))

    class Air:
        """What blows and pushes."""

        wind: gust.Gust
        blasts: wave.Blasts

    class Clock:
        """As `timetable.Ticks`, a row a step."""

        stages: wp.array2d[real]
        start: wp.array[real]
        step: wp.array[real]
        row: wp.array2d[int]
        sample: wp.array[int]
        store_every: int

    class Pilot:
        """What commands the rotors: 0 nothing, 1 a table, 2 the position hold."""

        kind: int
        table: wp.array3d[real]
        orders: wp.array2d[real]
        period: real

    Air, Clock, Pilot = wp.struct(Air), wp.struct(Clock), wp.struct(Pilot)

    @wp.func
    def asked(pilot: Pilot, lane: int, row: int) -> vec4:
        """Return a row of the table of commands."""
        n = wp.min(lane, pilot.table.shape[2] - 1)
        command = vec4()
        for i in range(4):
            command[i] = pilot.table[row, i, n]
        return command

    @wp.func
    def rk4(
        vehicle: Vehicle,
        air: Air,
        clock: Clock,
        pilot: Pilot,
        lane: int,
        n: int,
        motion: StateComponents,
        held: vec4,
        impulse_wrench: Wrench,
    ) -> StateComponents:
        """What `integrators.rk4_step` adds to a state."""
        step = clock.step[n]
        gain = StateComponents()
        rate = StateComponents()
        for stage in range(4):
            place = (stage + 1) / 2
            reach = wp.where(stage == 3, step, half * step)
            if stage == 0:
                reach = real(0.0)
            share = step * third
            if stage == 0 or stage == 3:
                share = share * half
            command = held
            if pilot.kind == 1:
                command = asked(pilot, lane, clock.row[n, place])
            wind = gust.wind_at(air.wind, lane, clock.stages[n, place])
            there = body.moved(motion, reach, rate)
            rate = body.rates(vehicle, there, command, wind, impulse_wrench)
            gain = body.moved(gain, share, rate)
        return gain

    @wp.func
    def euler(
        vehicle: Vehicle,
        air: Air,
        clock: Clock,
        pilot: Pilot,
        lane: int,
        n: int,
        motion: StateComponents,
        held: vec4,
        impulse_wrench: Wrench,
    ) -> StateComponents:
        """What `integrators.euler_step` adds to a state."""
        step = clock.step[n]
        command = held
        if pilot.kind == 1:
            command = asked(pilot, lane, clock.row[n, 1])
        wind = gust.wind_at(air.wind, lane, clock.stages[n, 1])
        rate = body.rates(vehicle, motion, command, wind, impulse_wrench)
        gain = body.moved(StateComponents(), step, rate)
        gain.position = step * (motion.velocity + gain.velocity)
        w = motion.body_rate + gain.body_rate
        gain.quaternion = step * body.turning(motion.quaternion, w)
        return gain

    return SimpleNamespace(Air=Air, Clock=Clock, Pilot=Pilot, rk4=rk4, euler=euler)
