"""Flights as logs and ground stations are told of them."""

from dataclasses import replace

import numpy as np

from jblast.autopilot.estimator import Followed
from jblast.autopilot.logs import Estimate, FlightRecord
from jblast.missions import Mission, Plan, mission_of, read_plan
from jblast.missions.guidance import ARMED, FLYING
from jblast.missions.mission import geodetic
from jblast.observations.places import Frame
from jblast.scene import Place, UncertainScene, VehicleSpec
from jblast.study.flights.fly import fly
from jblast.study.flights.records import Flights, Options
from jblast.study.flights.statistics import target_of, trajectory_of
from jblast.study.missions.fly import MISSION_STEP_S, TOLERANCE_M, fly_mission
from jblast.study.missions.records import MissionFlight
from jblast.vehicle import Trajectory, start_of, vehicle_of


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
