r"""Overpressure histories at a place, recorded by gauges in a run of the shock solver.

A point source in air of gamma 1.4 with $P_0 = \rho_0 = E = 1$: the distance is
$\lambda = R\,(P_0/E)^{1/3}$, the overpressure is over $P_0$.
"""

from collections.abc import Sequence
from typing import NamedTuple

import jax.numpy as jnp
import numpy as np
from scipy.interpolate import PchipInterpolator

from jblast.errors import InputError
from jblast.verification.benchmark.closed_waveforms import PulseParameters
from jblast.waves.euler import March, decay_at, point_source_march

STRIDE = 4
"""Steps between records: with 50 cells some 20 of them in a positive phase."""
GAMMA = 1.4


class Waveform(NamedTuple):
    r"""What passes a gauge; times in $\sqrt{\rho_0/P_0}\,(E/P_0)^{1/3}$.

    Attributes:
        pressure: Overpressure against the time since arrival.
        pulse: Its peak, durations and so on.
        end: Of the negative phase, since arrival.
    """

    pressure: PchipInterpolator
    pulse: PulseParameters
    end: float


def gauge_march(cells: int, places: Sequence[float], end: float) -> March:
    r"""Run a point source with gauges.

    Args:
        cells: How many.
        places: $\lambda$ of the gauges [-].
        end: $\lambda$ of the shock at the end [-].
    """
    return point_source_march(cells, end, stride=STRIDE, gauges=tuple(places))


def waveforms(run: March, places: Sequence[float]) -> list[Waveform]:
    """Return what passed each gauge of a run.

    Arrival and peak are those of the fitted shock when it is at the gauge.

    Raises:
        InputError: The run ends before a negative phase does.
    """
    fronts = decay_at(np.asarray(places), run, GAMMA)
    arrivals = fronts.arrival / np.sqrt(GAMMA)
    found = []
    for column, (place, arrival) in enumerate(zip(places, arrivals, strict=True)):
        past = run.history.time > arrival
        since = np.concatenate([[0.0], run.history.time[past] - arrival])
        record = np.asarray(run.history.pressure)[past, column] - 1.0
        peak = fronts.overpressure_ratio[column]
        pressure = PchipInterpolator(since, np.concatenate([[peak], record]))
        crossings = pressure.roots(extrapolate=False)
        if len(crossings) < 2:
            raise InputError(
                f"end: expected a run past the end of the negative phase at lambda = "
                f"{place:g}, got one to {run.history.clock[-1]:.3g}"
            )
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
