"""Equations integrated over the rows of a record, and how far off it they come."""

from collections.abc import Callable

import numpy as np
from jaxtyping import Float
from scipy.integrate import solve_ivp

from jblast.study.discovery.record import input_at

CLOSE = 0.1
"""Miss, as a share of the spread of a state, up to which it is reproduced: 1 % of its
variance."""
FAR = 1e3
"""Spreads of a state at which an integration is given up."""
CALLS = 500
"""Evaluations of the equations per row, at most."""
TOLERANCE = 1e-6
"""Of the integrator, relative: far below any noise."""


def flow(
    evaluate: Callable[[Float[np.ndarray, "place column"]], np.ndarray],
    coefficients: Float[np.ndarray, "state term"],
    start: Float[np.ndarray, " state"],
    time_s: Float[np.ndarray, " row"],
    inputs: Float[np.ndarray, "row input"],
    spread: Float[np.ndarray, " state"],
    *,
    held: bool = False,
) -> Float[np.ndarray, "row state"]:
    """Integrate equations from a start (Runge and Kutta 5(4)).

    Args:
        evaluate: From the columns to the terms.
        coefficients: Of the equations.
        start: States at the first row.
        time_s: Of the rows, rising [s].
        inputs: At the rows.
        spread: Of each state: past 1e3 of them from the start it is given up.
        held: Inputs keep their value until the next row; else linear between rows.

    Returns:
        States at the rows, NaN from where it was given up.
    """
    calls = 0

    def slope(time: float, states: np.ndarray) -> np.ndarray:
        nonlocal calls
        calls += 1
        now = [input_at(time_s, u, np.asarray(time), held=held) for u in inputs.T]
        terms = evaluate(np.concatenate([states, np.asarray(now)])[None])
        return coefficients @ terms[0]

    def gone(time: float, states: np.ndarray) -> float:
        far = np.max(np.abs(states - start) / spread) > FAR
        return -1.0 if far or calls > CALLS * len(time_s) else 1.0

    gone.terminal = True  # type: ignore[attr-defined] (how solve_ivp is told)
    with np.errstate(all="ignore"):  # what overflows is given up
        answer = solve_ivp(
            slope,
            (time_s[0], time_s[-1]),
            start,
            t_eval=time_s,
            events=gone,
            rtol=TOLERANCE,
            atol=TOLERANCE * spread,
            max_step=4.0 * float(np.max(np.diff(time_s))),  # steps over no pulse
        )
    states = np.full((len(time_s), len(start)), np.nan)
    states[: answer.y.shape[1]] = answer.y.T
    return states


def misfit(
    made: Float[np.ndarray, "row state"],
    states: Float[np.ndarray, "row state"],
    noise_sd: Float[np.ndarray, " state"],
) -> Float[np.ndarray, " state"]:
    """Return how far equations come off a record, beside the spread of each state.

    It is the root mean square, the noise taken off in quadrature; infinite where the
    integration was given up. Up to `CLOSE` the equations give the record back.
    """
    over = np.mean((states - made) ** 2, axis=0) - noise_sd**2
    share = np.sqrt(np.maximum(over, 0.0)) / np.std(states, axis=0)
    return np.where(np.isnan(over), np.inf, share)
