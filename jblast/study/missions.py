"""A scene's vehicle on its mission through blasts, without a pilot.

The vehicle stands on the ground at time 0 of the scene's clock, calibrates, arms, takes
off, flies its plan and lands. Without a given duration the flight ends when the vehicle
is disarmed. Its length is bounded beforehand by the undisturbed legs plus a recovery
time for each blast; if that is too short, the mission is flown again with twice the
length.

Guidance and controller see the estimated state. So the acceptance of waypoints follows
from the estimate, and the outcome is computed from the true rows of the flight.
"""

import math
from dataclasses import dataclass, fields, replace
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float

from jblast.autopilot.estimator import Followed, Thrown
from jblast.autopilot.logs import Estimate, FlightRecord
from jblast.errors import InputError
from jblast.missions import (
    GuidanceHistory,
    Item,
    Mission,
    MissionControl,
    Plan,
    mission_of,
    planned_seconds,
    read_plan,
    replay,
)
from jblast.missions.guidance import ARMED, ENDED, FLYING
from jblast.missions.mission import geodetic
from jblast.observations.places import Frame
from jblast.progress import counted
from jblast.scene import Place, Scene, UncertainScene, VehicleSpec
from jblast.study.flight_results import (
    Encounter,
    Exposure,
    FlightLoad,
    Flights,
    Options,
    load_of,
    target_of,
    trajectory_of,
    with_bursts_at_start,
)
from jblast.study.flights import (
    GROUND_UP_M,
    MOST_STEPS,
    Instruments,
    by_instruments,
    checked_scene,
    drawn_scenes,
    drawn_values,
    encounter_along,
    exposed_along,
    fly,
    followed_along,
    instruments_of,
    steady_wind,
    thrown_of,
    unwatched,
)
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
"""Default of the integrator and the controller: PX4's 250 Hz."""
TOLERANCE_M = 0.2
"""Default for the path error: undisturbed, corners stay below it."""
EACH_ROW_S = 0.02
"""Rows at which the blasts are looked for."""
SHARE, EACH_S, LEAST_S, UNIT_S = 0.05, 10.0, 10.0, 20.0
"""Of time beyond what was planned: a share of it, for each blast, in any case; all of
it in whole units, as each other duration is another program."""
TOUCH_M_S = 1.5
"""Greatest speed of a landing, else it is a crash. Declared: twice `landing_m_s`."""
AFTER_S = 1.0
"""Time stored after the vehicle is disarmed."""
WATCHED_S = 10.0
"""Time after its arrival over which a deviation is attributed to a blast."""


@dataclass(frozen=True)
class Disturbance:
    """The effect of one blast on the flight.

    Attributes:
        charge: Its name; "" of one alone.
        waypoint: On the way to which, from 0; -1: before or after the flight.
        error_before_m: Path error as it came.
        peak_deviation_m: Greatest path error until the next blast, 10 s at most.
        peak_time_s: When, after it came.
        recovery_time_s: From its arrival until the path error stayed within the
            tolerance, over the same time; 0: it never left; null: it did not.
    """

    charge: str
    waypoint: int
    error_before_m: float
    peak_deviation_m: float
    peak_time_s: float
    recovery_time_s: float


@dataclass(frozen=True)
class Waypoint:
    """One item as it was flown; an item that is jumped back to is there again.

    Attributes:
        item: Of the plan.
        goal_m: Where to: east, north, up.
        reached: Whether the vehicle came within the acceptance radius; of a landing,
            whether it stood on the ground and its rotors as well.
        time_s: When, on the scene's clock; null: never.
        error_m: Least distance from it; of a landing, over ground at its end.
        path_error_rms_m: Root mean square of the distance from the set point on the
            way there; null: it was not set out for.
        path_error_max_m: The greatest.
    """

    item: Item
    goal_m: Float[np.ndarray, "3"]
    reached: bool
    time_s: float
    error_m: float
    path_error_rms_m: float
    path_error_max_m: float


