"""Autonomous missions: plan files, legs and guidance."""

from typing import TYPE_CHECKING

from jblast.lazy import lazy_face

# Lazy, so that a plan is read, and refused, without JAX.
if TYPE_CHECKING:
    from jblast.missions.guidance import (
        Guidance as Guidance,
        Legs as Legs,
        MissionControl as MissionControl,
        Progress as Progress,
        replay as replay,
    )
    from jblast.missions.plan import (
        Item as Item,
        Plan as Plan,
        plan_text as plan_text,
        read_plan as read_plan,
        write_plan as write_plan,
    )
    from jblast.missions.route import (
        Limits as Limits,
        Mission as Mission,
        grid_plan as grid_plan,
        mission_of as mission_of,
        orbit_plan as orbit_plan,
        planned_seconds as planned_seconds,
    )

__getattr__, __dir__ = lazy_face(__name__)
