"""The shock solver: what more cells cost, and what they bring.

Held against the exact point source, whose table was made of runs with up to 800 cells
and agrees with another author's by the method of characteristics to 1e-6.
"""

import jax.numpy as jnp
import numpy as np

from jblast.fidelity import solver
from jblast.progress import in_words
from jblast.verification.benchmark.chart import (
    Benchmark,
    BenchmarkPoint,
    register_benchmark,
)
from jblast.waves.curves import log_sound_fraction
from jblast.waves.laws.point_source import log_overpressure_ratio, point_source_arrival

CELLS = (50, 100, 200, 400)
SPANS = ((0.1, 1.0), (1.0, 10.0), (10.0, 100.0))
"""Scaled distances lambda of the panels; the run begins at 0.02."""


def solver_points() -> list[BenchmarkPoint]:
    """Return the cost of a run and its largest error in pressure and arrival."""
    tell = in_words()
    log_lambda = jnp.log(solver.NODES)
    exact = {
        "pressure": log_overpressure_ratio(log_lambda),
        "arrival": log_sound_fraction(log_lambda, point_source_arrival()),
    }
    exact = {what: np.asarray(value) for what, value in exact.items()}
    costs, runs = {}, {}
    for cells in CELLS:
        tell(f"{cells} cells")
        costs[cells] = solver.seconds_of_run(cells)
        run = solver.decay(cells)
        runs[cells] = {
            "pressure": np.log(run.overpressure_ratio),
            "arrival": np.log(run.arrival / run.scaled),
        }
    points = []
    for start, end in SPANS:
        inside = (start <= solver.NODES) & (end >= solver.NODES)
        for what, value in exact.items():
            span = f"{what}, lambda = {start:g} to {end:g}"
            for cells, said in runs.items():
                off = np.abs(np.expm1(said[what] - value))[inside]
                worst = float(off.max())
                points.append(
                    BenchmarkPoint(f"{cells} cells", costs[cells], worst, span, span)
                )
    return points


register_benchmark(
    Benchmark(
        name="solver",
        title="Shock solver: cost of a run against error",
        cost="a run of the point source from lambda = 0.02 to 100",
        error="the largest over the span, beside the exact point source",
        measure=solver_points,
    )
)
