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
from jblast.missions import Plan, mission_of, read_plan
from jblast.missions.guidance import ENDED
from jblast.scene import UncertainScene
from jblast.study.flights.bursts import with_bursts_at_start
from jblast.study.flights.draws import checked_scene, drawn_scenes, drawn_values
from jblast.study.flights.encounter import encounter_of, load_of
from jblast.study.flights.exposure import exposed
from jblast.study.flights.fly import GROUND_UP_M, unwatched
from jblast.study.flights.instruments import instruments_of, thrown_of
from jblast.study.flights.records import Options
from jblast.study.missions.flown import cut, flown
from jblast.study.missions.outcome import crash_of, disturbances_of, waypoints_of
from jblast.study.missions.records import MissionFlight
from jblast.vehicle import State, Trajectory, path_error, vehicle_of

MISSION_STEP_S = 0.004
"""Of the integrator and the controller where nothing is said: PX4's 250 Hz."""
TOLERANCE_M = 0.2
"""Of the path error where nothing is said: undisturbed, corners stay below it."""
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
    instruments = None
    if options.estimator:
        place = uncertain.place or mission.plan.home
        instruments = instruments_of(place, seed, np.int64(0), options.step_s)
    rows = flown(mission, spec, scene, load, options, instruments)
    flight, guided, estimate = cut(rows, options)
    seconds = float(flight.time_s[-1])
    # a set point below the ground is there to make the vehicle land
    aim = np.maximum(np.asarray(guided.set_point_m), [-np.inf, -np.inf, GROUND_UP_M])
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
    ended = np.asarray(guided.phase) == ENDED
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
        guided=guided,
        path_error_m=error,
        encounter=encounter,
        exposure=exposure,
        waypoints=waypoints_of(mission, flight, guided, error, crashed_s),
        disturbances=disturbances_of(
            tuple(charge.name for charge in charges),
            encounter.arrival_s,
            mission,
            flight,
            guided,
            error,
            options.tolerance_m,
        ),
        thrown=None
        if estimate is None
        else thrown_of(estimate, flight.time_s, encounter.arrival_s),
        followed=estimate,
        disarmed_s=disarmed,
        crash=crash,
        notes=notes,
    )


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
