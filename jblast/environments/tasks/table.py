"""The tasks by their names."""

from jblast.environments.tasks.detect import DETECT
from jblast.environments.tasks.hover import HOVER
from jblast.environments.tasks.mission import MISSION
from jblast.environments.tasks.rates import RATES
from jblast.environments.tasks.task import Task

TASKS: dict[str, Task] = {
    "Hover": HOVER,
    "Rates": RATES,
    "Mission": MISSION,
    "Detect": DETECT,
}
