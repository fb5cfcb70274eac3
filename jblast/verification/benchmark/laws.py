r"""Laws, the shock solver and pressure histories: cost against error.

Laws are compared with the reference of their quantity (`fidelity.errors`).

The shock solver is compared with the exact point source, whose table is from runs with
up to 800 cells and agrees with an independent one by the method of characteristics to
1e-6.

Pressure histories are compared with a gauge in a run of the solver with `REFERENCE`
cells: a point source in air of gamma 1.4 with $P_0 = \rho_0 = E = 1$, so that the
distance is $\lambda = R\,(P_0/E)^{1/3}$ and the overpressure is over $P_0$. The closed
forms have the peak, durations, impulses and underpressure of that history, and time
counts from the arrival of each run. Therefore only the shape is compared.
"""

import dataclasses
import math
from collections.abc import Callable, Sequence
from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float
from scipy.interpolate import PchipInterpolator

from jblast.constants import STANDARD_PRESSURE
from jblast.errors import InputError
from jblast.fidelity import errors
from jblast.fidelity.errors import (
    BURSTS,
    JUST_PAST,
    NODES,
    REFERENCES,
    holds,
    log_ratio,
    methods_for,
    reference_uncertainties,
    standard_path,
)
from jblast.fidelity.timing import best_of, seconds
from jblast.progress import in_words
from jblast.quantities import QUANTITIES
from jblast.registry import call, law_for
from jblast.scene.charge import Burst
from jblast.verification.benchmark.chart import (
    Benchmark,
    BenchmarkPoint,
    register_benchmark,
)
from jblast.waves.curves import log_sound_fraction
from jblast.waves.euler import March, decay_at, point_source_march
from jblast.waves.euler.run import ORDERS
from jblast.waves.laws.point_source import log_overpressure_ratio, point_source_arrival
from jblast.waves.waveform import (
    friedlander_decay,
    friedlander_pressure,
    modified_friedlander_pressure,
    negative_phase_pressure,
)

# From a strong to a nearly acoustic shock: 1.9, 0.17 and 0.02 ambient pressures.
GAUGES = (0.5, 2.0, 10.0)
"""Scaled distances lambda of the gauges [-]."""
# A run that ends earlier cuts the negative phase at the last gauge; `waveforms` raises.
END = 12.5
"""Lambda of the shock at the end of a run [-]."""
# Meshes that double, so that the order of convergence can be read from them.
CELLS = (50, 100, 200)
# Twice the finest measured mesh.
REFERENCE = 400
# Fine enough that the rms no longer depends on it, small enough for a batch in cache.
SAMPLES = 256
"""Samples of a waveform."""
# A million samples: the time of the call itself does not count.
BATCH = 4096
"""Waveforms in a timed call of a closed form."""
STRIDE = 4
"""Steps between records: with 50 cells some 20 records in a positive phase."""
GAMMA = 1.4
"""Ratio of specific heats of air [-]."""
SOLVER_CELLS = (50, 100, 200, 400)
"""Meshes of the solver chart."""
# One decade each: errors of the strong, middle and weak shock differ.
SPANS = ((0.1, 1.0), (1.0, 10.0), (10.0, 100.0))
"""Scaled distances lambda of the panels; the run begins at 0.02."""
# 40 is the end of the Kingery-Bulmash table.
BANDS = ((0.5, 3.0), (3.0, 40.0), (40.0, 1000.0))
"""Scaled distances of the panels [m/kg^(1/3)]."""
# So many that the time of the call itself does not count.
POINTS = 1 << 17
"""Readings in a timed call of a law."""
# With fewer, the largest error of a band depends on the choice of the nodes.
MIN_NODES = 5
"""Smallest number of valid nodes of a method in a band."""


class PulseParameters(NamedTuple):
    """Parameters of a closed form of a waveform, in any consistent units.

    Attributes:
        peak: Overpressure at the front.
        duration: Duration of the positive phase.
        impulse: Impulse of the positive phase.
        suction: Largest underpressure, positive.
        suction_impulse: Impulse of the negative phase, positive.
    """

    peak: Float[Array, "..."]
    duration: Float[Array, "..."]
    impulse: Float[Array, "..."]
    suction: Float[Array, "..."]
    suction_impulse: Float[Array, "..."]


