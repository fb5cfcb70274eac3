"""What was measured: tidy tables and their readers."""

from jblast.observations.table import QUANTITIES as QUANTITIES
from jblast.observations.table import TIMES as TIMES
from jblast.observations.table import Observations as Observations
