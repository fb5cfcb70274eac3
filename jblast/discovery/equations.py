"""Discovery of the equation of motion of a trajectory: terms, uncertainty, tests.

For each state x the terms of dx/dt are searched among candidates, in integrals over
short windows (`discovery.record`), by PySINDy's thresholded least squares
(`discovery.sparse_regression`).

Uncertainty is estimated by a parametric bootstrap (Efron and Tibshirani 1993, chapter
6): records of the smoothed states with new normal noise of the measured size are
smoothed and searched in the same way. A term is kept if most of them contain it. For
the coefficients their left side is that of the equation found, plus the same noise, so
that the true coefficients are known: their errors, bias included, give the interval
(the basic interval of Davison and Hinkley 1997, section 5.2). So noise counts on both
sides of the equation.

The equation is judged a law by two tests. First, prediction: segment by segment, terms
and coefficients are found in windows that touch none of the segment, and the equation
is integrated over it from its first row, and again from a later row before errors of
the start have grown tenfold. The prediction must be nearer to its rows than the mean of
the other rows, and than the segment's first row, would be. Second, residuals must not
correlate more with candidates outside the search than in the records of the bootstrap.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from jaxtyping import Bool, Float
from scipy.stats import t as student

from jblast.discovery.prediction import MIN_ROWS, predicted
from jblast.discovery.record import (
    Record,
    Sides,
    jumps_of,
    trajectory_record,
)
from jblast.discovery.sparse_regression import (
    Candidates,
    Regression,
    exchangeable_terms,
    polynomial,
    repeated_terms,
    sparse_terms,
)
from jblast.errors import InputError
from jblast.progress import counted, stages

THRESHOLD = 0.05
"""Smallest share of a derivative's root mean square that a term must contribute."""
MEMBERS = 100
"""Default members of the ensemble: five beyond each bound of a 90 % interval."""
MIN_INCLUSION = 0.5
"""Share of the ensemble that must contain a term: the majority."""
STAGES = {"terms": 4.0, "uncertainty": 3.0, "held-out segments": 3.0}
"""Stages of a discovery, with their approximate share of its time."""
LEVEL = 0.9
"""Nominal level of an interval."""
FEWEST_OF_INTERVAL = 19
"""Smallest ensemble with 5 % and 95 % quantiles, its smallest and largest members."""
CLOSE = 0.1
"""Misfit relative to the standard deviation of a state up to which it is reproduced:
1 % of its variance."""
SEGMENTS = 5
"""Segments of a record, each held out once: as in five-fold cross-validation."""
MIN_SEGMENT = 1.0
"""Half widths of a window in a held-out segment at least: a sixth of a period, in which
the motion differs from its start."""
RESTART_HALF_WIDTHS = 8.0
"""Half widths of a window after which a held-out prediction restarts: about 1.3
periods, so that phase drift does not decide it."""
MIN_SKILL = 0.3
"""Share by which a law must reduce the squared error of the better guess, declared."""
SIGNIFICANCE = 3e-3
"""p below which residuals are more than noise, in each of several states: once in a
hundred records with three."""
MIN_SD = 0.1
"""Smallest standard deviation of ln of a sum of squared residuals: smaller differences
are due to quadrature and smoothing, not to noise."""
EXACT = 1e-6
"""Share of the derivative's square below which residuals are those of quadrature."""
WINDOWS_PER_TERM = 4
"""Windows for each candidate outside of the search at least: with fewer, some candidate
resembles any residual."""
Find = Callable[[Bool[np.ndarray, " window"]], Float[np.ndarray, "state term"]]
"""Function from a mask of windows to coefficients."""


