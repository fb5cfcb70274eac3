"""Arrival, pressure, impulse, duration: what every law costs, and how far it is off."""

import dataclasses
import math

import equinox as eqx
import jax.numpy as jnp
import numpy as np

from jblast.constants import STANDARD_PRESSURE
from jblast.fidelity import solver
from jblast.fidelity.error_tables import reference_uncertainties
from jblast.fidelity.measured_errors import (
    BURSTS,
    JUST_PAST,
    NODES,
    holds,
    log_ratio,
    methods_for,
    standard_path,
)
from jblast.fidelity.reference import REFERENCES
from jblast.fidelity.timing import seconds
from jblast.progress import in_words
from jblast.quantities import QUANTITIES
from jblast.registry import call, law_for
from jblast.scene.charge import Burst
from jblast.verification.benchmark.chart import (
    Benchmark,
    BenchmarkPoint,
    register_benchmark,
)
from jblast.waves.paths import Path

BANDS = ((0.5, 3.0), (3.0, 40.0), (40.0, 1000.0))
"""Scaled distances of the panels [m/kg^(1/3)]."""

POINTS = 1 << 17
"""Readings a call, when a law is timed."""

FEWEST = 5
"""Nodes that a method has to share with a band to be drawn in it."""


def law_seconds(quantity: str, name: str) -> float:
    """Return what a reading by a law costs, many at once, in float64 [s]."""
    law = law_for(quantity, name)
    path = _many_paths()
    compiled = eqx.filter_jit(lambda path: call(law.function, path))
    return seconds(lambda: compiled(path)) / POINTS


def method_seconds(quantity: str, method: str) -> float:
    """Return what a reading by a method costs [s]."""
    if method == solver.METHOD:
        return solver.seconds_of_run()
    return law_seconds(quantity, method)


def _many_paths() -> Path:
    """Return paths to random places, about Z = 0.07 to 40."""
    rng = np.random.default_rng(0)
    z, mass = (
        jnp.asarray(np.exp(rng.uniform(math.log(low), math.log(high), POINTS)))
        for low, high in ((0.07, 40.0), (1e-2, 1e6))
    )
    pressure = jnp.asarray(rng.uniform(7e4, 1.05e5, POINTS))
    distance = z * jnp.cbrt(mass * STANDARD_PRESSURE / pressure)
    return dataclasses.replace(
        standard_path(np.ones(POINTS), "surface"),
        slant_range=distance,
        ground_range=distance,
        charge_mass=mass,
        ambient_pressure=pressure,
    )


def law_points(quantity: str) -> list[BenchmarkPoint]:
    """Return the cost and the largest error of every method, by burst and band.

    An error below what the reference itself may be off counts as that.

    Args:
        quantity: One of `REFERENCES`.
    """
    tell = in_words()
    costs = {}
    for method in methods_for(quantity):
        tell(method)
        costs[method] = method_seconds(quantity, method)
    points = []
    for start, end in BANDS:
        for burst in BURSTS:
            for method, cost in costs.items():
                point = _point(quantity, method, cost, burst, start, end)
                points += [point] if point else []
    return points


def _point(
    quantity: str, method: str, cost: float, burst: Burst, start: float, end: float
) -> BenchmarkPoint | None:
    """Return one method in one panel; None where it does not hold."""
    first = start * JUST_PAST
    z = np.unique([first, *NODES[(first < NODES) & (end > NODES)], end])
    path = standard_path(z, burst)
    ratio = log_ratio(quantity, method, path)
    known = np.isfinite(ratio) & holds(quantity, method, path)
    if known.sum() < FEWEST:
        return None
    spans = reference_uncertainties(quantity, burst)
    uncertainty = max(s.error for s in spans if s.start < end and s.end > start)
    is_reference = any(
        p.law == method and p.start <= start and end <= p.end
        for p in REFERENCES[quantity]
    )
    low, high = z[known][[0, -1]]
    where = "surface" if burst == "surface" else "free air"
    return BenchmarkPoint(
        method=method,
        cost_s=cost,
        error=max(
            uncertainty,
            0.0 if is_reference else float(np.abs(np.expm1(ratio[known])).max()),
        ),
        range=f"{where}, Z = {low:.3g} to {high:.3g} m/kg^(1/3)",
        panel=f"{where}, Z = {start:g} to {end:g}",
        whole=bool(known.all()),
        is_reference=is_reference,
    )


for _name, _quantity in (
    ("arrival", "air_arrival_s"),
    ("pressure", "peak_overpressure_pa"),
    ("impulse", "positive_impulse_pa_s"),
    ("duration", "positive_duration_s"),
):
    register_benchmark(
        Benchmark(
            name=_name,
            title=f"{QUANTITIES[_quantity].words.capitalize()}: cost against error",
            cost="time of a reading, many at once; of the solver, of a run",
            error="the largest over the span, or how far the reference may be off",
            measure=lambda quantity=_quantity: law_points(quantity),
        )
    )
