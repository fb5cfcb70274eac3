"""Integration of equations of motion, and their trajectory nearest to a record.

Where errors of a trajectory grow, as near an unstable limit cycle or in chaos, an
integration from one noisy row leaves the record, whether or not the equations are
right. It is then restarted before errors have grown `GROWTH` times (`restarts`).
Multiple shooting joins the segments to one trajectory of the equations: it fits the
states at their starts to the record, so that each segment ends where the next begins
(Baake, Baake, Bock and Briggs 1992, Phys. Rev. A 45:5524).
"""

from collections.abc import Callable, Sequence
from itertools import pairwise

import numpy as np
from jaxtyping import Float
from scipy import sparse
from scipy.integrate import solve_ivp
from scipy.linalg import expm
from scipy.sparse.linalg import spsolve

from jblast.discovery.record import input_at, rows_of_runs

Terms = Callable[[Float[np.ndarray, "place column"]], np.ndarray]
"""Function from the columns (states, then inputs) to the terms."""
CLOSE = 0.1
"""Misfit relative to the standard deviation of a state up to which it is reproduced:
1 % of its variance."""
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
JUMP = 0.01
"""Weight of jumps between segments: their standard deviation relative to the noise."""
MAX_JUMP = 1.0
"""Largest jump relative to the noise: larger ones are visible in the record, so that
the segments are no trajectory."""
STEP = 1e-3
"""Change of a start for its derivative, in spreads: a thousand times the tolerance."""
MAX_ITERATIONS = 20
"""Steps of the fit of a trajectory: it needs 4 to 10 where it converges."""


def misfit(
    made: Float[np.ndarray, "row state"],
    states: Float[np.ndarray, "row state"],
    noise_sd: Float[np.ndarray, " state"],
) -> Float[np.ndarray, " state"]:
    """Return the misfit of integrated equations relative to the spread of each state.

    It is the root mean square difference, less the noise in quadrature, and infinite if
    the integration was stopped. Up to `CLOSE` the equations reproduce the record.
    """
    # The data have noise and the integrated equations none: their variances add.
    over = np.mean((states - made) ** 2, axis=0) - noise_sd**2
    share = np.sqrt(np.maximum(over, 0.0)) / np.std(states, axis=0)
    return np.where(np.isnan(over), np.inf, share)


def flow(
    evaluate: Terms,
    coefficients: Float[np.ndarray, "state term"],
    start: Float[np.ndarray, " state"],
    time_s: Float[np.ndarray, " row"],
    inputs: Float[np.ndarray, "row input"],
    spread: Float[np.ndarray, " state"],
    *,
    held: bool = False,
) -> Float[np.ndarray, "row state"]:
    """Return equations integrated from a start (Runge and Kutta 5(4)).

    Args:
        evaluate: Function from the columns to the terms.
        coefficients: Coefficients of the equations.
        start: States at the first row.
        time_s: Times of the rows, increasing [s].
        inputs: Inputs at the rows.
        spread: Standard deviation of each state; the integration stops at 1e3 of them
            from the start.
        held: Whether inputs are constant until the next row; else linear.

    Returns:
        States at the rows, NaN after the integration was stopped.
    """
    calls = 0

    def slope(time: float, states: np.ndarray) -> np.ndarray:
        nonlocal calls
        calls += 1
        # The inputs between rows, as in the integrals of the search.
        now = [input_at(time_s, u, np.asarray(time), held=held) for u in inputs.T]
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
            max_step=4.0
            * float(np.max(np.diff(time_s))),  # so that no pulse of an input is skipped
        )
    states = np.full((len(time_s), len(start)), np.nan)
    states[: answer.y.shape[1]] = answer.y.T
    return states


