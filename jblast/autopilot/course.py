"""Course of a flight by command: the items that a vehicle flies from its take-off on.

A flight by command is a mission with items inserted at its beginning, at an
interruption or at its end. A flight that ends in the air is computed with a hover and a
landing, which end its plan; only the hover is shown.
"""

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

from jblast.errors import InputError
from jblast.missions.plan import (
    HEADING,
    JUMP,
    LAND,
    LOITER,
    LOITER_TIME,
    RELATIVE,
    RETURN,
    SPEED,
    TAKEOFF,
    Item,
    Plan,
)

INSERTED = -1
"""Number of an item that is not part of the mission."""
HOVER_S = 2.0
"""Time of hover at the end of a flight in the air, in which the vehicle comes to
rest."""
TAKEOFF_UP_M = 2.5
"""Height of a take-off above home: PX4's default."""


class Course(NamedTuple):
    """Items of a flight, from the take-off.

    Attributes:
        items: The items.
        numbers: Number of each item in the mission, or `INSERTED`.
    """

    items: tuple[Item, ...] = ()
    numbers: tuple[int, ...] = ()

    def then(self, items: Sequence[Item], first: int | None = None) -> "Course":
        """Return the course with additional items.

        Args:
            items: The items.
            first: Number of the first one in the mission; None: inserted items.
        """
        count = range(len(items))
        numbers = [INSERTED if first is None else first + n for n in count]
        return Course((*self.items, *items), (*self.numbers, *numbers))

    @property
    def hovers(self) -> bool:
        """True if the course ends in the air."""
        flown = [item.command for item in self.items if not item.ignored]
        return bool(flown) and flown[-1] not in (LAND, RETURN)

    def hovering(self) -> "Course":
        """Return the course with a hover of `HOVER_S` at its end in the air."""
        last = max(n for n, item in enumerate(self.items) if not item.ignored)
        if self.items[last].command != LOITER:
            return self.then([inserted(LOITER_TIME, HOVER_S)])
        # A loiter without end would end the plan.
        place = self.items[last].params[4:]
        hover = replace(
            self.items[last],
            command=LOITER_TIME,
            params=(HOVER_S, 0.0, 0.0, None, *place),
        )
        return self._replace(items=(*self.items[:last], hover, *self.items[last + 1 :]))

    def plan(self, mission: Plan | None) -> Plan:
        """Return the course as a plan that starts and ends on the ground.

        Args:
            mission: Mission with home and cruise speed; None: no mission.
        """
        items = self.items
        if self.hovers:
            items = (*self.hovering().items, inserted(LAND))
        return replace(mission or Plan(()), items=items)


def inserted(command: int, first: float = 0.0, up_m: float | None = None) -> Item:
    """Return an item at the present position, outside of the mission.

    Args:
        command: MAV_CMD.
        first: First parameter.
        up_m: Height above home; None: the present height.
    """
    return Item(INSERTED, command, RELATIVE, (first, 0.0, 0.0, None, None, None, up_m))


def course_of(
    plan: Plan,
    begin: Course | None = None,
    first: int = 0,
    up_m: float = TAKEOFF_UP_M,
) -> Course:
    """Return the course of a mission, with a take-off if the plan has none.

    Args:
        plan: The mission.
        begin: Course flown before; None: from the ground.
        first: Index of the first item to fly.
        up_m: Height of an added take-off above home.

    Raises:
        InputError: The mission has jumps and does not start from its first item.
    """
    begin, items = Course() if begin is None else begin, plan.items
    if first > 0 and any(item.command == JUMP for item in items):
        raise InputError(
            "expected item 0 first, as the mission has jumps, got item "
            f"{first}: start it from the ground"
        )
    moving = [
        item.command
        for item in items[first:]
        if not (item.ignored or item.command in (SPEED, HEADING))
    ]
    if not begin.items and moving and moving[0] != TAKEOFF:
        begin = begin.then([inserted(TAKEOFF, up_m=up_m)])
    # Changes of speed hold for all following items.
    speeds = [item for item in items[:first] if item.command == SPEED]
    return begin.then(speeds).then(items[first:], first)