Form = Callable[[Float[Array, "..."], PulseParameters], Float[Array, "..."]]
"""Overpressure as a function of the time since arrival, which is not negative."""


def form_seconds(form: Form) -> float:
    """Return the time of a waveform of `SAMPLES` samples in a float64 batch [s]."""
    rng = np.random.default_rng(0)
    peak, duration, fraction, suction, length = (
        jnp.asarray(rng.uniform(*bounds, (BATCH, 1)))
        for bounds in ((1e3, 1e5), (1e-3, 1e-1), (0.2, 0.5), (0.05, 0.4), (1.0, 5.0))
    )
    pulse = PulseParameters(
        peak,
        duration,
        impulse=fraction * peak * duration,
        suction=suction * peak,
        suction_impulse=suction * peak * length * duration,
    )
    time = jnp.linspace(0.0, 4.0, SAMPLES)[None, :] * duration
    compiled = jax.jit(form)
    return seconds(lambda: compiled(time, pulse)) / BATCH


class Waveform(NamedTuple):
    r"""Pressure history at a gauge; times in $\sqrt{\rho_0/P_0}\,(E/P_0)^{1/3}$.

    Attributes:
        pressure: Overpressure against the time since arrival.
        pulse: Parameters of the history.
        end: End of the negative phase, since arrival.
    """

    pressure: PchipInterpolator
    pulse: PulseParameters
    end: float


def form_error(form: Form, true: Waveform, end: float) -> float:
    """Return the rms error of a closed form until a time since arrival."""
    time = np.linspace(0.0, end, SAMPLES)
    return _rms(np.asarray(form(jnp.asarray(time), true.pulse)), true, end)


def _rms(pressure: Float[np.ndarray, " sample"], true: Waveform, end: float) -> float:
    error = pressure - true.pressure(np.linspace(0.0, end, SAMPLES))
    return float(np.sqrt(np.mean(np.square(error)))) / float(true.pulse.peak)


def _difference(one: Waveform, true: Waveform, end: float) -> float:
    return _rms(one.pressure(np.linspace(0.0, end, SAMPLES)), true, end)


def reference_uncertainty(
    coarse: Waveform, middle: Waveform, fine: Waveform, end: float
) -> float:
    """Return the error of the finest of three runs by Richardson extrapolation."""
    last = _difference(middle, fine, end)
    # the observed order is bounded: near a zero of the error its estimate is arbitrary
    ratio = _difference(coarse, middle, end) / last
    return last / (np.clip(ratio, *(2.0**order for order in ORDERS)) - 1.0)


def waveform_points(
    gauges: Sequence[float] = GAUGES,
    end: float = END,
    cells: Sequence[int] = (*CELLS, REFERENCE),
) -> list[BenchmarkPoint]:
    """Return cost and error of every method, for both phases at each gauge.

    Errors below the uncertainty of the reference are set to that uncertainty.

    Args:
        gauges: Lambda of the gauges [-].
        end: Lambda of the shock at the end of a run [-].
        cells: Cells of three or more runs, each twice the one before; the last run is
            the reference.
    """
    progress = in_words()
    costs, runs = {}, {}
    for number in cells:
        progress(f"{number} cells")
        costs[number], run = best_of(lambda n=number: gauge_march(n, gauges, end), 1)
        runs[number] = waveforms(run, gauges)
    forms = {}
    for name, form in {**POSITIVE, **WHOLE}.items():
        # Some forms are in both tables, and timed once.
        if form not in forms:
            progress(name)
            forms[form] = form_seconds(form)
    points = []
    for column, gauge in enumerate(gauges):
        waves = [runs[number][column] for number in cells]
        true = waves[-1]
        for what, allowed, until in (
            ("positive phase", POSITIVE, float(true.pulse.duration)),
            ("both phases", WHOLE, true.end),
        ):
            panel = f"{what}, lambda = {gauge:g}"
            span = f"{panel}, peak {float(true.pulse.peak):.2g} ambient pressures"
            uncertainty = reference_uncertainty(waves[-3], waves[-2], true, until)
            points += [
                BenchmarkPoint(
                    name,
                    forms[form],
                    max(uncertainty, form_error(form, true, until)),
                    span,
                    panel,
                )
                for name, form in allowed.items()
            ]
            points += [
                BenchmarkPoint(
                    f"{number} cells",
                    costs[number],
                    max(uncertainty, _difference(wave, true, until)),
                    span,
                    panel,
                    is_reference=wave is true,
                )
                for number, wave in zip(cells, waves, strict=True)
            ]
    return points


