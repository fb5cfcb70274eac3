"""Equations found, integrated and held against the record they were found in."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float
from scipy.integrate import solve_ivp

from jblast.study.discovery import Discovery
from jblast.study.discovery_record import input_at

CLOSE = 0.1
"""Misfit, as a share of the spread of a state, up to which it is reproduced: 1 % of its
variance."""
FAR = 1e3
"""Spreads of a state at which an integration is given up."""
CALLS = 500
"""Evaluations of the equations per row, at most."""
TOLERANCE = 1e-6
"""Of the integrator, relative: far below any noise."""


@dataclass(frozen=True)
class Replay:
    """A trajectory by the equations alone, from the first row on.

    Attributes:
        states: At the rows; NaN from where the integration was given up.
        misfit: Root mean square of what lies between it and the data, the noise taken
            off in quadrature, as a share of the state's standard deviation.
        reproduced: Whether the misfit is at most 10 %, state by state.
    """

    states: Float[np.ndarray, "row state"]
    misfit: Float[np.ndarray, " state"]
    reproduced: tuple[bool, ...]


def integrate(
    discovery: Discovery,
    time_s: Float[np.ndarray, " row"],
    inputs: Float[np.ndarray, "row input"],
    spread: Float[np.ndarray, " state"],
    *,
    held: bool = False,
) -> Float[np.ndarray, "row state"]:
    """Integrate the equations from the smoothed start (Runge and Kutta 5(4)).

    Args:
        discovery: The equations.
        time_s: Of the rows, rising [s].
        inputs: At the rows.
        spread: Of each state: past 1e3 of them from the start it is given up.
        held: Inputs keep their value until the next row; else linear between rows.

    Returns:
        States at the rows, NaN from where it was given up.
    """
    evaluate, start = discovery.candidates.evaluate, discovery.start
    calls = 0

    def slope(time: float, states: np.ndarray) -> np.ndarray:
        nonlocal calls
        calls += 1
        now = [input_at(time_s, u, np.asarray(time), held=held) for u in inputs.T]
        terms = evaluate(np.concatenate([states, np.asarray(now)])[None])
        return discovery.coefficients @ terms[0]

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


def replay(
    discovery: Discovery,
    time_s: Float[np.ndarray, " row"],
    states: Float[np.ndarray, "row state"],
    inputs: Float[np.ndarray, "row input"] | None = None,
    *,
    held: bool = False,
    noise: bool = True,
) -> Replay:
    """Integrate the equations and hold them against the data; as `integrate`.

    Args:
        discovery: The equations.
        time_s: Of the rows, rising [s].
        states: At the rows.
        inputs: At the rows.
        held: Inputs keep their value until the next row; else linear between rows.
        noise: Whether the states have the noise found; it is taken off then.
    """
    inputs = np.empty((len(time_s), 0)) if inputs is None else inputs
    spread = np.std(states, axis=0)
    own = integrate(discovery, time_s, inputs, spread, held=held)
    over = np.mean((states - own) ** 2, axis=0) - noise * discovery.noise_sd**2
    misfit = np.sqrt(np.maximum(over, 0.0)) / spread
    misfit = np.where(np.isnan(over), np.inf, misfit)
    return Replay(own, misfit, tuple((misfit <= CLOSE).tolist()))
