"""The parts of a chart of speed against accuracy.

Every part of jblast with more than one method registers a benchmark: its reference, and
a function that measures cost and error of each method on this machine.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from jaxtyping import Bool


@dataclass(frozen=True)
class BenchmarkPoint:
    """Measured cost and error of one method.

    Attributes:
        method: Name of the method.
        cost_s: Cost as defined by the benchmark, on this machine [s].
        error: Error as defined by the benchmark, positive.
        range: Description of the range of the measurement.
        panel: Panel of the figure; methods compete within one panel.
        whole: True if the range covers the panel; others are not on its Pareto front.
        is_reference: True if the other methods of the panel are compared with this one.
    """

    method: str
    cost_s: float
    error: float
    range: str
    panel: str = ""
    whole: bool = True
    is_reference: bool = False


@dataclass(frozen=True)
class Benchmark:
    """One chart: competing methods and their measurement.

    Attributes:
        name: Name on the command line.
        title: Title of the figure.
        cost: Definition of the cost, for the axis.
        error: Definition of the error, for the axis.
        relative: True if an error is a share, printed in per cent.
        measure: Function that measures all points and reports its progress
            (`jblast.progress`).
        orders: Expected orders of convergence for the figure, by the first word of the
            names of the points.
    """

    name: str
    title: str
    cost: str
    error: str
    measure: Callable[[], list[BenchmarkPoint]]
    relative: bool = True
    orders: Mapping[str, int] = field(default_factory=dict)


BENCHMARKS: dict[str, Benchmark] = {}


def register_benchmark(benchmark: Benchmark) -> Benchmark:
    """Register a benchmark, in place of any with the same name."""
    BENCHMARKS[benchmark.name] = benchmark
    return benchmark


def panels(points: Sequence[BenchmarkPoint]) -> dict[str, list[BenchmarkPoint]]:
    """Return the points of each panel, in order of appearance."""
    parts: dict[str, list[BenchmarkPoint]] = {}
    for point in points:
        parts.setdefault(point.panel, []).append(point)
    return parts


def on_pareto_front(points: Sequence[BenchmarkPoint]) -> Bool[np.ndarray, " point"]:
    """Return True for points that no other point of their panel dominates.

    Points with equal cost and error do not dominate one another.
    """
    front = np.zeros(len(points), bool)
    for i, one in enumerate(points):
        front[i] = one.whole and not any(
            other.whole
            and other.panel == one.panel
            and other.cost_s <= one.cost_s
            and other.error <= one.error
            and (other.cost_s < one.cost_s or other.error < one.error)
            for other in points
        )
    return front