def restarts(
    evaluate: Terms,
    coefficients: Float[np.ndarray, "state term"],
    time_s: Float[np.ndarray, " row"],
    states: Float[np.ndarray, "row state"],
    inputs: Float[np.ndarray, "row input"],
    spread: Float[np.ndarray, " state"],
) -> list[int]:
    """Return the rows at which an error has grown `GROWTH` times since the last one.

    Args:
        evaluate: Function from the columns to the terms.
        coefficients: Coefficients of the equations.
        time_s: Times of the rows, increasing [s].
        states: Smoothed states, along which errors are propagated to first order.
        inputs: Inputs at the rows.
        spread: Standard deviation of each state, the unit of its error.
    """
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
    error, rows, last = np.eye(len(spread)), [], 0
    for row, step in enumerate(expm(exponent), start=1):
        error = step @ error
        if row - last >= MIN_ROWS and np.linalg.norm(error, 2) > GROWTH:
            rows.append(row)
            error, last = np.eye(len(spread)), row
    # the last segment needs rows, too
    return [row for row in rows if row <= len(time_s) - MIN_ROWS]


def nearest_trajectory(
    evaluate: Terms,
    coefficients: Float[np.ndarray, "state term"],
    time_s: Float[np.ndarray, " row"],
    states: Float[np.ndarray, "row state"],
    inputs: Float[np.ndarray, "row input"],
    noise_sd: Float[np.ndarray, " state"],
    rows: Sequence[int],
    *,
    held: bool = False,
) -> Float[np.ndarray, "row state"]:
    """Return the trajectory of the equations that is nearest to a record.

    Args:
        evaluate: Function from the columns to the terms.
        coefficients: Coefficients of the equations.
        time_s: Times of the rows, increasing [s].
        states: Recorded states.
        inputs: Inputs at the rows.
        noise_sd: Standard deviation of the noise of each state.
        rows: Rows at which a new segment starts (`restarts`).
        held: Whether inputs are constant until the next row; else linear.

    Returns:
        States at the rows, NaN if no trajectory is near the record.
    """
    spread = np.std(states, axis=0)
    # A record without noise is met up to the error of the smoothing.
    sd = np.maximum(noise_sd, 1e-3 * spread)
    segments = list(pairwise([0, *rows, len(time_s)]))
    count = states.shape[1]

    def segment(first: int, last: int, start: Float[np.ndarray, " state"]):
        # through the first row of the next segment
        some = slice(first, min(last + 1, len(time_s)))
        return flow(
            evaluate,
            coefficients,
            start,
            time_s[some],
            inputs[some],
            spread,
            held=held,
        )

    def residuals(starts: Float[np.ndarray, "segment state"]):
        runs = [
            segment(*bounds, start)
            for bounds, start in zip(segments, starts, strict=True)
        ]
        made = np.concatenate(
            [run[: b - a] for run, (a, b) in zip(runs, segments, strict=True)]
        )
        ends = np.array([run[-1] for run in runs[:-1]]).reshape(-1, count)
        jumps = (ends - starts[1:]) / sd
        over = np.concatenate([(made - states) / sd, jumps / JUMP]).ravel()
        return made, jumps, over, runs

    def derivative(starts: Float[np.ndarray, "segment state"], runs):
        blocks = []
        for nth, ((first, last), run) in enumerate(zip(segments, runs, strict=True)):
            slopes = [
                (segment(first, last, starts[nth] + STEP * step) - run) / STEP / sd
                for step in np.diag(spread)
            ]
            # rows of the segment, then of its jump, by unknown
            change = np.stack(slopes, axis=2)
            blocks.append((change[: last - first], change[-1] / JUMP))
        size = count * len(segments)
        of_rows = sparse.block_diag([a.reshape(-1, count) for a, _ in blocks])
        ends = sparse.block_diag([b for _, b in blocks[:-1]])
        # the next start is subtracted from the end of a segment
        next_start = np.tile(spread / sd / JUMP, len(segments) - 1)
        of_jumps = sparse.hstack([ends, sparse.csr_array((size - count, count))])
        of_jumps -= sparse.diags_array(
            next_start, offsets=count, shape=(size - count, size)
        )
        return sparse.csc_array(sparse.vstack([of_rows, of_jumps]))

    nothing = np.full(states.shape, np.nan)
    starts = states[[first for first, _ in segments]]
    made, jumps, over, runs = residuals(starts)
    # Levenberg and Marquardt's damping, larger until a step reduces the sum of squares
    damping, by = 1e-3, None
    for _ in range(MAX_ITERATIONS):
        if by is None:
            if not np.all(np.isfinite(over)):
                return nothing
            by = derivative(starts, runs)
            if not np.all(np.isfinite(by.data)):
                return nothing
        square = by.T @ by
        damped = square + damping * sparse.diags_array(square.diagonal())
        step = spsolve(sparse.csc_array(damped), -(by.T @ over))
        tried = starts + spread * step.reshape(starts.shape)
        answer = residuals(tried)
        gain = 1.0 - (answer[2] @ answer[2]) / (over @ over)
        # NaN, after a stopped integration, is no gain either
        if not gain > 0.0:
            damping *= 10.0
            continue
        starts, (made, jumps, over, runs), by = tried, answer, None
        damping *= 0.1
        if gain < 1e-4:
            break
    return made if np.all(np.abs(jumps) <= MAX_JUMP) else nothing


