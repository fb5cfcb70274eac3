"""Autonomous missions: plan files, legs and guidance."""

from jblast.missions.guidance import (
    Guidance as Guidance,
    GuidanceHistory as GuidanceHistory,
    Legs as Legs,
    MissionControl as MissionControl,
    Progress as Progress,
    replay as replay,
)
from jblast.missions.mission import (
    Limits as Limits,
    Mission as Mission,
    grid_plan as grid_plan,
    mission_of as mission_of,
    orbit_plan as orbit_plan,
    planned_seconds as planned_seconds,
)
from jblast.missions.plan import (
    Item as Item,
    Plan as Plan,
    plan_text as plan_text,
    read_plan as read_plan,
    write_plan as write_plan,
)