@dataclass(frozen=True)
class MissionFlight:
    """A mission that was flown.

    Attributes:
        vehicle: Its section of the scene.
        mission: What it was to fly.
        options: How it was flown.
        integral: Whether its hold has integral action.
        seconds: How long, until a second after it was disarmed, or cut off.
        drawn: What was drawn, by name of `scene.PARAMETERS`.
        places_m: Of the charges, east, north, up.
        wind_m_s: Towards east, north.
        trajectory: A row each time that its controller was asked.
        guided: Output of the guidance at each row.
        path_error_m: Distance from the set point at each row.
        encounter: How the blasts came to it.
        exposure: What they did to it beside moving it.
        waypoints: Each item as it was flown, in order.
        disturbances: By blast.
        thrown: What the blasts did to its estimate; None: it flew by the truth.
        followed: What it took for its state at each row; None: the truth.
        disarmed_s: When it was disarmed; NaN: never.
        crash: What it crashed by; "" if it did not.
        notes: Further remarks.
    """

    vehicle: VehicleSpec
    mission: Mission
    options: Options
    integral: bool
    seconds: float
    drawn: dict[str, float]
    places_m: Float[np.ndarray, "blast 3"]
    wind_m_s: Float[np.ndarray, "2"]
    trajectory: Trajectory
    guided: GuidanceHistory
    path_error_m: Float[np.ndarray, " time"]
    encounter: Encounter
    exposure: Exposure
    waypoints: tuple[Waypoint, ...]
    disturbances: tuple[Disturbance, ...]
    thrown: Thrown | None
    followed: Followed | None
    disarmed_s: float
    crash: str
    notes: tuple[str, ...]

    @property
    def completed(self) -> bool:
        """Whether it came to its end without a crash, each waypoint reached."""
        reached = all(waypoint.reached for waypoint in self.waypoints)
        return not self.crash and bool(np.isfinite(self.disarmed_s)) and reached


def mission_record(flight: MissionFlight) -> FlightRecord:
    """Return the rows of a mission."""
    phase = np.asarray(flight.guided.phase)
    visit = np.asarray(flight.mission.guidance.legs.visit)
    item_of_visit = {stop.visit: stop.item for stop in flight.mission.stops}
    last = max(item_of_visit)
    items = np.array([item_of_visit[min(n, last)] for n in range(int(visit.max()) + 1)])
    record = _record(flight.trajectory, flight.vehicle, flight.mission.frame)
    known = record.time_s.size
    return replace(
        record,
        armed=((phase >= ARMED) & (phase <= FLYING))[:known],
        item=items[visit[np.asarray(flight.guided.leg)]][:known],
        set_point_m=np.asarray(flight.guided.set_point_m)[:known],
        estimate=_estimate(flight.followed, known),
    )


def hold_record(flights: Flights, place: Place) -> FlightRecord:
    """Return the rows of one vehicle that held its place, by the first of its holds.

    Args:
        flights: Of one vehicle.
        place: Where the scene's origin lies.
    """
    trajectory = trajectory_of(flights, next(iter(flights.holds)))
    record = _record(trajectory, flights.vehicle, Frame(*place))
    found = next(iter(flights.holds.values())).followed
    record = replace(record, estimate=_estimate(found, record.time_s.size))
    aim = np.broadcast_to(target_of(flights.vehicle), record.position_m.shape)
    return replace(record, set_point_m=aim)


def standing_record(spec: VehicleSpec, place: Place) -> FlightRecord:
    """Return the one row of a vehicle that has not begun."""
    start = start_of(replace(spec, mission=None))
    return FlightRecord(
        time_s=np.zeros(1),
        position_m=np.asarray(start.position_m)[None],
        velocity_m_s=np.zeros((1, 3)),
        quaternion=np.asarray(start.quaternion)[None],
        body_rate_rad_s=np.zeros((1, 3)),
        controls=np.zeros((1, 4)),
        armed=np.zeros(1, bool),
        item=np.zeros(1, int),
        frame=Frame(*place),
    )


def home_of(spec: VehicleSpec, place: Place) -> Place:
    """Return where a scene's vehicle stands on the Earth."""
    return Place(*map(float, geodetic(Frame(*place), np.asarray(spec.position))))