register_benchmark(
    Benchmark(
        name="waveform",
        title="Pressure history: cost against error",
        cost=f"time of a waveform of {SAMPLES} samples, many at once; of the solver, "
        "of a run with all gauges",
        error="rms over the phases, in peaks, or the uncertainty of the reference",
        measure=waveform_points,
    )
)


def gauge_march(cells: int, gauges: Sequence[float], end: float) -> March:
    r"""Run a point source with gauges.

    Args:
        cells: Number of cells.
        gauges: $\lambda$ of the gauges [-].
        end: $\lambda$ of the shock at the end [-].
    """
    return point_source_march(cells, end, stride=STRIDE, gauges=tuple(gauges))


def waveforms(run: March, gauges: Sequence[float]) -> list[Waveform]:
    """Return the pressure history at each gauge of a run.

    Arrival and peak are those of the fitted shock when it is at the gauge.

    Raises:
        InputError: The run ends before a negative phase does.
    """
    fronts = decay_at(np.asarray(gauges), run, GAMMA)
    # decay_at counts time in ambient sound speeds, the history in sqrt(P_0/rho_0)
    arrivals = fronts.arrival / np.sqrt(GAMMA)
    found = []
    for column, (gauge, arrival) in enumerate(zip(gauges, arrivals, strict=True)):
        past = run.history.time > arrival
        since = np.concatenate([[0.0], run.history.time[past] - arrival])
        record = np.asarray(run.history.pressure)[past, column] - 1.0
        peak = fronts.overpressure_ratio[column]
        pressure = PchipInterpolator(since, np.concatenate([[peak], record]))
        crossings = pressure.roots(extrapolate=False)
        if len(crossings) < 2:
            raise InputError(
                f"end: expected a run past the end of the negative phase at lambda = "
                f"{gauge:g}, got one to {run.history.clock[-1]:.3g}"
            )
        # The first zero ends the positive phase, the second the negative one.
        duration, end = crossings[:2]
        turns = pressure.derivative().roots(extrapolate=False)
        within = turns[(turns > duration) & (turns < end)]
        parameters = (
            peak,
            duration,
            pressure.integrate(0.0, duration),
            -pressure(within).min(),
            -pressure.integrate(duration, end),
        )
        found.append(
            Waveform(
                pressure=pressure,
                pulse=PulseParameters(*(jnp.asarray(value) for value in parameters)),
                end=float(end),
            )
        )
    return found


def triangle(time: Float[Array, "..."], pulse: PulseParameters) -> Float[Array, "..."]:
    """Return a linear fall to zero, and zero after the positive phase."""
    return pulse.peak * jnp.maximum(1.0 - time / pulse.duration, 0.0)


def decay_one(time: Float[Array, "..."], pulse: PulseParameters) -> Float[Array, "..."]:
    """Return the Friedlander pulse with decay 1 and its own tail."""
    return friedlander_pressure(time, pulse.peak, pulse.duration)


def decay_of_impulse(
    time: Float[Array, "..."], pulse: PulseParameters
) -> Float[Array, "..."]:
    """Return the Friedlander pulse with the given impulse and its own tail."""
    decay = friedlander_decay(pulse.peak, pulse.impulse, pulse.duration)
    return modified_friedlander_pressure(time, pulse.peak, pulse.duration, decay)


def cut(time: Float[Array, "..."], pulse: PulseParameters) -> Float[Array, "..."]:
    """Return the Friedlander pulse with the given impulse, and zero after it."""
    return jnp.where(time < pulse.duration, decay_of_impulse(time, pulse), 0.0)


def with_suction(
    time: Float[Array, "..."], pulse: PulseParameters
) -> Float[Array, "..."]:
    """Return the Friedlander pulse with the given impulse, and a cubic negative phase.

    The duration of the negative phase follows from its underpressure and impulse.
    """
    # the cubic 6.75 s (1 - s)^2 has an area of 9/16
    length = 16.0 / 9.0 * pulse.suction_impulse / pulse.suction
    after = negative_phase_pressure(time, pulse.duration, pulse.suction, length)
    return jnp.where(time < pulse.duration, decay_of_impulse(time, pulse), after)


