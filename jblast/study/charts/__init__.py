"""The charts of speed against accuracy that there are; each module registers its own.

A part of jblast with more than one method adds its module here.
"""

from jblast.fidelity import (
    chart_laws as chart_laws,
    chart_solver as chart_solver,
    chart_waveforms as chart_waveforms,
)
from jblast.fidelity.topic import TOPICS as TOPICS
from jblast.study.charts import (
    events as events,
    fits as fits,
    samplers as samplers,
    vehicle as vehicle,
)
