"""Outcome of a mission: waypoints reached, disturbances by blasts, landing or crash.

The vehicle stands on the ground at time 0 of the scene's clock, calibrates, arms, takes
off, flies its plan and lands. Guidance and controller use the estimated state, so the
acceptance of waypoints follows from the estimate. The outcome is computed from the true
rows of the flight.
"""

import math
from dataclasses import dataclass, field

import jax
import numpy as np
from jaxtyping import Array, Bool, Float

from jblast.missions import Item, Mission, planned_seconds
from jblast.results import HIDDEN, among
from jblast.vehicle import Trajectory

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
class MissionOutcome:
    """Outcome of a mission.

    Attributes:
        waypoints: Items as flown, in order.
        disturbances: Effect of each blast on the flight.
        disarmed_s: Time of disarming; NaN if it did not happen.
        crash: Cause of a crash; "" without one.
    """

    waypoints: tuple[Waypoint, ...]
    disturbances: tuple[Disturbance, ...]
    disarmed_s: float
    crash: str

    @property
    def completed(self) -> bool:
        """True if each waypoint is reached and the flight ends without a crash."""
        reached = all(waypoint.reached for waypoint in self.waypoints)
        return not self.crash and bool(np.isfinite(self.disarmed_s)) and reached


def outcome_of(
    mission: Mission,
    flight: Trajectory,
    charges: tuple[str, ...],
    arrival_s: Float[Array, " blast"],
    tolerance_m: float,
) -> MissionOutcome:
    """Return the outcome of a mission.

    Args:
        mission: Mission as planned.
        flight: The flight.
        charges: Names of the charges.
        arrival_s: Arrival of each blast at the vehicle.
        tolerance_m: Path error within which the vehicle has recovered.
    """
    flight, came_s = jax.tree.map(np.asarray, (flight, arrival_s))
    crash, crashed_s = crash_of(flight)
    disarmed = _first(ended(flight), flight.time_s)
    return MissionOutcome(
        waypoints_of(mission, flight, crashed_s),
        disturbances_of(charges, came_s, mission, flight, tolerance_m),
        disarmed if math.isfinite(disarmed) else math.nan,
        crash,
    )


def longest_seconds(mission: Mission, blasts: int) -> float:
    """Return a duration in which a mission is completed unless it is delayed."""
    planned = planned_seconds(mission.guidance)
    bound = planned * (1 + EXTRA_SHARE) + EXTRA_PER_BLAST_S * blasts + EXTRA_S
    return DURATION_UNIT_S * math.ceil(bound / DURATION_UNIT_S)


def ended(flight: Trajectory) -> Bool[np.ndarray, " time"]:
    """Return the rows after the vehicle was disarmed."""
    armed = np.asarray(flight.armed)
    return ~armed & np.logical_or.accumulate(armed)


def kept_rows(flight: Trajectory) -> int:
    """Return the number of rows up to shortly after disarming; else that of all."""
    end = _first(ended(flight), np.asarray(flight.time_s)) + AFTER_DISARMING_S
    # rows are in order of time: their number is the index of the end
    return int(np.sum(np.asarray(flight.time_s) <= end))


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
    mission: Mission, flight: Trajectory, until_s: float
) -> tuple[Waypoint, ...]:
    """Return the items of a plan as flown.

    Args:
        mission: Mission as planned.
        flight: The flight, as NumPy arrays.
        until_s: Time of a crash; infinite without one.
    """
    time, place, error = flight.time_s, flight.position_m, flight.path_error_m
    landed_s = _first(ended(flight), time) if math.isinf(until_s) else math.inf
    found = []
    # of several stops of a visit the last one is its goal
    for n, last in {stop.visit: stop for stop in mission.stops}.items():
        here = (np.asarray(flight.item) == n) & (time < until_s)
        away = np.linalg.norm(place - last.goal_m, axis=1)
        off = np.where(here, away, np.inf)
        when, least = _first(off <= last.limits.acceptance_m, time), off.min()
        if last.lands:
            when = landed_s
            if math.isfinite(when):
                # on the ground: only the horizontal error counts
                least = math.dist(place[-1, :2], last.goal_m[:2])
        # of no row the square is NaN
        way = error[here] if here.any() else np.array([math.nan])
        found.append(
            Waypoint(
                item=mission.plan.items[last.item],
                goal_m=last.goal_m,
                reached=math.isfinite(when),
                time_s=when if math.isfinite(when) else math.nan,
                error_m=float(least) if math.isfinite(least) else math.nan,
                path_error_rms_m=float(np.sqrt(np.mean(np.square(way)))),
                path_error_max_m=float(way.max()),
            )
        )
    return tuple(found)


def disturbances_of(
    charges: tuple[str, ...],
    arrival_s: Float[np.ndarray, " blast"],
    mission: Mission,
    flight: Trajectory,
    tolerance_m: float,
) -> tuple[Disturbance, ...]:
    """Return the effect of each blast on the flight, in the order of the charges.

    Args:
        charges: Names of the charges.
        arrival_s: Arrival of each blast at the vehicle.
        mission: Mission as planned.
        flight: The flight, as NumPy arrays.
        tolerance_m: Path error within which the vehicle has recovered.
    """
    time, error_m, item = flight.time_s, flight.path_error_m, np.asarray(flight.item)
    items = {stop.visit: mission.plan.items[stop.item] for stop in mission.stops}
    found = []
    for name, came in zip(charges, arrival_s, strict=True):
        later = arrival_s[arrival_s > came]
        # until the next blast, whose effect does not count for this one
        until = min(later.min(initial=np.inf), came + WATCHED_S)
        rows = np.flatnonzero((item >= 0) & (time >= came) & (time < until))
        before = max(rows[0] - 1, 0) if rows.size else 0
        if not rows.size or item[before] < 0:
            unknown = (math.nan, math.nan, math.nan, math.nan)
            found.append(Disturbance(name, None, *unknown, None))
            continue
        error, since = error_m[rows], time[rows] - came
        # negated, because NaN compares as false and counts as outside
        outside = np.flatnonzero(~(error <= tolerance_m))
        # the row after the last one outside; none within the time: it does not return
        after = np.append(since, math.inf)
        recovery = float(after[outside[-1] + 1]) if outside.size else 0.0
        # a diverged vehicle is infinitely far, so that its peak is there
        peak = int(np.argmax(np.nan_to_num(error, nan=np.inf)))
        found.append(
            Disturbance(
                name,
                items[int(item[rows[0]])].number,
                float(error_m[before]),
                float(error[peak]),
                float(since[peak]),
                recovery,
                math.isfinite(recovery),
            )
        )
    return tuple(found)


def _first(
    rows: Bool[np.ndarray, " time"], time: Float[Array | np.ndarray, " time"]
) -> float:
    return float(time[np.argmax(rows)]) if rows.any() else math.inf