POSITIVE: dict[str, Form] = {
    "triangle": triangle,
    "Friedlander, b = 1": decay_one,
    "Friedlander, b of impulse": decay_of_impulse,
}
"""Closed forms of the positive phase."""
WHOLE: dict[str, Form] = {
    "b = 1, own tail": decay_one,
    "b of impulse, own tail": decay_of_impulse,
    "b of impulse, then nothing": cut,
    "b of impulse, then cubic": with_suction,
}
"""Closed forms of both phases."""


def solver_points() -> list[BenchmarkPoint]:
    """Return the cost of each run, and its largest errors of pressure and arrival."""
    progress = in_words()
    log_lambda = jnp.log(errors.SOLVER_NODES)
    exact = {
        "pressure": log_overpressure_ratio(log_lambda),
        "arrival": log_sound_fraction(log_lambda, point_source_arrival()),
    }
    exact = {what: np.asarray(value) for what, value in exact.items()}
    costs, runs = {}, {}
    for cells in SOLVER_CELLS:
        progress(f"{cells} cells")
        costs[cells] = errors.seconds_of_run(cells)
        run = errors.solver_decay(cells)
        runs[cells] = {
            "pressure": np.log(run.overpressure_ratio),
            "arrival": np.log(run.arrival / run.scaled),
        }
    points = []
    for start, end in SPANS:
        inside = (start <= errors.SOLVER_NODES) & (end >= errors.SOLVER_NODES)
        for what, value in exact.items():
            span = f"{what}, lambda = {start:g} to {end:g}"
            for cells, logs in runs.items():
                error = np.abs(np.expm1(logs[what] - value))[inside]
                worst = float(error.max())
                points.append(
                    BenchmarkPoint(f"{cells} cells", costs[cells], worst, span, span)
                )
    return points


register_benchmark(
    Benchmark(
        name="solver",
        title="Shock solver: cost of a run against error",
        cost="a run of the point source from lambda = 0.02 to 100",
        error="the largest over the span, relative to the exact point source",
        measure=solver_points,
    )
)


def method_seconds(quantity: str, method: str) -> float:
    """Return the time of a reading by a method [s]; for the solver, of a run."""
    if method == errors.SOLVER:
        return errors.seconds_of_run()
    law = law_for(quantity, method)
    rng = np.random.default_rng(0)
    # In random order: sorted ranges would read neighbouring rows of a table, faster
    # than readings do.
    z, mass = (
        jnp.asarray(np.exp(rng.uniform(math.log(low), math.log(high), POINTS)))
        for low, high in ((0.07, 40.0), (1e-2, 1e6))
    )
    pressure = jnp.asarray(rng.uniform(7e4, 1.05e5, POINTS))
    distance = z * jnp.cbrt(mass * STANDARD_PRESSURE / pressure)
    path = dataclasses.replace(
        standard_path(np.ones(POINTS), "surface"),
        slant_range=distance,
        ground_range=distance,
        charge_mass=mass,
        ambient_pressure=pressure,
    )
    compiled = eqx.filter_jit(lambda path: call(law.function, path))
    return seconds(lambda: compiled(path)) / POINTS


def law_points(quantity: str) -> list[BenchmarkPoint]:
    """Return the cost and the largest error of every method, by burst and band.

    Errors below the uncertainty of the reference are set to that uncertainty.

    Args:
        quantity: A key of `REFERENCES`.
    """
    progress = in_words()
    costs = {}
    for method in methods_for(quantity):
        progress(method)
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
    """Return one method in one panel; None if too few nodes are valid."""
    first = start * JUST_PAST
    z = np.unique([first, *NODES[(first < NODES) & (end > NODES)], end])
    path = standard_path(z, burst)
    ratio = log_ratio(quantity, method, path)
    known = np.isfinite(ratio) & holds(quantity, method, path)
    if known.sum() < MIN_NODES:
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
            error="the largest over the span, or the uncertainty of the reference",
            measure=lambda quantity=_quantity: law_points(quantity),
        )
    )
