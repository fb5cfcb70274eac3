"""Waveform: ways to the pressure history at a place, their cost against their error.

Held against a gauge in a run of the shock solver with `REFERENCE` cells. The closed
forms are given the peak, durations, impulses and underpressure of that very history,
and time counts from the arrival, of the solver's runs from their own: what is judged is
the shape.
"""

from collections.abc import Sequence

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from jblast.fidelity.timing import best_of, seconds
from jblast.progress import in_words
from jblast.verification.benchmark.chart import (
    Benchmark,
    BenchmarkPoint,
    register_benchmark,
)
from jblast.verification.benchmark.closed_waveforms import (
    POSITIVE,
    WHOLE,
    Form,
    PulseParameters,
)
from jblast.verification.benchmark.gauge_waveforms import (
    Waveform,
    gauge_march,
    waveforms,
)
from jblast.waves.euler.point_source_run import ORDERS

PLACES = (0.5, 2.0, 10.0)
"""Scaled distances lambda of the gauges: 1.9, 0.17 and 0.02 ambient pressures."""
END = 12.5
"""Lambda of the shock when the negative phase at the last of them is over."""
CELLS = (50, 100, 200)
REFERENCE = 400
SAMPLES = 256
MANY = 4096
"""Waveforms a call, when a closed form is timed."""


def form_seconds(form: Form) -> float:
    """Return what a waveform of `SAMPLES` samples costs, many at once, in float64."""
    rng = np.random.default_rng(0)
    peak, duration, fraction, suction, length = (
        jnp.asarray(rng.uniform(*ends, (MANY, 1)))
        for ends in ((1e3, 1e5), (1e-3, 1e-1), (0.2, 0.5), (0.05, 0.4), (1.0, 5.0))
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
    return seconds(lambda: compiled(time, pulse)) / MANY


def form_error(form: Form, true: Waveform, end: float) -> float:
    """Return the rms error of a closed form until a time since arrival."""
    time = np.linspace(0.0, end, SAMPLES)
    return _rms(np.asarray(form(jnp.asarray(time), true.pulse)), true, end)


def _rms(pressure: Float[np.ndarray, " sample"], true: Waveform, end: float) -> float:
    off = pressure - true.pressure(np.linspace(0.0, end, SAMPLES))
    return float(np.sqrt(np.mean(np.square(off)))) / float(true.pulse.peak)


def _apart(one: Waveform, true: Waveform, end: float) -> float:
    return _rms(one.pressure(np.linspace(0.0, end, SAMPLES)), true, end)


def reference_uncertainty(
    coarse: Waveform, middle: Waveform, fine: Waveform, end: float
) -> float:
    """Return how far the finest of three runs may be off, by their observed order."""
    last = _apart(middle, fine, end)
    ratio = _apart(coarse, middle, end) / last
    return last / (np.clip(ratio, *(2.0**order for order in ORDERS)) - 1.0)


def waveform_points(
    places: Sequence[float] = PLACES,
    end: float = END,
    cells: Sequence[int] = (*CELLS, REFERENCE),
) -> list[BenchmarkPoint]:
    """Return cost and error of every way, for both phases at each place.

    An error below what the reference itself may be off counts as that.

    Args:
        places: Lambda of the gauges [-].
        end: Lambda of the shock at the end of a run [-].
        cells: Of the runs, three and more, each twice the one before; the last is the
            reference.
    """
    tell = in_words()
    costs, runs = {}, {}
    for number in cells:
        tell(f"{number} cells")
        costs[number], run = best_of(lambda n=number: gauge_march(n, places, end), 1)
        runs[number] = waveforms(run, places)
    forms = {}
    for name, form in {**POSITIVE, **WHOLE}.items():
        if form not in forms:
            tell(name)
            forms[form] = form_seconds(form)
    points = []
    for column, place in enumerate(places):
        waves = [runs[number][column] for number in cells]
        true = waves[-1]
        for what, allowed, until in (
            ("positive phase", POSITIVE, float(true.pulse.duration)),
            ("both phases", WHOLE, true.end),
        ):
            panel = f"{what}, lambda = {place:g}"
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
                    max(uncertainty, _apart(wave, true, until)),
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
        "of a run with gauges at all places",
        error="rms over the phases, in peaks, or how far the reference may be off",
        measure=waveform_points,
    )
)