def check_flown(uncertain: UncertainScene, plan: Plan | None = None) -> Plan:
    """Return the plan of a scene's vehicle, if it can be flown.

    Args:
        uncertain: The scene.
        plan: In place of its own.

    Raises:
        InputError: It cannot.
    """
    spec = uncertain.scene.vehicle
    assert spec is not None
    if plan is None:
        assert spec.mission is not None
        plan = read_plan(spec.mission)
    _mission(uncertain, spec, plan)
    return plan


def flown_record(
    uncertain: UncertainScene, plan: Plan | None, seed: int
) -> FlightRecord:
    """Fly a scene's vehicle, on a plan or holding its place, and return the rows.

    Args:
        uncertain: The scene, with its place.
        plan: None: it holds its place.
        seed: Of the draws.

    Raises:
        InputError: It cannot be flown.
    """
    place = uncertain.place
    assert place is not None
    if plan is None:
        return hold_record(fly(uncertain, Options(), seed=seed), place)
    options = Options(step_s=MISSION_STEP_S, tolerance_m=TOLERANCE_M)
    return mission_record(fly_mission(uncertain, options, plan=plan, seed=seed))


def _mission(uncertain: UncertainScene, spec: VehicleSpec, plan: Plan) -> Mission:
    return mission_of(
        plan,
        place=uncertain.place,
        position_m=np.asarray(spec.position, float) if spec.placed else None,
        yaw_rad=float(spec.yaw),
    )


def _estimate(found: Followed | None, known: int) -> Estimate | None:
    """Return the rows of an estimate that are known."""
    if found is None:
        return None
    shown = found.shown
    parts = (shown.position_m, shown.velocity_m_s, shown.quaternion)
    return Estimate(*(np.asarray(part)[:known] for part in parts))


