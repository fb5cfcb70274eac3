"""Whole flights as one Warp kernel: one thread per vehicle, its state in registers.

The physics is that of `vehicle.dynamics`, `vehicle.rollout` and `vehicle.loads`,
function by function; a test compares both. The kernel has no derivatives: the adjoint
of a loop that overwrites its state in registers would be wrong without a warning. Use
JAX for derivatives.
"""

from collections.abc import Callable
from functools import cache
from types import SimpleNamespace
from typing import no_type_check

import warp as wp

from jblast.vehicle.loads.load import FriedlanderGust, NWaveGust, StepGust
from jblast.vehicle.warp.blast import blast_functions, wave_functions
from jblast.vehicle.warp.dynamics import body_functions, sum_functions
from jblast.vehicle.warp.position_hold import hold_functions

COLUMNS = 23
"""Numbers of a stored row: position, velocity, quaternion, body rate, rotor speeds,
force, moment."""
OPTIONS = {"enable_backward": False, "max_unroll": 4, "fast_math": True}
"""Compiler options; fast division and roots in float32 on a GPU are twice as fast, with
relative errors near 1e-7."""
KINDS = {type(None): 0, StepGust: 1, NWaveGust: 2, FriedlanderGust: 3}
"""Integer of each type of gust in a kernel; 0: still air."""
FIELDS = ("start_s", "duration_s", "decay")
"""Rows of a gust after its velocity; 1 if the gust has no such field."""


