"""The equation of motion in a recorded trajectory: which terms, how sure, does it hold.

For each state x the terms of dx/dt are looked for among candidates, in integrals over
short windows (`discovery_weak.py`), by PySINDy's thresholded least squares
(`discovery_sparse.py`). How sure: the smoothed record gets new noise, normal and as
large as the old, on the left side, and terms and coefficients are found again, time
after time (parametric bootstrap: Efron and Tibshirani 1993, chapter 6). The spread
holds what independent noise does to the left side; not what it leaves on the terms, nor
what the candidates lack. Measured (`calibration/discovery.py`), the interval from 5 to
95 % holds the true coefficient in 60 to 80 of 100 noisy records rather than 90.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float

from jblast.errors import InputError
from jblast.study.discovery_record import Record, trajectory_record
from jblast.study.discovery_sparse import (
    Regression,
    Selection,
    least_squares,
    repeated_terms,
    sparse_terms,
)
from jblast.study.discovery_terms import Candidates, polynomial

THRESHOLD = 0.05
"""Least share of a derivative's root mean square for a term to stay."""
MEMBERS = 100
"""Of the ensemble."""
LIKELY = 0.5
"""Share of the ensemble that has to hold a term."""


@dataclass(frozen=True)
class Discovery:
    """Equations found, one a state.

    Attributes:
        states: Names of the states.
        candidates: Terms they were looked for among.
        coefficients: Of each equation, zero for a term it lacks.
        low: Coefficients plus the 5 % quantile of the ensemble's spread about what the
            smoothed record gives, the terms kept.
        high: The same with the 95 % quantile.
        inclusion: Share of the ensemble that holds each term.
        noise_sd: Standard deviation of the noise of each state, in its unit.
        repeated: Terms left out, since sums of others equal them on this record.
        start: Smoothed states at the first row.
    """

    states: tuple[str, ...]
    candidates: Candidates
    coefficients: Float[np.ndarray, "state term"]
    low: Float[np.ndarray, "state term"]
    high: Float[np.ndarray, "state term"]
    inclusion: Float[np.ndarray, "state term"]
    noise_sd: Float[np.ndarray, " state"]
    repeated: tuple[str, ...]
    start: Float[np.ndarray, " state"]

    def terms(self, state: int) -> tuple[str, ...]:
        """Return the names of the terms of an equation."""
        names = self.candidates.names
        return tuple(names[j] for j in np.flatnonzero(self.coefficients[state]))


def discover(
    time_s: Float[np.ndarray, " row"],
    states: Float[np.ndarray, "row state"],
    inputs: Float[np.ndarray, "row input"] | None = None,
    *,
    names: Sequence[str],
    candidates: Candidates | None = None,
    held: bool = False,
    threshold: float = THRESHOLD,
    members: int = MEMBERS,
    seed: int = 0,
) -> Discovery:
    """Find dx/dt of each state of a trajectory.

    Args:
        time_s: Of the rows, rising [s].
        states: What the equations are for, in any units.
        inputs: What drives them, taken as exact.
        names: Of the states, then of the inputs.
        candidates: Terms looked among; default: products of up to two columns.
        held: Inputs keep their value until the next row; else linear between rows.
        threshold: Least share of a derivative's root mean square for a term to stay.
        members: Of the ensemble.
        seed: Of the ensemble.
    """
    inputs = np.empty((len(time_s), 0)) if inputs is None else inputs
    record = trajectory_record(time_s, states, inputs, held=held)
    return discover_in(
        record,
        candidates or polynomial(names),
        names[: states.shape[1]],
        threshold=threshold,
        members=members,
        seed=seed,
    )


def discover_in(
    record: Record,
    candidates: Candidates,
    states: Sequence[str],
    *,
    select: Selection = sparse_terms,
    threshold: float = THRESHOLD,
    members: int = MEMBERS,
    seed: int = 0,
) -> Discovery:
    """Find the equations of a record's states; other arguments as in `discover`.

    Args:
        record: The states.
        candidates: Terms looked among.
        states: Their names.
        select: What picks the terms.
        threshold: Of what picks them.
        members: Of the ensemble.
        seed: Of the ensemble.

    Raises:
        InputError: A candidate overflows.
    """
    with np.errstate(over="ignore", invalid="ignore"):  # refused just below
        values = candidates.evaluate(record.columns) * record.rate[:, None]
    if not np.all(np.isfinite(values)):
        worst = candidates.names[np.argmin(np.all(np.isfinite(values), axis=0))]
        raise InputError(
            f"term {worst}: expected finite values all along the record, got others; "
            "use larger units or a lower degree"
        )
    terms = record.windows.integral @ values
    repeats = repeated_terms(terms)
    rng = np.random.default_rng(seed)
    found = [
        _equation(record, state, terms, ~repeats, select, threshold, members, rng)
        for state in range(len(states))
    ]
    coefficients, low, high, inclusion = (
        np.stack(part) for part in zip(*found, strict=True)
    )
    names = np.asarray(candidates.names)
    scale = np.sqrt(np.mean(record.scale**2, axis=0))
    return Discovery(
        tuple(states),
        candidates,
        coefficients,
        low,
        high,
        inclusion,
        record.noise_sd * scale,
        tuple(names[repeats].tolist()),
        record.smooth[0],
    )


def _equation(
    record: Record,
    state: int,
    terms: Float[np.ndarray, "window term"],
    told: Bool[np.ndarray, " term"],
    select: Selection,
    threshold: float,
    members: int,
    rng: np.random.Generator,
) -> tuple[Float[np.ndarray, " term"], ...]:
    """Return one state's coefficients, their quantiles, and how often terms came."""
    to_left, sd = record.noise_map(state), record.noise_sd[state]
    covariance = (to_left @ to_left.T).toarray() * sd**2
    regression = Regression(terms[:, told], covariance)
    lefts = record.noisy_lefts(state, members, rng)
    held = np.stack([select(regression, left, threshold) for left in lefts])
    inclusion = np.mean(held, axis=0)
    kept = inclusion > LIKELY
    own = least_squares(regression, record.left[:, state], kept)[0]
    middle = least_squares(regression, record.smooth_left[:, state], kept)[0]
    off = [least_squares(regression, left, kept)[0] - middle for left in lefts]
    parts = (own, *(own + np.quantile(off, (0.05, 0.95), axis=0)), inclusion)
    return tuple(_with_gaps(part, told) for part in parts)


def _with_gaps(
    part: Float[np.ndarray, " told"], told: Bool[np.ndarray, " term"]
) -> Float[np.ndarray, " term"]:
    """Put zeros where a term was left out."""
    whole = np.zeros(told.shape)
    whole[told] = part
    return whole
