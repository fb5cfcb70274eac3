"""Logs of observations: one measurement a row, with readers, writers and checks."""

from typing import TYPE_CHECKING

from jblast.lazy import lazy_face
from jblast.observations.table import (
    Observations as Observations,
    observed as observed,
    some_rows as some_rows,
)
from jblast.quantities import (
    CLOCK_TIMES as CLOCK_TIMES,
    QUANTITIES as QUANTITIES,
    TIMES as TIMES,
)

if TYPE_CHECKING:
    from jblast.observations.log_io import (
        read as read,
        to_pandas as to_pandas,
        write as write,
    )
    from jblast.observations.placement import resolve_positions as resolve_positions
    from jblast.observations.records.formats import Scaling as Scaling
    from jblast.observations.records.stations import read_stations as read_stations
    from jblast.observations.scenes import starter_scene as starter_scene

__getattr__, __dir__ = lazy_face(__name__)
