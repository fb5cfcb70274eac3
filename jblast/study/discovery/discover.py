"""The equation of motion in a recorded trajectory: which terms, how sure, is it a law.

For each state x the terms of dx/dt are looked for among candidates, in integrals over
short windows (`weak_form.py`), by PySINDy's thresholded least squares
(`sparse_regression.py`). How sure: records are made, with new noise, normal and as
large as the old; each is smoothed, and its terms and coefficients found, as the record
was (parametric bootstrap: Efron and Tibshirani 1993, chapter 6). Terms are counted in
records made from the smoothed states. Coefficients are found again in records that the
equations made, whose true coefficients are known: how far off they come is how far off
ours may be, bias included (the basic interval of Davison and Hinkley 1997, section
5.2). So noise counts on both sides, in what the terms are computed from too. Intervals
are nominal: those of 90 % held the true coefficient in 73 to 100 % of simulated records
with noise, case by case (calibration/results/discovery.txt). Whether it is a law is
judged in `judge.py`.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float

from jblast.errors import InputError
from jblast.progress import counted, stages
from jblast.study.discovery.candidate_terms import Candidates, polynomial
from jblast.study.discovery.ensemble import (
    coefficients_of,
    ensemble_uncertainty,
    integrals,
    interval_level,
    outside_terms,
)
from jblast.study.discovery.judge import Judgement, held_out_skill
from jblast.study.discovery.record import Record, trajectory_record
from jblast.study.discovery.sparse_regression import (
    Regression,
    Selection,
    exchangeable_terms,
    repeated_terms,
    sparse_terms,
)

THRESHOLD = 0.05
"""Least share of a derivative's root mean square for a term to stay."""
MEMBERS = 100
"""Of the ensemble."""
LIKELY = 0.5
"""Share of the ensemble that has to hold a term."""
STAGES = {"which terms": 4.0, "how sure": 3.0, "stretches left out": 3.0}
"""Of a discovery, and about how long each takes."""


@dataclass(frozen=True)
class Discovery:
    """Equations found, one a state.

    Attributes:
        states: Names of the states.
        candidates: Terms they were looked for among.
        coefficients: Of each equation, zero for a term it lacks.
        low: Lower end of the interval of each, the terms kept.
        high: Upper end.
        level: Nominal, of the intervals: 0.9, or less of fewer than 19 members.
        inclusion: Share of the ensemble that holds each term.
        noise_sd: Standard deviation of the noise of each state, in its unit.
        repeated: Terms left out, since sums of others equal them on this record.
        exchangeable: Of each equation, pairs of one of its terms and a candidate that
            could stand in its place (`exchangeable_terms`).
        start: Smoothed states at the first row.
        judged: What speaks for and against each equation.
    """

    states: tuple[str, ...]
    candidates: Candidates
    coefficients: Float[np.ndarray, "state term"]
    low: Float[np.ndarray, "state term"]
    high: Float[np.ndarray, "state term"]
    level: float
    inclusion: Float[np.ndarray, "state term"]
    noise_sd: Float[np.ndarray, " state"]
    repeated: tuple[str, ...]
    exchangeable: tuple[tuple[tuple[str, str], ...], ...]
    start: Float[np.ndarray, " state"]
    judged: tuple[Judgement, ...]

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
    outside: Candidates | None = None,
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
        outside: Terms that what is left over is held against; default: products of up
            to three columns, or none where `candidates` are named.
        held: Inputs keep their value until the next row; else linear between rows.
        threshold: Least share of a derivative's root mean square for a term to stay.
        members: Of the ensemble.
        seed: Of the ensemble.
    """
    inputs = np.empty((len(time_s), 0)) if inputs is None else inputs
    record = trajectory_record(time_s, states, inputs, held=held)
    if candidates is None:
        candidates, outside = polynomial(names), outside or polynomial(names, 3)
    return discover_in(
        record,
        candidates,
        names[: states.shape[1]],
        outside=outside,
        threshold=threshold,
        members=members,
        seed=seed,
    )


def discover_in(
    record: Record,
    candidates: Candidates,
    states: Sequence[str],
    *,
    outside: Candidates | None = None,
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
        outside: Terms that what is left over is held against.
        select: What picks the terms.
        threshold: Of what picks them.
        members: Of the ensemble.
        seed: Of the ensemble.

    Raises:
        InputError: A candidate overflows.
    """
    begin = stages(STAGES)
    begin("which terms")
    _refuse_overflow(record, candidates)
    terms = integrals(record, record.sides, candidates)
    distinct = ~repeated_terms(terms)
    covariances = [
        (to_left @ to_left.T).toarray() * record.noise_sd[state] ** 2
        for state in range(len(states))
        for to_left in (record.noise_map(state),)
    ]

    def kept_in(
        terms: Float[np.ndarray, "window term"],
        left: Float[np.ndarray, "window state"],
    ) -> Bool[np.ndarray, "state term"]:
        kept = np.zeros((len(states), len(distinct)), bool)
        for state, covariance in enumerate(covariances):
            regression = Regression(terms[:, distinct], covariance)
            kept[state, distinct] = select(regression, left[:, state], threshold)
        return kept

    rng = np.random.default_rng(seed)
    through = counted(members, "records with new noise")
    count = np.zeros((len(states), len(distinct)), int)
    for member in range(members):
        sides = record.sides_of(record.with_noise(record.smooth, rng))
        found = kept_in(integrals(record, sides, candidates), sides.left)
        count += found
        through(member + 1)
    inclusion = count / members
    kept = inclusion > LIKELY
    own = coefficients_of(terms, record.sides.left, kept)
    begin("how sure")
    sure = ensemble_uncertainty(
        record,
        candidates,
        outside_terms(record, candidates, outside),
        own,
        kept,
        members,
        rng,
    )
    begin("stretches left out")
    skill = held_out_skill(
        record,
        candidates,
        lambda seen: coefficients_of(terms[seen], record.sides.left[seen], kept),
    )
    names = np.asarray(candidates.names)
    return Discovery(
        tuple(states),
        candidates,
        own,
        sure.low,
        sure.high,
        interval_level(members),
        inclusion,
        record.noise_in_unit,
        tuple(names[~distinct].tolist()),
        tuple(
            tuple(
                (str(names[term]), str(names[other]))
                for term, other in exchangeable_terms(
                    Regression(terms, covariance), record.sides.left[:, state], row
                )
            )
            for state, (covariance, row) in enumerate(
                zip(covariances, kept, strict=True)
            )
        ),
        record.smooth[0],
        tuple(
            Judgement(float(skill[state]), *sure.odds[state], sure.likest[state])
            for state in range(len(states))
        ),
    )


def _refuse_overflow(record: Record, candidates: Candidates) -> None:
    with np.errstate(over="ignore", invalid="ignore"):  # refused just below
        values = candidates.evaluate(record.sides.columns) * record.rate[:, None]
    if not np.all(np.isfinite(values)):
        worst = candidates.names[np.argmin(np.all(np.isfinite(values), axis=0))]
        raise InputError(
            f"term {worst}: expected finite values all along the record, got others; "
            "use larger units or a lower degree"
        )
