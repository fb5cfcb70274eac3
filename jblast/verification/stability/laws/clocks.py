"""Where a clock's seconds no longer fit the numbers that hold them."""

import math
from typing import Any

import numpy as np

from jblast.errors import InputError
from jblast.observations import Observations, observed
from jblast.observations.clocks import refuse_unresolved
from jblast.verification.stability.failure import FailureMode, verified

SIGMA = 1e-3
"""Of a recorder's arrivals [s]."""
FINE = 1e-6
"""Of the best recorder's [s]."""
TIMES = {"60 s": 60.0, "1 h": 3600.0, "Unix time": 1.7e9}


def clock_failures() -> list[FailureMode]:
    """Measure them for single and for double precision."""
    return [
        _failure(np.float32, SIGMA, "float32"),
        _failure(np.float64, FINE, "float64"),
    ]


def coarse_from(dtype: type[np.floating[Any]], sigma: float) -> float:
    """Return the time from which neighbouring numbers are further apart than sigma.

    Args:
        dtype: Of the numbers.
        sigma: [s].

    Returns:
        A power of two [s].
    """
    exponent = 0
    while float(np.spacing(dtype(2.0**exponent))) <= sigma:
        exponent += 1
    return 2.0**exponent


def _failure(dtype: type[np.floating[Any]], sigma: float, name: str) -> FailureMode:
    boundary = coarse_from(dtype, sigma)
    spacings = ", ".join(
        f"{float(np.spacing(dtype(time))):.3g} s at {words}"
        for words, time in TIMES.items()
    )
    # on a clock that runs since 1970
    start, way = TIMES["Unix time"], 0.1234567
    arrival = float(dtype(start + way)) - start
    before = _is_refused(math.nextafter(boundary, 0.0) / 1.01, sigma, dtype)
    after = _is_refused(boundary, sigma, dtype)
    return FailureMode(
        area="clocks",
        method=f"clock times in {name}",
        failure=f"steps of the clock exceed sigma = {sigma:g} s",
        boundary=boundary,
        unit="s on the clock",
        beyond=f"steps of {spacings}; a way of {way:.4f} s at Unix time is read as "
        f"{arrival:.4f} s",
        response=verified("refuses", after and not before, f"clock times in {name}"),
        message="fit and batch_of refuse such a row; every command runs in float64",
    )


def _is_refused(time: float, sigma: float, dtype: type[np.floating[Any]]) -> bool:
    log = arrival_at(time, sigma)
    try:
        refuse_unresolved(log, dtype)
    except InputError:
        return True
    return False


def arrival_at(time: float, sigma: float) -> Observations:
    """Return a log of one arrival [s]."""
    place = np.array([[30.0, 0.0, 0.0]])
    fields = {"position": place, "source": "one arrival"}
    return observed(["a"], ["air_arrival_s"], [time], [sigma], **fields)
