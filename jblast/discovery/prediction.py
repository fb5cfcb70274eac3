"""Predictions of equations of motion, from rows of a record.

Where errors of a trajectory grow, as near an unstable limit cycle or in chaos, an
integration from one noisy row leaves the record, whether or not the equations are
right. It therefore restarts from the smoothed states before errors have grown `GROWTH`
times (`restarts`).
"""

from collections.abc import Callable, Sequence
from itertools import pairwise

import numpy as np
from jaxtyping import Float
from scipy.integrate import solve_ivp
from scipy.linalg import expm

from jblast.discovery.record import Record, input_at

Terms = Callable[[Float[np.ndarray, "place column"]], np.ndarray]
"""Function from the columns (states, then inputs) to the terms."""
DIVERGED_SPREADS = 1e3
"""Standard deviations of a state at which an integration is stopped as diverged."""
MAX_CALLS = 500
"""Evaluations of the equations per row at which an integration is stopped: a stiff
wrong equation would not end."""
TOLERANCE = 1e-6
"""Relative tolerance of the integrator, far below any noise."""
GROWTH = 10.0
"""Growth of an error at which an integration restarts: an error of 2 % of the spread,
as of noise, then is 20 %, and still proportional to that of the start."""
MIN_ROWS = 4
"""Rows between two restarts at least: else the start alone predicts them."""
STEP = 1e-3
"""Change of a state for a derivative, in spreads: a thousand times the tolerance."""


def predicted(
    record: Record,
    evaluate: Terms,
    coefficients: Float[np.ndarray, "state term"],
    bounds: Sequence[int],
) -> tuple[Float[np.ndarray, "row state"], list[int]]:
    """Return equations integrated over rows of a record, and the rows they start at.

    Args:
        record: Record.
        evaluate: Function from the columns to the terms.
        coefficients: Coefficients of the equations.
        bounds: Rows at which an integration starts, and the row after the last one;
            others start where errors have grown.

    Returns:
        States, NaN after an integration was stopped, and the first row of each.
    """
    starts = [
        row
        for first, last in pairwise(bounds)
        for row in (
            first,
            *restarts(record, evaluate, coefficients, slice(first, last)),
        )
    ]
    made = [
        flow(record, evaluate, coefficients, slice(first, last))
        for first, last in pairwise([*starts, bounds[-1]])
    ]
    return np.concatenate(made), starts


def flow(
    record: Record,
    evaluate: Terms,
    coefficients: Float[np.ndarray, "state term"],
    rows: slice,
) -> Float[np.ndarray, "row state"]:
    """Return equations integrated from the first of some rows (Runge and Kutta 5(4)).

    Args:
        record: Record; its inputs drive the equations.
        evaluate: Function from the columns to the terms.
        coefficients: Coefficients of the equations.
        rows: Rows; the integration stops at 1e3 spreads from the first one's states.

    Returns:
        States at the rows, NaN after the integration was stopped.
    """
    time_s, inputs, spread = record.time_s[rows], record.inputs[rows], record.spread
    start = record.smooth[rows.start]
    calls = 0

    def slope(time: float, states: np.ndarray) -> np.ndarray:
        nonlocal calls
        calls += 1
        # The inputs between rows, as in the integrals of the search.
        at = np.asarray(time)
        now = [input_at(time_s, u, at, held=record.held) for u in inputs.T]
        terms = evaluate(np.concatenate([states, np.asarray(now)])[None])
        return coefficients @ terms[0]

    def diverged(time: float, states: np.ndarray) -> float:
        far = np.max(np.abs(states - start) / spread) > DIVERGED_SPREADS
        return -1.0 if far or calls > MAX_CALLS * len(time_s) else 1.0

    diverged.terminal = True  # type: ignore[attr-defined] (the interface of solve_ivp)
    with np.errstate(all="ignore"):  # an overflow stops the integration
        answer = solve_ivp(
            slope,
            (time_s[0], time_s[-1]),
            start,
            t_eval=time_s,
            events=diverged,
            rtol=TOLERANCE,
            # States have any unit, so that the tolerance is relative to their spread.
            atol=TOLERANCE * spread,
            # so that no pulse of an input is skipped; a single row has no steps
            max_step=4.0 * float(np.max(np.diff(time_s), initial=np.finfo(float).tiny)),
        )
    states = np.full((len(time_s), len(start)), np.nan)
    states[: answer.y.shape[1]] = answer.y.T
    return states


def restarts(
    record: Record,
    evaluate: Terms,
    coefficients: Float[np.ndarray, "state term"],
    rows: slice,
) -> list[int]:
    """Return the rows at which an error has grown `GROWTH` times since the last one.

    Errors are propagated to first order along the smoothed states, in spreads.

    Args:
        record: Record.
        evaluate: Function from the columns to the terms.
        coefficients: Coefficients of the equations.
        rows: Rows, of which the first one starts.
    """
    time_s, spread = record.time_s[rows], record.spread
    states, inputs = record.smooth[rows], record.inputs[rows]
    slopes = []
    with np.errstate(all="ignore"):  # checked below
        for state, unit in enumerate(spread):
            step = STEP * unit * np.eye(len(spread))[state]
            ahead, back = (
                evaluate(np.column_stack([states + by, inputs])) @ coefficients.T
                for by in (step, -step)
            )
            slopes.append((ahead - back) / (2.0 * STEP * spread))
        jacobian = np.stack(slopes, axis=2)
        middle = 0.5 * (jacobian[1:] + jacobian[:-1])
        exponent = middle * np.diff(time_s)[:, None, None]
    # beyond e^50 from one row to the next nothing can be integrated
    if not np.all(np.abs(exponent) < 50.0):
        return []
    error, found, last = np.eye(len(spread)), [], 0
    for row, step in enumerate(expm(exponent), start=1):
        error = step @ error
        if row - last >= MIN_ROWS and np.linalg.norm(error, 2) > GROWTH:
            found.append(row)
            error, last = np.eye(len(spread)), row
    # the last segment needs rows, too
    return [rows.start + row for row in found if row <= len(time_s) - MIN_ROWS]