def _record(trajectory: Trajectory, spec: VehicleSpec, frame: Frame) -> FlightRecord:
    """Return the rows of a trajectory up to where it was lost, if it was."""
    known = int(np.isfinite(np.asarray(trajectory.position_m)).all(axis=1).sum())
    vehicle = vehicle_of(spec)

    def rows(name: str) -> np.ndarray:
        return np.asarray(getattr(trajectory, name))[:known]

    return FlightRecord(
        time_s=rows("time_s"),
        position_m=rows("position_m"),
        velocity_m_s=rows("velocity_m_s"),
        quaternion=rows("quaternion"),
        body_rate_rad_s=rows("body_rate_rad_s"),
        controls=rows("rotor_speed_rad_s") / float(vehicle.rotor_speed_max_rad_s),
        armed=np.ones(known, bool),
        item=np.zeros(known, int),
        frame=frame,
    )


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
    encounter = encounter_along(
        load, flight.time_s[::every], states.position_m, states.quaternion
    )
    vehicle = vehicle_of(spec)
    exposure = exposed_along(
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


class Rows(NamedTuple):
    """What a mission's flight leaves.

    Attributes:
        flight: The vehicle, in truth.
        guided: Output of the guidance.
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
    """End a flight without a given duration after the vehicle is disarmed."""
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


def crash_of(flight: Trajectory) -> tuple[str, float]:
    """Return what a vehicle crashed by, and when [s]; "" and infinity: by nothing.

    It hit the ground, at 0, faster than a landing may, turned over, or diverged.
    """
    time = np.asarray(flight.time_s)
    i, j = np.asarray(flight.quaternion)[:, :2].T
    over = 1 - 2 * (i * i + j * j) < 0
    up, sinks = np.asarray(flight.position_m)[:, 2], np.asarray(flight.velocity_m_s)
    # as it touches the ground its speed is gone: the row before knows it
    hits = np.zeros_like(over)
    hits[1:] = (up[1:] <= 0) & (up[:-1] > 0) & (sinks[:-1, 2] < -TOUCH_M_S)
    gone = np.isnan(up)
    found = {
        "hit the ground": _first(hits, time),
        "turned over": _first(over, time),
        "diverged": _first(gone, time),
    }
    name = min(found, key=lambda key: found[key])
    return ("", math.inf) if math.isinf(found[name]) else (name, found[name])


def waypoints_of(
    mission: Mission,
    flight: Trajectory,
    guided: GuidanceHistory,
    error_m: Float[np.ndarray, " time"],
    until_s: float,
) -> tuple[Waypoint, ...]:
    """Return each item as it was flown.

    Args:
        mission: What was to be flown.
        flight: Its rows.
        guided: Output of the guidance at these rows.
        error_m: Distance from the set point.
        until_s: When it crashed; infinite: it did not.
    """
    time, place = np.asarray(flight.time_s), np.asarray(flight.position_m)
    phase = np.asarray(guided.phase)
    visit = np.asarray(mission.guidance.legs.visit)[np.asarray(guided.leg)]
    flies = (phase == FLYING) & (time < until_s)
    ended = (phase == ENDED).any() and math.isinf(until_s)
    found = []
    for n in sorted({stop.visit for stop in mission.stops}):
        last = [stop for stop in mission.stops if stop.visit == n][-1]
        here = flies & (visit == n)
        goal = _goal(mission, n)
        off = np.linalg.norm(place - goal, axis=1)
        off = np.where(here, off, np.inf)
        near = off <= last.acceptance_m
        when, least = _first(near, time), float(off.min())
        if last.lands:
            near[:] = ended
            when = _first(phase == ENDED, time) if ended else math.inf
            # where it lies, if it does
            away = np.linalg.norm((place - goal)[:, :2], axis=1)
            least = float(away[-1]) if ended else least
        on_way = error_m[here]
        found.append(
            Waypoint(
                item=mission.plan.items[last.item],
                goal_m=goal,
                reached=bool(near.any()),
                time_s=when if math.isfinite(when) else math.nan,
                error_m=least if math.isfinite(least) else math.nan,
                path_error_rms_m=float(np.sqrt(np.mean(np.square(on_way))))
                if on_way.size
                else math.nan,
                path_error_max_m=float(on_way.max()) if on_way.size else math.nan,
            )
        )
    return tuple(found)


def disturbances_of(
    charges: tuple[str, ...],
    arrival_s: Float[Array, " blast"],
    mission: Mission,
    flight: Trajectory,
    guided: GuidanceHistory,
    error_m: Float[np.ndarray, " time"],
    tolerance_m: float,
) -> tuple[Disturbance, ...]:
    """Return what each blast did, in the order of the charges.

    Args:
        charges: Names.
        arrival_s: Of each at the vehicle.
        mission: What was to be flown.
        flight: Its rows.
        guided: Output of the guidance at these rows.
        error_m: Distance from the set point.
        tolerance_m: Within which a vehicle has recovered.
    """
    time, arrivals = np.asarray(flight.time_s), np.asarray(arrival_s)
    flies = np.asarray(guided.phase) == FLYING
    visit = np.asarray(mission.guidance.legs.visit)[np.asarray(guided.leg)]
    found = []
    for name, came in zip(charges, arrivals, strict=True):
        later = arrivals[arrivals > came]
        until = min(later.min() if later.size else np.inf, came + WATCHED_S)
        rows = np.flatnonzero(flies & (time >= came) & (time < until))
        if not (rows.size and flies[max(rows[0] - 1, 0)]):
            found.append(Disturbance(name, -1, *[math.nan] * 4))
            continue
        error, since = error_m[rows], time[rows] - came
        known = np.nan_to_num(error, nan=np.inf)
        outside = np.flatnonzero(~(error <= tolerance_m))
        recovery = 0.0
        if outside.size:
            last = int(outside[-1])
            recovery = math.inf if last + 1 == rows.size else float(since[last + 1])
        peak = int(np.argmax(known))
        found.append(
            Disturbance(
                name,
                int(visit[rows[0]]),
                float(error_m[max(rows[0] - 1, 0)]),
                float(error[peak]),
                float(since[peak]),
                recovery,
            )
        )
    return tuple(found)


def _goal(mission: Mission, visit: int) -> Float[np.ndarray, "3"]:
    """Return where the legs of a visit end."""
    legs: Any = mission.guidance.legs
    last = int(np.flatnonzero(np.asarray(legs.visit) == visit)[-1])
    # a hold for ever behind the last waypoint is at the same place
    return np.asarray(legs.goal_m[last], float)


def _first(rows: Bool[np.ndarray, " time"], time: Float[np.ndarray, " time"]) -> float:
    return float(time[np.argmax(rows)]) if rows.any() else math.inf
