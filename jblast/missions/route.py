"""The way that a plan's items ask for: stops, jumps unrolled, speeds carried along."""

import math
from dataclasses import replace

import numpy as np
from jaxtyping import Float

from jblast.errors import InputError
from jblast.missions.limits import MOST_LEGS, Limits
from jblast.missions.plan.commands import (
    JUMP,
    LAND,
    LOITER,
    RETURN,
    SPEED,
    TAKEOFF,
)
from jblast.missions.plan.item import Item, Plan
from jblast.missions.stops import Stop, check_reach, held, stops_for
from jblast.observations.places.frame import Frame


def stops_of(
    plan: Plan,
    frame: Frame,
    home_m: Float[np.ndarray, "3"],
    limits: Limits,
    *,
    may_hover_on: bool = False,
) -> list[Stop]:
    """Return the places that a plan goes to, one after another.

    Args:
        plan: The plan.
        frame: Where east-north-up has its origin.
        home_m: Where the vehicle stands, on the ground.
        limits: How it is flown where the plan does not say.
        may_hover_on: Whether it may end in the air.

    Raises:
        InputError: The plan is empty, starts or ends in the air, goes on after it has
            landed, jumps where it cannot, or has a place that cannot be reached.
    """
    where = plan.where
    if not plan.items:
        raise InputError(f"{where}: items: expected a mission, got none: it is empty")
    order = _order(plan)
    first = next((n for n in order if plan.items[n].command != SPEED), None)
    if first is None or plan.items[first].command != TAKEOFF:
        got = "nothing to fly" if first is None else plan.items[first].words
        raise InputError(
            f"{where}: expected a take-off (22) first, as the vehicle stands on the "
            f"ground; got {got}: a mission that starts in the air"
        )
    speeds = {
        "speed_m_s": plan.hover_speed_m_s or limits.speed_m_s,
        "climb_m_s": limits.climb_m_s,
        "descent_m_s": limits.descent_m_s,
    }
    stops: list[Stop] = []
    at, ended, visit = np.array(home_m, float), False, 0
    for n in order:
        item = plan.items[n]
        if ended:
            raise InputError(
                f"{where}: {item.words}: expected nothing after the mission has ended, "
                "which a landing, a return and a loiter without end do"
            )
        if item.command == SPEED:
            _change(speeds, item, where)
            continue
        found = stops_for(item, n, at, home_m, frame, speeds, limits, where)
        for stop in found:
            check_reach(stop, home_m, f"{where}: {item.words}")
        stops += [replace(stop, visit=visit) for stop in found]
        visit += 1
        at = stops[-1].goal_m
        ended = item.command in (LAND, RETURN, LOITER)
    if not ended:
        last = stops[-1]
        stops.append(held(last))
    if not may_hover_on and not stops[-1].lands:
        raise InputError(
            f"{where}: expected a plan that ends with a landing (21) or a return (20), "
            "or a time after which it is cut off, as it hovers on for ever at its end"
        )
    return stops


def _order(plan: Plan) -> list[int]:
    """Return places in the plan in the order in which they come, jumps unrolled."""
    by_number = {item.number: n for n, item in enumerate(plan.items)}
    left: dict[int, int] = {}
    order: list[int] = []
    n = steps = 0
    while n < len(plan.items):
        item = plan.items[n]
        steps += 1
        if len(order) >= MOST_LEGS or steps > 2 * MOST_LEGS:
            raise InputError(
                f"{plan.where}: expected at most {MOST_LEGS:,} items when jumps are "
                "unrolled, got more"
            )
        if not item.auto_continue and n + 1 < len(plan.items):
            raise InputError(
                f"{plan.where}: {item.words}, autoContinue: expected true, as nobody "
                "is there to go on, got false"
            )
        if item.command != JUMP:
            order.append(n)
            n += 1
            continue
        goal, times = item.number_of(1, math.nan), item.number_of(2, math.nan)
        at = f"{plan.where}: {item.words}"
        if goal not in by_number:
            known = f"{plan.items[0].number} to {plan.items[-1].number}"
            raise InputError(
                f"{at}: expected the number of an item, {known}, got {goal:g}"
            )
        if not (times >= 0 and times == int(times)):
            raise InputError(
                f"{at}: expected how many times, 0 or more (-1, for ever, never ends "
                f"unattended), got {times:g}"
            )
        if left.setdefault(n, int(times)) > 0:
            left[n] -= 1
            n = by_number[int(goal)]
        else:
            del left[n]  # a jump around this one begins to count again
            n += 1
    return order


def _change(speeds: dict[str, float], item: Item, where: str) -> None:
    """Take in a change of speed."""
    kind, speed = item.number_of(1), item.number_of(2, -1.0)
    names = {0.0: "speed_m_s", 1.0: "speed_m_s", 2.0: "climb_m_s", 3.0: "descent_m_s"}
    if kind not in names:
        raise InputError(
            f"{where}: {item.words}, parameter 1: expected 0 to 3, got {kind:g}"
        )
    if speed == -1:  # no change
        return
    if not 0.05 <= speed <= 60.0:
        raise InputError(
            f"{where}: {item.words}, parameter 2: expected 0.05 to 60 m/s, or -1, got "
            f"{speed:g}"
        )
    speeds[names[kind]] = speed
