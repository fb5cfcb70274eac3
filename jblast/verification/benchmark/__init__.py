"""The charts of speed against accuracy; each module registers its own.

A part of jblast with more than one method adds its chart to one of these modules.
"""

from jblast.verification.benchmark import (
    cameras as cameras,
    fits as fits,
    flights as flights,
    laws as laws,
    records as records,
)
from jblast.verification.benchmark.chart import BENCHMARKS as BENCHMARKS
