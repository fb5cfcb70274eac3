"""The charts of speed against accuracy that there are; each module registers its own.

A part of jblast with more than one method adds its module here.
"""

from jblast.verification.benchmark import (
    detectors as detectors,
    events as events,
    fits as fits,
    flights as flights,
    laws as laws,
    montecarlo as montecarlo,
    records as records,
    samplers as samplers,
    shock_solver as shock_solver,
    views as views,
    waveforms as waveforms,
)
from jblast.verification.benchmark.chart import BENCHMARKS as BENCHMARKS
