"""What the rows of a mission's flight amount to."""

import math
from typing import Any

import numpy as np
from jaxtyping import Array, Bool, Float

from jblast.missions import GuidanceHistory, Mission
from jblast.missions.guidance import ENDED, FLYING
from jblast.missions.limits import TOUCH_M_S
from jblast.study.missions.records import Disturbance, Waypoint
from jblast.vehicle import Trajectory

WATCHED_S = 10.0
"""How long after it came a blast is held to account for what a flight does."""


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
        guided: What the guidance said at them.
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
                path_error_rms_m=_rms(on_way),
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
        guided: What the guidance said at them.
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


def _rms(values: Float[np.ndarray, " row"]) -> float:
    return float(np.sqrt(np.mean(np.square(values)))) if values.size else math.nan