def reproducing_trajectory(
    evaluate: Terms,
    coefficients: Float[np.ndarray, "state term"],
    start: Float[np.ndarray, " state"],
    time_s: Float[np.ndarray, " row"],
    states: Float[np.ndarray, "row state"],
    inputs: Float[np.ndarray, "row input"],
    noise_sd: Float[np.ndarray, " state"],
    rows: Sequence[int],
    *,
    held: bool = False,
) -> tuple[Float[np.ndarray, "row state"], Float[np.ndarray, " state"], bool]:
    """Return the integration from the first row, or the nearest trajectory.

    Args:
        evaluate: Function from the columns to the terms.
        coefficients: Coefficients of the equations.
        start: States at the first row.
        time_s: Times of the rows, increasing [s].
        states: Recorded states.
        inputs: Inputs at the rows.
        noise_sd: Standard deviation of the noise of each state.
        rows: Rows at which errors have grown (`restarts`); without any, the integration
            from the first row is returned.
        held: Whether inputs are constant until the next row; else linear.

    Returns:
        States at the rows, their misfit, and whether it is the nearest trajectory.
    """
    spread = np.std(states, axis=0)
    made = flow(evaluate, coefficients, start, time_s, inputs, spread, held=held)
    off = misfit(made, states, noise_sd)
    if np.all(off <= CLOSE) or not rows:
        return made, off, False
    near = nearest_trajectory(
        evaluate, coefficients, time_s, states, inputs, noise_sd, rows, held=held
    )
    off_near = misfit(near, states, noise_sd)
    # a failed fit is no answer: that from the first row is reported
    if not np.all(np.isfinite(off_near)):
        return made, off, False
    return near, off_near, True


def reproducing_runs(
    evaluate: Terms,
    coefficients: Float[np.ndarray, "state term"],
    starts: Float[np.ndarray, "run state"],
    time_s: Float[np.ndarray, " row"],
    states: Float[np.ndarray, "row state"],
    inputs: Float[np.ndarray, "row input"],
    noise_sd: Float[np.ndarray, " state"],
    rows: Sequence[int],
    runs: Sequence[int],
    *,
    held: bool = False,
) -> tuple[Float[np.ndarray, "row state"], Float[np.ndarray, " state"], bool]:
    """Return `reproducing_trajectory` of each run, and the misfit of all of them.

    Args:
        evaluate: As in `reproducing_trajectory`, likewise all others.
        coefficients: Coefficients of the equations.
        starts: States at the first row of each run.
        time_s: Times of the rows, increasing [s].
        states: States at the rows.
        inputs: Inputs at the rows.
        noise_sd: Standard deviation of the noise of each state.
        rows: Rows at which errors have grown.
        runs: First row of each run.
        held: Whether inputs are constant until the next row; else linear.
    """
    made, nearest = [], False
    for part, start in zip(rows_of_runs(runs, len(time_s)), starts, strict=True):
        run, _, near = reproducing_trajectory(
            evaluate,
            coefficients,
            start,
            time_s[part],
            states[part],
            inputs[part],
            noise_sd,
            [row - part.start for row in rows if part.start < row < part.stop],
            held=held,
        )
        made.append(run)
        nearest |= near
    whole = np.concatenate(made)
    return whole, misfit(whole, states, noise_sd), nearest