@cache
@no_type_check
def rollout_kernel(
    real: type, controller: Callable = hold_functions
) -> SimpleNamespace:
    """Return the kernel and the types of its arguments.

    Args:
        real: `wp.float32` or `wp.float64`.
        controller: Functions of the controller (`vehicle.ControllerKernel`).
    """
    body, hold, steps = body_functions(real), controller(real), step_functions(real)
    gust, blast, sums = gust_functions(real), blast_functions(real), sum_functions(real)
    vec3, Vehicle, StateComponents, Wrench = (
        body.vec3,
        body.Vehicle,
        body.StateComponents,
        body.Wrench,
    )
    Air, Clock, Pilot = steps.Air, steps.Clock, steps.Pilot

    @wp.func
    def begun(start: wp.array2d[real], lane: int) -> StateComponents:
        """Return the initial state of a vehicle."""
        now = StateComponents()
        for i in range(3):
            now.position[i] = start[i, lane]
            now.velocity[i] = start[3 + i, lane]
            now.body_rate[i] = start[10 + i, lane]
        for i in range(4):
            now.quaternion[i] = start[6 + i, lane]
            now.rotor_speed[i] = start[13 + i, lane]
        now.quaternion = wp.normalize(now.quaternion)
        return now

    @wp.func
    def store(
        rows: wp.array3d[real], k: int, lane: int, motion: StateComponents, net: Wrench
    ) -> bool:
        """Write a row and return whether all its numbers are finite."""
        total = real(0.0)
        for i in range(3):
            rows[k, i, lane] = motion.position[i]
            rows[k, 3 + i, lane] = motion.velocity[i]
            rows[k, 10 + i, lane] = motion.body_rate[i]
            rows[k, 17 + i, lane] = net.force[i]
            rows[k, 20 + i, lane] = net.moment[i]
            total += motion.position[i] + motion.velocity[i] + motion.body_rate[i]
            total += net.force[i] + net.moment[i]
        for i in range(4):
            rows[k, 6 + i, lane] = motion.quaternion[i]
            rows[k, 13 + i, lane] = motion.rotor_speed[i]
            total += motion.quaternion[i] + motion.rotor_speed[i]
        # One test for 23 numbers: a NaN or an infinity in any makes the sum not finite.
        return wp.isfinite(total)

    @wp.func
    def net_wrench(
        vehicle: Vehicle, motion: StateComponents, rate: StateComponents
    ) -> Wrench:
        """As `dynamics.net_wrench`."""
        net = Wrench()
        net.force = vehicle.mass * rate.velocity
        w = motion.body_rate
        net.moment = vehicle.inertia @ rate.body_rate + wp.cross(w, vehicle.inertia @ w)
        return net

    advance = steps.rk4

    @wp.kernel(module="unique", enable_backward=False, module_options=OPTIONS)
    def rollout(
        vehicles: wp.array[Vehicle],
        air: Air,
        clock: Clock,
        pilot: Pilot,
        start: wp.array2d[real],
        ground: real,
        rows: wp.array3d[real],
        lost: wp.array[int],
    ):
        lane = wp.tid()
        vehicle = vehicles[wp.min(lane, vehicles.shape[0] - 1)]
        now = begun(start, lane)
        total = sums.Sum()
        total.motion = now
        # Without commands the rotors keep the speed of the start.
        command = now.rotor_speed
        memory = vec3(real(0.0))
        impulse_wrench = Wrench()
        rate = body.rates(
            vehicle,
            now,
            command,
            gust.wind_at(air.wind, lane, clock.stages[0, 0]),
            impulse_wrench,
        )
        alive = store(rows, 0, lane, now, net_wrench(vehicle, now, rate))
        row = wp.int32(1)
        passed = wp.int32(0)  # one bit per blast whose wave has passed
        count = clock.step.shape[0]
        if not alive:
            # A start that is not finite leaves all rows to the NaN below.
            row = 0
            count = 0
        for n in range(count):
            began = clock.start[n]
            if pilot.kind == 2 and clock.sample[n] != 0:
                order = hold.order_of(pilot.orders, lane)
                answer = hold.hold(vehicle, order, now, memory, pilot.period)
                command = answer.command
                memory = answer.integral
            impulse_wrench = Wrench()
            for b in range(air.blasts.count):
                # The bits fit 31 blasts; later ones are evaluated in every step, which
                # costs time only.
                bit = wp.where(b < 31, 1 << b, 0)
                if (passed & bit) == 0:
                    ended = began + clock.step[n]
                    given = blast.blast_impulse(
                        vehicle, air.blasts, b, lane, began, ended, now
                    )
                    impulse_wrench.force += given.impulse / clock.step[n]
                    impulse_wrench.moment += given.turn / clock.step[n]
                    if given.over:
                        passed = passed | bit
            gain = advance(
                vehicle, air, clock, pilot, lane, n, now, command, impulse_wrench
            )
            total = sums.add(total, gain)
            now = total.motion
            if now.position[2] < ground:
                now.position[2] = ground
                if now.velocity[2] < real(0.0):
                    now.velocity = vec3(real(0.0))
                    now.body_rate = vec3(real(0.0))
                total.motion = now
            if (n + 1) % clock.store_every == 0 or n + 1 == count:
                wind = gust.wind_at(air.wind, lane, clock.stages[n, 2])
                rate = body.rates(vehicle, now, now.rotor_speed, wind, impulse_wrench)
                alive = store(rows, row, lane, now, net_wrench(vehicle, now, rate))
                if not alive:
                    break
                row += 1
        while row < rows.shape[0]:
            for i in range(COLUMNS):
                rows[row, i, lane] = real(wp.nan)
            row += 1
        if not alive:
            lost[lane] = 1

    return SimpleNamespace(
        kernel=rollout,
        Vehicle=Vehicle,
        Air=Air,
        Clock=Clock,
        Pilot=Pilot,
    )


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
        """Wind and blasts."""

        wind: gust.Gust
        blasts: wave.Blasts

    class Clock:
        """As `rollout.Ticks`, one row per step."""

        stages: wp.array2d[real]
        start: wp.array[real]
        step: wp.array[real]
        row: wp.array2d[int]
        sample: wp.array[int]
        store_every: int

    class Pilot:
        """Source of rotor commands by `kind`: 0 none, 1 table, 2 controller."""

        kind: int
        table: wp.array3d[real]
        orders: wp.array2d[real]
        period: real

    Air, Clock, Pilot = wp.struct(Air), wp.struct(Clock), wp.struct(Pilot)

    @wp.func
    def command_row(pilot: Pilot, lane: int, row: int) -> vec4:
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
        """Increment of a state as in `dynamics.rk4_step`."""
        step = clock.step[n]
        gain = StateComponents()
        rate = StateComponents()
        # A loop with branches, not four calls: inlined, the kernel would hold four
        # copies of the rates.
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
                command = command_row(pilot, lane, clock.row[n, place])
            wind = gust.wind_at(air.wind, lane, clock.stages[n, place])
            there = body.moved(motion, reach, rate)
            rate = body.rates(vehicle, there, command, wind, impulse_wrench)
            gain = body.moved(gain, share, rate)
        return gain

    return SimpleNamespace(Air=Air, Clock=Clock, Pilot=Pilot, rk4=rk4)


@cache
@no_type_check
def gust_functions(real: type) -> SimpleNamespace:
    """Return the type and the function of a gust.

    Args:
        real: `wp.float32` or `wp.float64`.
    """
    vec3 = body_functions(real).vec3

    class Gust:
        """One row per number; one column per vehicle, or one for all."""

        kind: int
        rows: wp.array2d[real]

    Gust = wp.struct(Gust)

    @wp.func
    def wind_at(gust: Gust, lane: int, time: real) -> vec3:
        """Velocity of the air."""
        if gust.kind == 0:
            return vec3(real(0.0))
        n = wp.min(lane, gust.rows.shape[1] - 1)
        since = time - gust.rows[3, n]
        if since < real(0.0):
            return vec3(real(0.0))
        shape = real(1.0)
        if gust.kind > 1:
            phase = since / gust.rows[4, n]
            if gust.kind == 2:
                shape = real(1.0) - real(2.0) * phase
                if phase > real(1.0):
                    shape = real(0.0)
            else:
                shape = (real(1.0) - phase) * wp.exp(-gust.rows[5, n] * phase)
        peak = vec3(gust.rows[0, n], gust.rows[1, n], gust.rows[2, n])
        return shape * peak

    return SimpleNamespace(Gust=Gust, wind_at=wind_at)