@dataclass(frozen=True)
class Judgement:
    """Tests of an equation.

    Attributes:
        skill: Relative reduction, over held-out segments, of the squared error of the
            better of two guesses (mean and start); -inf if the integration diverges.
        outside: p of the correlation of the residuals with candidates outside of the
            search, for independent normal noise. NaN (untested) without such
            candidates.
        outside_term: Name of the most correlated one of them; "" without.
    """

    skill: float
    outside: float
    outside_term: str

    @property
    def law(self) -> bool:
        """True if held-out segments are predicted better than by a guess."""
        return self.skill >= MIN_SKILL

    @property
    def whole(self) -> bool:
        """True if the residuals are no more than noise; False if untested."""
        return self.outside >= SIGNIFICANCE


@dataclass(frozen=True)
class Discovery:
    """Equations found, one for each state.

    Attributes:
        states: Names of the states.
        candidates: Candidate terms.
        coefficients: Coefficients of each equation, zero for absent terms.
        low: Lower bound of the interval of each coefficient, given the terms.
        high: Upper bound.
        level: Nominal level of the intervals: 0.9, or less below 19 members.
        inclusion: Share of the ensemble that contains each term.
        noise_sd: Standard deviation of the noise of each state, in its unit.
        repeated: Candidates left out, as sums of others equal them on this record.
        exchangeable: Pairs, for each equation, of one of its terms and a candidate that
            could replace it (`exchangeable_terms`).
        judged: Tests of each equation.
        predicted: Equations integrated from the first row of each run, and again from
            each row at which errors have grown; NaN after an integration was stopped.
        misfit: Root mean square difference of it from the data, less the noise in
            quadrature, relative to the state's standard deviation; infinite if stopped.
        growing_s: Times since the first row at which an error has grown tenfold since
            the last of them, by the equations along the record (`restarts`) [s].
        segments: Number of segments, each held out once.
        jumps: Rows, from zero, at which a state jumps (`jumps_of`).
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
    judged: tuple[Judgement, ...]
    predicted: Float[np.ndarray, "row state"]
    misfit: Float[np.ndarray, " state"]
    growing_s: tuple[float, ...]
    segments: int
    jumps: tuple[int, ...]

    @property
    def growth_s(self) -> float:
        """Mean time in which an error grows tenfold [s]; infinite if it does not."""
        return self.growing_s[-1] / len(self.growing_s) if self.growing_s else np.inf

    @property
    def reproduced(self) -> tuple[bool, ...]:
        """By state, True if the misfit is at most 10 %."""
        return tuple((self.misfit <= CLOSE).tolist())

    @property
    def certain(self) -> bool:
        """True if all equations pass their tests.

        No state jumps. Each has terms and no exchangeable ones, predicts held-out
        segments, has residuals no larger than noise, and reproduces its column.
        """
        return not self.jumps and all(
            bool(self.terms(state))
            and not self.exchangeable[state]
            and judged.law
            and judged.whole
            and self.reproduced[state]
            for state, judged in enumerate(self.judged)
        )

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
    runs: Sequence[int] = (0,),
    threshold: float = THRESHOLD,
    members: int = MEMBERS,
    seed: int = 0,
) -> Discovery:
    """Return the equation of dx/dt of each state of a trajectory.

    Args:
        time_s: Times of the rows, increasing [s].
        states: States in any units.
        inputs: Driving inputs, without errors.
        names: Names of the states, then of the inputs.
        candidates: Candidate terms; default: products of up to two columns.
        outside: Terms outside of the search that residuals are compared with; default:
            products of up to three columns, or none if `candidates` are given.
        held: Whether inputs are constant until the next row; else linear.
        runs: First row of each run, between which states may jump.
        threshold: Smallest share of a derivative's root mean square of a term.
        members: Number of members of the ensemble.
        seed: Seed of the ensemble.

    Raises:
        InputError: A candidate overflows.
    """
    inputs = np.empty((len(time_s), 0)) if inputs is None else inputs
    record = trajectory_record(time_s, states, inputs, held=held, runs=runs)
    if candidates is None:
        candidates, outside = polynomial(names), outside or polynomial(names, 3)
    begin = stages(STAGES)
    begin("terms")
    _check_finite(record, candidates)
    terms, left = integrals(record, record.sides, candidates), record.sides.left
    # Of equal terms the first of the list is kept.
    distinct = ~repeated_terms(terms)
    to_left = record.windows.of_rows
    covariances = [(to_left @ to_left.T).toarray() * sd**2 for sd in record.noise_sd]

    def kept_in(
        terms: Float[np.ndarray, "window term"],
        left: Float[np.ndarray, "window state"],
        seen: Bool[np.ndarray, " window"] | slice = slice(None),
    ) -> Bool[np.ndarray, "state term"]:
        # repeated terms are never candidates: the regression would be singular
        kept = np.zeros((left.shape[1], len(distinct)), bool)
        for state, covariance in enumerate(covariances):
            some = Regression(terms[seen][:, distinct], covariance[seen][:, seen])
            kept[state, distinct] = sparse_terms(some, left[seen, state], threshold)
        return kept

    def ensemble() -> Iterator[Sides]:
        # the same records each time: they are too large to be kept
        rng = np.random.default_rng(seed)
        through = counted(members, "records with new noise")
        for member in range(members):
            yield record.with_noise(rng)
            through(member + 1)

    count = sum(
        kept_in(integrals(record, sides, candidates), sides.left).astype(int)
        for sides in ensemble()
    )
    inclusion = np.asarray(count / members)
    # The vote of the ensemble decides, not the one noisy record.
    kept = inclusion > MIN_INCLUSION
    own = coefficients_of(terms, left, kept)

    begin("uncertainty")
    others = outside_terms(record, candidates, outside)
    # what the smoothed states lack to obey the equations
    smooth_left = record.windows.derivative @ record.sides.columns[:, : len(own)]
    lacking = terms @ own.T - smooth_left
    errors, shares = [], []
    for sides in ensemble():
        of_member = integrals(record, sides, candidates)
        obeying = sides.left + lacking
        errors.append(coefficients_of(of_member, obeying, kept) - own)
        beyond = None if others is None else integrals(record, sides, others)
        shares.append(outside_share(of_member, obeying, kept, beyond)[0])
    low, high = basic_interval(own, np.stack(errors))
    beyond = None if others is None else integrals(record, record.sides, others)
    share, likest = outside_share(terms, left, kept, beyond)
    odds = unlikely(share, np.stack(shares))

    begin("held-out segments")
    bounds = [*runs, len(time_s)]
    made, starts = predicted(record, candidates.evaluate, own, bounds)
    growing = sorted({*starts} - {*bounds})
    off = misfit(made, states, record.noise_sd)

    def find(seen: Bool[np.ndarray, " window"]) -> Float[np.ndarray, "state term"]:
        some = kept_in(terms, left, seen)
        return coefficients_of(terms[seen], left[seen], some)

    segments = SEGMENTS
    skill = held_out_skill(record, candidates, find)
    # The equations reproduce the whole record, yet a fifth of it is not predicted from
    # the remaining rows if these do not constrain a term there, as after a decay.
    # Shorter segments then test the equations.
    half_widths = np.ptp(record.windows.centre) / record.windows.half
    while (
        np.all(off <= CLOSE)
        and not np.all(skill >= MIN_SKILL)
        and 2 * segments * MIN_SEGMENT <= half_widths
    ):
        segments *= 2
        skill = held_out_skill(record, candidates, find, segments)
    term_names = np.asarray(candidates.names)
    # a constant and single columns
    linear = np.isin(candidates.names, ("1", *names))
    return Discovery(
        tuple(names[: len(own)]),
        candidates,
        own,
        low,
        high,
        interval_level(members),
        inclusion,
        record.noise_sd,
        tuple(term_names[~distinct].tolist()),
        tuple(
            tuple(
                (str(term_names[term]), str(term_names[other]))
                for term, other in exchangeable_terms(
                    Regression(terms, covariance), left[:, state], kept[state], linear
                )
            )
            for state, covariance in enumerate(covariances)
        ),
        tuple(
            Judgement(float(skill[state]), float(odds[state]), name)
            for state, name in enumerate(
                others.names[nth] if others else "" for nth in likest
            )
        ),
        made,
        off,
        tuple((record.time_s[growing] - record.time_s[0]).tolist()),
        segments,
        tuple(row for row in jumps_of(time_s, states) if row not in runs),
    )


def _check_finite(record: Record, candidates: Candidates) -> None:
    with np.errstate(over="ignore", invalid="ignore"):  # rejected just below
        values = candidates.evaluate(record.sides.columns)
    if not np.all(np.isfinite(values)):
        place, term = np.argwhere(~np.isfinite(values))[0]
        raise InputError(
            f"term {candidates.names[term]}: expected finite values along the record, "
            f"got {values[place, term]}; use larger units or a lower degree"
        )


def misfit(
    made: Float[np.ndarray, "row state"],
    states: Float[np.ndarray, "row state"],
    noise_sd: Float[np.ndarray, " state"] | float,
) -> Float[np.ndarray, " state"]:
    """Return the misfit of integrated equations relative to the spread of each state.

    It is the root mean square difference, less the noise in quadrature, and infinite if
    the integration was stopped. Up to `CLOSE` the equations reproduce the record.
    """
    # The data have noise and the integrated equations none: their variances add.
    over = np.mean((states - made) ** 2, axis=0) - noise_sd**2
    share = np.sqrt(np.maximum(over, 0.0)) / np.std(states, axis=0)
    return np.where(np.isnan(over), np.inf, share)


def interval_level(members: int) -> float:
    """Return the nominal level of an interval: 90 %, or less below 19 members.

    The smallest and largest of them contain another one with the probability
    (members - 1)/(members + 1).
    """
    return min(LEVEL, (members - 1) / (members + 1))


def basic_interval(
    own: Float[np.ndarray, "..."], off: Float[np.ndarray, "member ..."]
) -> Float[np.ndarray, "2 ..."]:
    """Return the bounds of an interval: an estimate minus quantiles of errors.

    Quantile p of the members is the (members + 1) p-th of them, or the smallest or
    largest if there is none: the level is `interval_level`.
    """
    # Errors are subtracted, so that the bias of the estimate is corrected, too.
    tail = 0.5 * (1.0 - LEVEL)
    return own - np.quantile(off, (1.0 - tail, tail), axis=0, method="weibull")


def outside_terms(
    record: Record,
    candidates: Candidates,
    outside: Candidates | None,
) -> Candidates | None:
    """Return the terms outside of the search, if they are finite and few enough."""
    if outside is None:
        return None
    new = np.array([name not in candidates.names for name in outside.names])
    names = tuple(np.asarray(outside.names)[new].tolist())
    with np.errstate(over="ignore", invalid="ignore"):  # such terms are left out
        finite = np.all(np.isfinite(outside.evaluate(record.sides.columns)))
    # With fewer windows some of these terms fits any residual by chance.
    few = WINDOWS_PER_TERM * len(names) <= len(record.windows.centre)
    if not (names and finite and few):
        return None
    return Candidates(names, lambda values: outside.evaluate(values)[:, new])


def integrals(
    record: Record, sides: Sides, candidates: Candidates
) -> Float[np.ndarray, "window term"]:
    """Return the integral of each candidate over each window."""
    return record.windows.integral @ candidates.evaluate(sides.columns)


def coefficients_of(
    terms: Float[np.ndarray, "window term"],
    left: Float[np.ndarray, "window state"],
    kept: Bool[np.ndarray, "state term"],
) -> Float[np.ndarray, "state term"]:
    """Return the coefficients of each state by least squares, zero for other terms."""
    found = np.zeros(kept.shape)
    for state, row in enumerate(kept):
        found[state, row] = np.linalg.lstsq(terms[:, row], left[:, state])[0]
    return found


def held_out_skill(
    record: Record, candidates: Candidates, find: Find, segments: int = SEGMENTS
) -> Float[np.ndarray, " state"]:
    """Return the skill of equations on held-out segments relative to a guess.

    Args:
        record: Record of the equations.
        candidates: Candidate terms.
        find: Function from a mask of windows to coefficients; the terms are found in
            these windows, too.
        segments: Number of segments, each held out once.
    """
    rows, cut = len(record.time_s), record.windows
    squared_errors = np.zeros((3, record.states.shape[1]))
    bounds = np.linspace(0, rows, segments + 1).astype(int)
    for first, last in pairwise(bounds):
        # A window that touches the segment would carry its rows into the fit.
        seen = (cut.centre + cut.half <= record.time_s[first]) | (
            cut.centre - cut.half >= record.time_s[last - 1]
        )
        if not np.any(seen):
            continue
        length = float(record.time_s[last - 1] - record.time_s[first])
        parts = min(
            round(length / (RESTART_HALF_WIDTHS * cut.half)), (last - first) // MIN_ROWS
        )
        own = np.linspace(first, last, max(1, parts) + 1).astype(int).tolist()
        own = sorted({*own, *(row for row in record.runs if first < row < last)})
        made, starts = predicted(record, candidates.evaluate, find(seen), own)
        # Both guesses use no equation: the mean of the other rows, and a constant.
        elsewhere = np.delete(record.states, slice(first, last), axis=0).mean(axis=0)
        constant = record.smooth[np.repeat(starts, np.diff([*starts, last]))]
        truth = record.states[first:last]
        for nth, guess in enumerate((made, elsewhere, constant)):
            squared_errors[nth] += np.sum((truth - guess) ** 2, axis=0)
    # a stopped integration predicts nothing: infinitely wrong
    squared_errors = np.where(np.isnan(squared_errors), np.inf, squared_errors)
    return 1.0 - squared_errors[0] / np.minimum(squared_errors[1], squared_errors[2])


def outside_share(
    terms: Float[np.ndarray, "window term"],
    left: Float[np.ndarray, "window state"],
    kept: Bool[np.ndarray, "state term"],
    outside: Float[np.ndarray, "window other"] | None,
) -> tuple[Float[np.ndarray, " state"], list[int]]:
    """Return how much of the residuals terms outside of the search explain.

    It is ln of the sum of squares that they explain, as a share of that of the left
    side and at least of `EXACT`; NaN without such terms. And the term that explains
    most.

    Args:
        terms: Terms of the search.
        left: Left sides.
        kept: Mask of the terms of each equation.
        outside: Terms outside of the search.
    """
    shares, likest = np.full(len(kept), np.nan), [0] * len(kept)
    if outside is None:
        return shares, likest
    for state, row in enumerate(kept):
        # An orthonormal basis: the residuals need no coefficients.
        base = np.linalg.qr(terms[:, row])[0]
        over = left[:, state] - base @ (base.T @ left[:, state])
        free = outside - base @ (base.T @ outside)
        norm = np.linalg.norm(free, axis=0)
        # a term outside that the equation nearly contains has no direction of its own
        outlying = norm > 1e-6 * np.linalg.norm(outside, axis=0)
        unit = np.where(outlying, free / np.where(outlying, norm, 1.0), 0.0)
        vectors, sizes, _ = np.linalg.svd(unit, full_matrices=False)
        explained = np.sum((vectors[:, sizes > 1e-6 * sizes[0]].T @ over) ** 2)
        shares[state] = np.log(max(explained / np.sum(left[:, state] ** 2), EXACT))
        likest[state] = int(np.argmax((unit.T @ over) ** 2))
    return shares, likest


def unlikely(
    own: Float[np.ndarray, " state"], members: Float[np.ndarray, "member state"]
) -> Float[np.ndarray, " state"]:
    """Return p of each number as a further member of a normal ensemble."""
    count = len(members)
    sd = np.maximum(np.std(members, axis=0, ddof=1), MIN_SD)
    # The spread of the mean of the members is included: a prediction interval.
    away = (own - np.mean(members, axis=0)) / (sd * np.sqrt(1.0 + 1.0 / count))
    return student.sf(away, count - 1)
