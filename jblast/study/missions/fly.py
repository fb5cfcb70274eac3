"""A scene's vehicle on its mission, through the scene's blasts, unattended.

It stands on the ground, at 0, when the scene's clock begins; calibrates, arms, takes
off, flies its plan, and lands. Without a duration the flight ends when it has been
disarmed. How long that takes is bounded beforehand: what the legs take undisturbed, and
for each blast time to come back; where that does not do, it is flown once more, twice
as long.
"""

import math
from dataclasses import replace

import jax.numpy as jnp
import numpy as np

from jblast.errors import InputError
from jblast.kept_programs import kept
from jblast.missions import (
    Mission,
    MissionControl,
    Plan,
    Told,
    mission_of,
    planned_seconds,
    read_plan,
    replay,
)
from jblast.missions.guidance import ENDED
from jblast.progress import counted
from jblast.scene import Scene, UncertainScene, VehicleSpec
from jblast.study.flights.bursts import with_bursts_at_start
from jblast.study.flights.draws import checked_scene, drawn_scenes, drawn_values
from jblast.study.flights.duration import MOST_STEPS
from jblast.study.flights.encounter import FlightLoad, encounter_of, load_of
from jblast.study.flights.exposure import exposed
from jblast.study.flights.fly import GROUND_UP_M, steady_wind, unwatched
from jblast.study.flights.records import Options
from jblast.study.missions.outcome import crash_of, disturbances_of, waypoints_of
from jblast.study.missions.records import MissionFlight
from jblast.vehicle import (
    State,
    StepGust,
    Trajectory,
    hold_of,
    path_error,
    simulate,
    start_of,
    vehicle_of,
)

MISSION_STEP_S = 0.004
"""Of the integrator and the controller where nothing is said: PX4's 250 Hz."""
TOLERANCE_M = 0.2
"""Of the path error where nothing is said: undisturbed, corners stay below it."""
SHARE, EACH_S, LEAST_S, UNIT_S = 0.05, 10.0, 10.0, 20.0
"""Of time beyond what was planned: a share of it, for each blast, in any case; all of
it in whole units, as each other duration is another program."""
AFTER_S = 1.0
"""What is kept after it was disarmed."""
EACH_ROW_S = 0.02
"""Rows at which the blasts are looked for."""


def fly_mission(
    uncertain: UncertainScene,
    options: Options | None = None,
    *,
    seed: int = 0,
    plan: Plan | None = None,
) -> MissionFlight:
    """Fly the mission of a scene's vehicle through its blasts.

    Args:
        uncertain: The scene; what has a prior is drawn from it.
        options: How to fly; None: steps of 4 ms, until it is disarmed.
        seed: Of the draws.
        plan: In place of the scene's own; None: this.

    Raises:
        InputError: The scene or its plan cannot be flown, a number cannot be drawn, or
            an option cannot be used.
    """
    if options is None:
        options = Options(step_s=MISSION_STEP_S, tolerance_m=TOLERANCE_M)
    for name in ("seconds", "step_s", "tolerance_m"):
        value = getattr(options, name)
        if value is not None and not (math.isfinite(value) and value > 0):
            raise InputError(f"{name}: expected a positive number, got {value:g}")
    spec = checked_scene(uncertain, 1, options.profile is not None)
    if spec.mission is None and plan is None:
        raise InputError(
            f"{uncertain.source or 'scene'}: [vehicle] mission: expected the file of a "
            "plan, got nothing"
        )
    mission = mission_of(
        read_plan(spec.mission or "") if plan is None else plan,
        place=uncertain.place,
        position_m=np.asarray(spec.position, float) if spec.placed else None,
        yaw_rad=float(spec.yaw),
        may_hover_on=options.seconds is not None,
    )
    spec = replace(spec, position=jnp.asarray(mission.home_m))
    scene = drawn_scenes(uncertain, 1, seed)
    notes: tuple[str, ...] = ()
    if options.profile is None:
        scene, notes = with_bursts_at_start(scene, spec)
    load = load_of(scene, options.profile, options.load)
    charges = scene.charges
    flight, told = _flown(mission, spec, scene, load, options, len(charges))
    flight, told, seconds = _cut(flight, told, options)
    # a set point below the ground is there to make the vehicle land
    aim = np.maximum(np.asarray(told.set_point_m), [-np.inf, -np.inf, GROUND_UP_M])
    error = np.asarray(path_error(flight, aim))
    crash, crashed_s = crash_of(flight)
    every = max(1, round(EACH_ROW_S / options.step_s))
    states = _states(flight, every)
    encounter = _encounter(
        load, flight.time_s[::every], states.position_m, states.quaternion
    )
    vehicle = vehicle_of(spec)
    exposure = _exposed(
        unwatched(scene), load, vehicle, encounter, flight.time_s[::every], states
    )
    ended = np.asarray(told.phase) == ENDED
    disarmed = float(flight.time_s[np.argmax(ended)]) if ended.any() else math.nan
    return MissionFlight(
        vehicle=spec,
        mission=mission,
        options=options,
        integral=spec.integral is not False,
        seconds=seconds,
        drawn={name: float(x) for name, x in drawn_values(uncertain, scene).items()},
        places_m=np.stack([np.stack(c.position_m) for c in charges]),
        wind_m_s=np.array([scene.air.wind_east, scene.air.wind_north]),
        trajectory=flight,
        told=told,
        path_error_m=error,
        encounter=encounter,
        exposure=exposure,
        waypoints=waypoints_of(mission, flight, told, error, crashed_s),
        disturbances=disturbances_of(
            tuple(charge.name for charge in charges),
            encounter.arrival_s,
            mission,
            flight,
            told,
            error,
            options.tolerance_m,
        ),
        disarmed_s=disarmed,
        crash=crash,
        notes=notes,
    )


