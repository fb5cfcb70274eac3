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
    """One method as measured.

    Attributes:
        method: Its name.
        cost_s: Seconds of this machine, of what the benchmark counts.
        error: What the benchmark counts, positive.
        range: Over what it was measured, in words.
        panel: Which part of the figure it belongs to; methods compete within one.
        whole: Whether it covers all of the panel; only such can be on its Pareto front.
        is_reference: Whether the others of the panel are held against it.
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
    """One chart: methods that compete, and how they are measured.

    Attributes:
        name: As on the command line.
        title: Of the figure.
        cost: What a cost is of, for the axis.
        error: What an error is of, for the axis.
        relative: Whether an error is a share, to be read in per cent.
        measure: Measures all points, and reports its progress (`jblast.progress`).
        orders: Of convergence, by the word with which the names of a method's points
            begin: how its errors should fall as its costs rise, for the figure.
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
    """Enter a benchmark; one of the same name is replaced."""
    BENCHMARKS[benchmark.name] = benchmark
    return benchmark


def panels(points: Sequence[BenchmarkPoint]) -> dict[str, list[BenchmarkPoint]]:
    """Return the points of each panel, in order of appearance."""
    parts: dict[str, list[BenchmarkPoint]] = {}
    for point in points:
        parts.setdefault(point.panel, []).append(point)
    return parts


def on_pareto_front(points: Sequence[BenchmarkPoint]) -> Bool[np.ndarray, " point"]:
    """Return which points no other point of their panel beats in cost and error both.

    Of several equal in both, all are on it.
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
