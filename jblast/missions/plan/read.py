"""Plans read, by what their files hold, and written, by what their names end in."""

import os
from pathlib import Path

from jblast.errors import InputError, read_text, shown
from jblast.files import write_text
from jblast.missions.plan.ground_control import (
    ground_control_text,
    read_ground_control,
)
from jblast.missions.plan.item import Plan
from jblast.missions.plan.waypoint_list import (
    HEAD,
    read_waypoint_list,
    waypoint_list_text,
)

EXPECTED = "a plan: QGroundControl's .plan, or QGC WPL 110"
WRITERS = {
    ".plan": ground_control_text,
    ".waypoints": waypoint_list_text,
    ".txt": waypoint_list_text,
}
"""By what a name ends in."""


def read_plan(path: str | os.PathLike[str]) -> Plan:
    """Read a plan, whatever its name.

    Args:
        path: QGroundControl's .plan, version 1, or a list of waypoints, QGC WPL 110.

    Raises:
        InputError: It is neither, or as in `read_ground_control`.

    Example:
        `plan = read_plan("campus.plan")`
    """
    text = read_text(path, EXPECTED)
    begin = text.lstrip()[:40]
    if begin.startswith("{"):
        return read_ground_control(text, str(path))
    if begin.startswith(HEAD):
        return read_waypoint_list(text.lstrip(), str(path))
    got = shown(begin.partition("\n")[0]) if begin else "an empty file"
    raise InputError(f"{path}: line 1: expected {EXPECTED}; got {got}")


def plan_text(plan: Plan, path: str | os.PathLike[str]) -> str:
    """Return a plan in the form that a file's name asks for.

    Raises:
        InputError: The name asks for none, or the plan lacks what its form has to say.
    """
    return WRITERS[check_form(path)](plan)


def check_form(path: str | os.PathLike[str]) -> str:
    """Return what a file's name ends in, one of `WRITERS`.

    Raises:
        InputError: It is none of them.
    """
    ending = Path(path).suffix.lower()
    if ending not in WRITERS:
        raise InputError(
            f"{path}: expected a name that ends in {', '.join(WRITERS)}, got "
            f"{ending or 'no ending'}"
        )
    return ending


def write_plan(plan: Plan, path: str | os.PathLike[str]) -> None:
    """Write a plan: .plan as QGroundControl's, .waypoints and .txt as QGC WPL 110.

    Raises:
        InputError: As in `plan_text`.
    """
    write_text(path, plan_text(plan, path))