def _flown(
    mission: Mission,
    spec: VehicleSpec,
    scene: Scene,
    load: FlightLoad,
    options: Options,
    blasts: int,
) -> tuple[Trajectory, Told]:
    """Fly, for as long as is asked for, or until it is disarmed."""
    rate = float(mission.guidance.acceleration_m_s2)
    planned = planned_seconds(mission.guidance.legs, rate)
    if options.seconds is not None:
        return _once(mission, spec, scene, load, options, options.seconds)
    bound = planned * (1 + SHARE) + EACH_S * blasts + LEAST_S
    seconds = UNIT_S * math.ceil(bound / UNIT_S)
    told_twice = counted(2, "flights")
    flight, told = _once(mission, spec, scene, load, options, seconds)
    told_twice(1)
    if np.asarray(told.phase)[-1] == ENDED or crash_of(flight)[0]:
        return flight, told
    return _once(mission, spec, scene, load, options, 2 * seconds)


def _once(
    mission: Mission,
    spec: VehicleSpec,
    scene: Scene,
    load: FlightLoad,
    options: Options,
    seconds: float,
) -> tuple[Trajectory, Told]:
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
    wind = steady_wind(scene)
    flight = simulate(
        vehicle_of(spec),
        start,
        duration_s=seconds,
        step_s=step,
        integrator=options.integrator,
        control=control,
        wind=StepGust(wind, 0 * scene.air.wind_east),
        loads=(load,),
        ground_up_m=GROUND_UP_M,
        backend=options.backend,
    )
    return flight, replay(control.guidance, flight, jnp.asarray(step))


def _cut(
    flight: Trajectory, told: Told, options: Options
) -> tuple[Trajectory, Told, float]:
    """Cut a flight off after it was disarmed, if nobody said how long."""
    phase = np.asarray(told.phase)
    time = np.asarray(flight.time_s)
    keep = time.size
    if options.seconds is None and phase[-1] == ENDED:
        end = time[np.argmax(phase == ENDED)] + AFTER_S
        keep = int(np.sum(time <= end))
    parts = {
        name: getattr(flight, name)[:keep]
        for name in flight.__dataclass_fields__
        if name != "lost"
    }
    cut = Trajectory(**parts, lost=flight.lost)
    return cut, Told(*(x[:keep] for x in told)), float(time[keep - 1])


def _states(flight: Trajectory, every: int) -> State:
    """Return every so many rows as states; those of a vehicle lost are its last."""
    known = np.isfinite(np.asarray(flight.position_m)).all(axis=-1)
    last = max(int(known.sum()) - 1, 0)
    rows = np.minimum(np.arange(0, known.size, every), last)
    return State(
        flight.position_m[rows],
        flight.velocity_m_s[rows],
        flight.quaternion[rows],
        flight.body_rate_rad_s[rows],
        flight.rotor_speed_rad_s[rows],
    )


_encounter = kept(encounter_of)
_exposed = kept(exposed)
