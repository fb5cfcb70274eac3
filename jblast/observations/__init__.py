"""What was measured: tidy tables and their readers."""

from jblast.observations.place import place as place
from jblast.observations.read import read as read
from jblast.observations.starter import starter_scene as starter_scene
from jblast.observations.table import (
    CLOCK_TIMES as CLOCK_TIMES,
    QUANTITIES as QUANTITIES,
    TIMES as TIMES,
    Observations as Observations,
)
from jblast.observations.together import some_rows as some_rows
from jblast.observations.write import write as write
