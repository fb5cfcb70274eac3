"""What was measured: tidy tables and their readers."""

from jblast.observations.grouping import some_rows as some_rows
from jblast.observations.placement import resolve_positions as resolve_positions
from jblast.observations.read import read as read
from jblast.observations.starter_scene import starter_scene as starter_scene
from jblast.observations.table import (
    CLOCK_TIMES as CLOCK_TIMES,
    QUANTITIES as QUANTITIES,
    TIMES as TIMES,
    Observations as Observations,
    observed as observed,
)
from jblast.observations.write import write as write
