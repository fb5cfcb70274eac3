"""Plans flown unattended: the file of a plan, its legs, who flies them, its end."""

from jblast.missions.control import MissionControl as MissionControl
from jblast.missions.guidance import Guidance as Guidance, Progress as Progress
from jblast.missions.legs import Legs as Legs
from jblast.missions.limits import Limits as Limits
from jblast.missions.mission import (
    Mission as Mission,
    mission_of as mission_of,
    planned_seconds as planned_seconds,
)
from jblast.missions.patterns import (
    grid_plan as grid_plan,
    orbit_plan as orbit_plan,
)
from jblast.missions.plan.item import Item as Item, Plan as Plan
from jblast.missions.plan.read import (
    plan_text as plan_text,
    read_plan as read_plan,
    write_plan as write_plan,
)
from jblast.missions.replay import GuidanceHistory as GuidanceHistory, replay as replay
