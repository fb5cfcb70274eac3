"""The rows of a mission: flown by the truth or by an estimate, for as long as it takes.

Guidance and hold are shown what the vehicle takes for its state. So what the guidance
said along the flight follows from that, and the waypoints' acceptance with it: whether
the vehicle was truly there is told by who looks at its rows.
"""

import math
from dataclasses import fields, replace
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from jblast.autopilot.estimator import Followed
from jblast.errors import InputError
from jblast.missions import (
    GuidanceHistory,
    Mission,
    MissionControl,
    planned_seconds,
    replay,
)
from jblast.missions.guidance import ENDED
from jblast.progress import counted
from jblast.scene import Scene, VehicleSpec
from jblast.study.flights.duration import MOST_STEPS
from jblast.study.flights.encounter import FlightLoad
from jblast.study.flights.fly import GROUND_UP_M, steady_wind
from jblast.study.flights.instruments import (
    Instruments,
    by_instruments,
    followed_along,
)
from jblast.study.flights.records import Options
from jblast.study.missions.outcome import crash_of
from jblast.vehicle import StepGust, Trajectory, hold_of, simulate, start_of, vehicle_of

SHARE, EACH_S, LEAST_S, UNIT_S = 0.05, 10.0, 10.0, 20.0
"""Of time beyond what was planned: a share of it, for each blast, in any case; all of
it in whole units, as each other duration is another program."""
AFTER_S = 1.0
"""What is kept after it was disarmed."""


class Rows(NamedTuple):
    """What a mission's flight leaves.

    Attributes:
        flight: The vehicle, in truth.
        guided: What the guidance said.
        followed: What it took for its state; None: the truth.
    """

    flight: Trajectory
    guided: GuidanceHistory
    followed: Followed | None


def flown(
    mission: Mission,
    spec: VehicleSpec,
    scene: Scene,
    load: FlightLoad,
    options: Options,
    instruments: Instruments | None = None,
) -> Rows:
    """Fly, for as long as is asked for, or until it is disarmed.

    Args:
        mission: What is to be flown.
        spec: The vehicle, where it stands.
        scene: Its air, and its charges.
        load: Of the blasts.
        options: How to fly.
        instruments: Of the vehicle, where it flies by what these say.

    Raises:
        InputError: It would take too many steps.
    """
    arguments = mission, spec, scene, load, options, instruments
    if options.seconds is not None:
        return _once(*arguments, options.seconds)
    rate = float(mission.guidance.acceleration_m_s2)
    planned = planned_seconds(mission.guidance.legs, rate)
    bound = planned * (1 + SHARE) + EACH_S * len(scene.charges) + LEAST_S
    seconds = UNIT_S * math.ceil(bound / UNIT_S)
    guided_twice = counted(2, "flights")
    rows = _once(*arguments, seconds)
    guided_twice(1)
    if np.asarray(rows.guided.phase)[-1] == ENDED or crash_of(rows.flight)[0]:
        return rows
    return _once(*arguments, 2 * seconds)


def cut(rows: Rows, options: Options) -> Rows:
    """Cut a flight off after it was disarmed, if nobody said how long."""
    phase = np.asarray(rows.guided.phase)
    time = np.asarray(rows.flight.time_s)
    if options.seconds is not None or phase[-1] != ENDED:
        return rows
    end = time[np.argmax(phase == ENDED)] + AFTER_S
    keep = int(np.sum(time <= end))
    whole = rows.flight
    names = [field.name for field in fields(whole) if field.name != "lost"]
    parts = {name: getattr(whole, name)[:keep] for name in names}
    others = jax.tree.map(lambda x: x[:keep], rows[1:])
    return Rows(Trajectory(**parts, lost=whole.lost), *others)


def _once(
    mission: Mission,
    spec: VehicleSpec,
    scene: Scene,
    load: FlightLoad,
    options: Options,
    instruments: Instruments | None,
    seconds: float,
) -> Rows:
    """Fly for some time."""
    step = options.step_s
    if seconds / step > MOST_STEPS:
        raise InputError(
            f"seconds: expected at most {MOST_STEPS * step:g} s in steps of {step:g} "
            f"s, got {seconds:g} s"
        )
    # what is a hold of a place else is who follows the set point here
    hold = hold_of(replace(spec, mission=None), integral=spec.integral is not False)
    control = MissionControl(mission.guidance, hold)
    start = start_of(spec)
    start = replace(start, rotor_speed_rad_s=0 * start.rotor_speed_rad_s)
    flier: Any = control
    if instruments is not None:
        flier = by_instruments(control, scene, start, load, instruments, 1 / step)
    flight = simulate(
        vehicle_of(spec),
        start,
        duration_s=seconds,
        step_s=step,
        integrator=options.integrator,
        control=flier,
        wind=StepGust(steady_wind(scene), 0 * scene.air.wind_east),
        loads=(load,),
        ground_up_m=GROUND_UP_M,
        backend=options.backend,
    )
    period, estimate, shown = jnp.asarray(step), None, flight.states
    if instruments is not None:
        estimate = followed_along(flier, flight, period)
        shown = estimate.shown
    return Rows(flight, replay(control.guidance, shown, period), estimate)
