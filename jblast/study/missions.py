"""Autonomous mission of a scene's vehicle through blasts.

The vehicle stands on the ground at time 0 of the scene's clock, calibrates, arms, takes
off, flies its plan and lands. Without a given duration the flight ends when the vehicle
is disarmed. Its length is bounded beforehand by the undisturbed legs plus a recovery
time for each blast; if that is too short, the mission is flown again with twice the
length.

Guidance and controller see the estimated state. So the acceptance of waypoints follows
from the estimate, and the outcome is computed from the true rows of the flight.
"""

import itertools
import math
from dataclasses import dataclass, field, fields, replace
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, ArrayLike, Bool, Float

from jblast.autopilot.estimator import Followed, Thrown
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
from jblast.missions.guidance import ENDED, FLYING
from jblast.progress import counted
from jblast.results import HIDDEN, Note, among, warning
from jblast.scene import Scene, UncertainScene, VehicleSpec
from jblast.study.flight_results import (
    Encounter,
    Exposure,
    FlightLoad,
    Options,
    load_of,
    with_bursts_at_start,
)
from jblast.study.flights import (
    GROUND_UP_M,
    MAX_STEPS,
    Instruments,
    by_instruments,
    checked_scene,
    drawn_scenes,
    drawn_values,
    encounter_along,
    exposed_along,
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
"""Default time step of integrator and controller [s]: PX4's 250 Hz."""
TOLERANCE_M = 0.2
"""Default tolerance of the path error [m]: undisturbed, corners stay below it."""
ENCOUNTER_ROW_S = 0.02
"""Time between the rows at which blasts are evaluated [s]: at 10 m/s a vehicle moves
0.2 m in it, little beside its distance from a charge."""
EXTRA_SHARE, EXTRA_PER_BLAST_S, EXTRA_S, DURATION_UNIT_S = 0.05, 10.0, 10.0, 20.0
"""Time beyond the planned one [s]: a share of it, for each blast, and always.

If it is too short, the mission is flown again with twice the time. The duration is a
multiple of the unit, because each duration compiles a program of its own.
"""
TOUCHDOWN_M_S = 1.5
"""Largest sink rate of a landing [m/s], by declaration twice `landing_m_s`; a faster
one is a crash."""
AFTER_DISARMING_S = 1.0
"""Time stored after the vehicle is disarmed [s], to show that it is at rest."""
WATCHED_S = 10.0
"""Time after its arrival in which a deviation is attributed to a blast [s],
declared."""


@dataclass(frozen=True)
class Disturbance:
    """The effect of one blast on the flight.

    Attributes:
        charge: Name of the charge; "" for a single one.
        waypoint: Number of the next item at its arrival; null before or after the
            flight.
        error_before_m: Path error at the arrival.
        peak_deviation_m: Largest path error until the next blast, 10 s at most.
        peak_time_s: Time of the peak after the arrival.
        recovery_time_s: Time from the arrival until the path error stays within the
            tolerance; 0 if it never leaves it, infinite if it does not return.
        recovered: Whether it returned; null before or after the flight.
    """

    charge: str
    waypoint: int | None
    error_before_m: float
    peak_deviation_m: float
    peak_time_s: float
    recovery_time_s: float
    recovered: bool | None


@dataclass(frozen=True)
class Waypoint:
    """One item of a plan as flown; an item repeated by a jump appears again.

    Attributes:
        item: Item of the plan.
        goal_m: Goal: east, north, up.
        reached: Whether the vehicle came within the acceptance radius; for a landing,
            whether vehicle and rotors came to rest on the ground.
        time_s: Time of this on the scene's clock; NaN if it did not happen.
        error_m: Smallest distance from the goal; for a landing the final horizontal
            distance.
        path_error_rms_m: Root mean square distance from the set point on the way to the
            goal; NaN if the vehicle did not fly to it.
        path_error_max_m: Largest such distance.
    """

    item: Item = field(metadata=among("index", "command"))
    goal_m: Float[np.ndarray, "3"] = field(metadata=HIDDEN)
    reached: bool
    time_s: float
    error_m: float
    path_error_rms_m: float
    path_error_max_m: float


@dataclass(frozen=True)
class MissionFlight:
    """Result of a mission.

    Attributes:
        vehicle: Vehicle section of the scene.
        mission: Mission as planned.
        options: Options of the flight.
        integral: Whether the controller has integral action.
        seconds: Duration, until a second after disarming or to the end.
        drawn: Sampled parameters, by name of `scene.PARAMETERS`.
        places_m: Positions of the charges, east, north, up.
        wind_m_s: Wind velocity towards east, north.
        trajectory: True states, one row for each step of the controller.
        guided: Output of the guidance at each row.
        path_error_m: Distance from the set point at each row.
        encounter: Arrivals and pressures of the blasts at the vehicle.
        exposure: Loads on the vehicle other than its motion.
        waypoints: Items as flown, in order.
        disturbances: Effect of each blast on the flight.
        thrown: Effect of the blasts on the state estimate; None without an estimator.
        followed: State estimate at each row; None without an estimator.
        disarmed_s: Time of disarming; NaN if it did not happen.
        crash: Cause of a crash; "" without one.
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
        """True if each waypoint is reached and the flight ends without a crash."""
        reached = all(waypoint.reached for waypoint in self.waypoints)
        return not self.crash and bool(np.isfinite(self.disarmed_s)) and reached


def mission_notes(flight: MissionFlight) -> list[Note]:
    """Return notes on the validity of the results."""
    ignored, met = flight.mission.plan.ignored, flight.encounter
    source = "laws" if flight.options.profile is None else "profile"
    missed = [one.waypoint is None for one in flight.disturbances]
    unfinished = not flight.crash and math.isnan(flight.disarmed_s)
    found = [(text, warning("remark", text=text)) for text in (*flight.notes, ignored)]
    found += [
        (flight.crash, warning("vehicle_crashed", cause=flight.crash)),
        (unfinished, warning("mission_unfinished")),
        (any(missed), warning("blast_not_in_flight")),
        (
            bool(np.any(~met.in_range & ~np.array(missed, bool))),
            warning("blast_out_of_range", source=source, share=1.0),
        ),
    ]
    return [note for holds, note in found if holds]


def fly_mission(
    uncertain: UncertainScene,
    options: Options | None = None,
    *,
    seed: int = 0,
    plan: Plan | None = None,
) -> MissionFlight:
    """Fly the mission of a scene's vehicle through its blasts.

    Args:
        uncertain: Scene; parameters with a prior are sampled.
        options: Options of the flight; None for steps of 4 ms until disarming.
        seed: Seed of the samples.
        plan: Plan in place of that of the scene; None for that of the scene.

    Raises:
        InputError: The scene or its plan cannot be flown, a parameter cannot be
            sampled, or an option is invalid.
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
    # the plan may place a vehicle that the scene does not place
    spec = replace(spec, position=jnp.asarray(mission.home_m))
    scene = drawn_scenes(uncertain, 1, seed)
    notes: tuple[str, ...] = ()
    if options.profile is None:
        scene, notes = with_bursts_at_start(scene, spec)
    load = load_of(scene, options.profile, options.load)
    instruments = None
    if options.estimator:
        # the magnetic field needs a geographic position
        place = uncertain.place or mission.plan.home
        instruments = instruments_of(place, seed, np.int64(0), options.step_s)
    rows = flown(mission, spec, scene, load, options, instruments)
    flight, guided, estimate = cut(rows, options)
    seconds = float(flight.time_s[-1])
    error = np.asarray(path_error(flight, above_ground(guided.set_point_m)))
    crash, crashed_s = crash_of(flight)
    every = max(1, round(ENCOUNTER_ROW_S / options.step_s))
    states = _states(flight, every)
    encounter = encounter_along(
        load, flight.time_s[::every], states.position_m, states.quaternion
    )
    vehicle = vehicle_of(spec)
    exposure = exposed_along(
        unwatched(scene), load, vehicle, encounter, flight.time_s[::every], states
    )
    # A charge that never detonates, as in a scene without [charge], is not reported.
    happens = np.array([not charge.never for charge in scene.charges])
    charges = list(itertools.compress(scene.charges, happens))
    encounter = jax.tree.map(lambda x: x[happens], encounter)
    ended = np.asarray(guided.phase) == ENDED
    disarmed = float(flight.time_s[np.argmax(ended)]) if ended.any() else math.nan
    return MissionFlight(
        vehicle=spec,
        mission=mission,
        options=options,
        integral=spec.integral is not False,
        seconds=seconds,
        drawn={name: float(x) for name, x in drawn_values(uncertain, scene).items()},
        places_m=np.array([np.stack(c.position_m) for c in charges]).reshape(-1, 3),
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
        if estimate is None or not charges
        else thrown_of(estimate, flight.time_s, encounter.arrival_s),
        followed=estimate,
        disarmed_s=disarmed,
        crash=crash,
        notes=notes,
    )


def above_ground(
    set_point_m: Float[ArrayLike, "time 3"],
) -> Float[np.ndarray, "time 3"]:
    """Return set points; those below the ground, for landing, on it."""
    return np.maximum(np.asarray(set_point_m), [-np.inf, -np.inf, GROUND_UP_M])


def _states(flight: Trajectory, every: int) -> State:
    """Return every `every`-th row as states; a diverged vehicle keeps its last one."""
    known = np.isfinite(np.asarray(flight.position_m)).all(axis=-1)
    # loads are evaluated at all rows: NaN positions would spread
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
    """Rows of a mission's flight.

    Attributes:
        flight: True states of the vehicle.
        guided: Output of the guidance.
        followed: State estimate; None without an estimator.
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
    """Return the rows of a flight of the given duration, or until disarming.

    Args:
        mission: Mission.
        spec: Vehicle section with the start position.
        scene: Scene with air and charges.
        load: Loads of the blasts.
        options: Options of the flight.
        instruments: Instruments of the state estimator; None without one.

    Raises:
        InputError: The flight has too many steps.
    """
    arguments = mission, spec, scene, load, options, instruments
    if options.seconds is not None:
        return _once(*arguments, options.seconds)
    planned = planned_seconds(mission.guidance)
    for_blasts = EXTRA_PER_BLAST_S * len(scene.charges)
    bound = planned * (1 + EXTRA_SHARE) + for_blasts + EXTRA_S
    seconds = DURATION_UNIT_S * math.ceil(bound / DURATION_UNIT_S)
    count_flight = counted(1, "flights")
    rows = _once(*arguments, seconds)
    if np.asarray(rows.guided.phase)[-1] != ENDED and not crash_of(rows.flight)[0]:
        # not disarmed in time: flown again from the start, for twice as long
        rows = _once(*arguments, 2 * seconds)
    count_flight(1)
    return rows


def cut(rows: Rows, options: Options) -> Rows:
    """Return a flight until shortly after disarming, unless its duration is given."""
    phase = np.asarray(rows.guided.phase)
    time = np.asarray(rows.flight.time_s)
    if options.seconds is not None or phase[-1] != ENDED:
        return rows
    end = time[np.argmax(phase == ENDED)] + AFTER_DISARMING_S
    # rows are in order of time: their number is the index of the end
    keep = int(np.sum(time <= end))
    whole = rows.flight
    names = [field.name for field in fields(whole) if field.name != "lost"]
    parts = {name: getattr(whole, name)[:keep] for name in names}
    outputs = jax.tree.map(lambda x: x[:keep], rows[1:])
    return Rows(Trajectory(**parts, lost=whole.lost), *outputs)


def _once(
    mission: Mission,
    spec: VehicleSpec,
    scene: Scene,
    load: FlightLoad,
    options: Options,
    instruments: Instruments | None,
    seconds: float,
) -> Rows:
    """Return the rows of a flight of `seconds`.

    Raises:
        InputError: The flight has too many steps.
    """
    step = options.step_s
    if seconds / step > MAX_STEPS:
        raise InputError(
            f"seconds: expected at most {MAX_STEPS * step:g} s in steps of {step:g} "
            f"s, got {seconds:g} s"
        )
    # the position controller of a hovering vehicle follows the set points here
    hold = hold_of(replace(spec, mission=None), integral=spec.integral is not False)
    control = MissionControl(mission.guidance, hold)
    start = start_of(spec)
    # a mission begins on the ground with its rotors at rest
    start = replace(start, rotor_speed_rad_s=0 * start.rotor_speed_rad_s)
    controller: Any = control
    if instruments is not None:
        controller = by_instruments(control, scene, start, load, instruments, 1 / step)
    flight = simulate(
        vehicle_of(spec),
        start,
        duration_s=seconds,
        step_s=step,
        control=controller,
        wind=StepGust(steady_wind(scene), 0 * scene.air.wind_east),
        loads=(load,),
        ground_up_m=GROUND_UP_M,
        backend=options.backend,
    )
    # after a divergence rows are NaN, which a state may not be: the last one stays
    period, estimate, shown = jnp.asarray(step), None, _states(flight, 1)
    if instruments is not None:
        estimate = followed_along(controller, flight, period)
        shown = estimate.shown
    return Rows(flight, replay(control.guidance, shown, period), estimate)


def crash_of(flight: Trajectory) -> tuple[str, float]:
    """Return cause and time [s] of a crash; "" and infinity without one.

    A vehicle crashes if it hits the ground (height 0) faster than a landing, turns
    over, or diverges.
    """
    time = np.asarray(flight.time_s)
    i, j = np.asarray(flight.quaternion)[:, :2].T
    # vertical component of the upward body axis
    over = 1 - 2 * (i * i + j * j) < 0
    up, velocity = np.asarray(flight.position_m)[:, 2], np.asarray(flight.velocity_m_s)
    # the simulation stops a vehicle at the ground: its speed is in the row before
    hits = np.zeros_like(over)
    hits[1:] = (up[1:] <= 0) & (up[:-1] > 0) & (velocity[:-1, 2] < -TOUCHDOWN_M_S)
    diverged = np.isnan(up)
    found = {
        "hit the ground": _first(hits, time),
        "turned over": _first(over, time),
        "diverged": _first(diverged, time),
    }
    # the first cause: the others may follow from it
    name = min(found, key=lambda key: found[key])
    return ("", math.inf) if math.isinf(found[name]) else (name, found[name])


def waypoints_of(
    mission: Mission,
    flight: Trajectory,
    guided: GuidanceHistory,
    error_m: Float[np.ndarray, " time"],
    until_s: float,
) -> tuple[Waypoint, ...]:
    """Return the items of a plan as flown.

    Args:
        mission: Mission as planned.
        flight: True rows.
        guided: Output of the guidance at these rows.
        error_m: Distance from the set point.
        until_s: Time of a crash; infinite without one.
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
            # at the end the vehicle is on the ground: only the horizontal error counts
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
    """Return the effect of each blast on the flight, in the order of the charges.

    Args:
        charges: Names of the charges.
        arrival_s: Arrival of each blast at the vehicle.
        mission: Mission as planned.
        flight: True rows.
        guided: Output of the guidance at these rows.
        error_m: Distance from the set point.
        tolerance_m: Path error within which the vehicle has recovered.
    """
    time, arrivals = np.asarray(flight.time_s), np.asarray(arrival_s)
    flies = np.asarray(guided.phase) == FLYING
    visit = np.asarray(mission.guidance.legs.visit)[np.asarray(guided.leg)]
    # of several stops of a visit the last one is its goal
    items = {stop.visit: mission.plan.items[stop.item] for stop in mission.stops}
    found = []
    for name, came in zip(charges, arrivals, strict=True):
        later = arrivals[arrivals > came]
        # until the next blast, whose effect does not count for this one
        until = min(later.min() if later.size else np.inf, came + WATCHED_S)
        rows = np.flatnonzero(flies & (time >= came) & (time < until))
        if not (rows.size and flies[max(rows[0] - 1, 0)]):
            unknown = (math.nan, math.nan, math.nan, math.nan)
            found.append(Disturbance(name, None, *unknown, None))
            continue
        error, since = error_m[rows], time[rows] - came
        # a diverged vehicle is infinitely far, so that its peak is there
        known = np.nan_to_num(error, nan=np.inf)
        # negated, because NaN compares as false and counts as outside
        outside = np.flatnonzero(~(error <= tolerance_m))
        recovery = 0.0
        if outside.size:
            last = int(outside[-1])
            recovery = math.inf if last + 1 == rows.size else float(since[last + 1])
        peak = int(np.argmax(known))
        found.append(
            Disturbance(
                name,
                items[int(visit[rows[0]])].number,
                float(error_m[max(rows[0] - 1, 0)]),
                float(error[peak]),
                float(since[peak]),
                recovery,
                math.isfinite(recovery),
            )
        )
    return tuple(found)


def _goal(mission: Mission, visit: int) -> Float[np.ndarray, "3"]:
    """Return the end of the legs of a visit."""
    legs: Any = mission.guidance.legs
    last = int(np.flatnonzero(np.asarray(legs.visit) == visit)[-1])
    # the endless hover behind the last waypoint has the same goal
    return np.asarray(legs.goal_m[last], float)


def _first(rows: Bool[np.ndarray, " time"], time: Float[np.ndarray, " time"]) -> float:
    return float(time[np.argmax(rows)]) if rows.any() else math.inf
