"""Discovery of the equation of motion of a trajectory: terms, uncertainty, tests.

For each state x the terms of dx/dt are searched among candidates, in integrals over
short windows (`discovery.record`), by PySINDy's thresholded least squares
(`discovery.sparse_regression`).

Uncertainty is estimated by a parametric bootstrap (Efron and Tibshirani 1993, chapter
6): records with new normal noise of the measured size are smoothed and searched in the
same way. The frequency of terms is counted in records made from the smoothed states.
Coefficients are estimated in records that the found equations made, whose true
coefficients are known: their errors, bias included, give the interval (the basic
interval of Davison and Hinkley 1997, section 5.2). So noise counts on both sides of the
equation. Intervals are nominal: those of 90 % covered the true coefficient in 73 to
100 % of simulated records with noise, case by case
(calibration/results/discovery.txt).

The equation is judged a law by two tests. First, prediction: segment by segment the
coefficients are estimated from windows that touch none of the segment, and the equation
is integrated over it from its first row, and again from a later row before errors of
the start have grown tenfold. The prediction must be nearer to its rows than
the mean of the other rows, and than the segment's first row, would be. The terms were
chosen from all rows, including these. Second, residuals: in size, in correlation with
the next window and in correlation with candidates outside the search, they must be as
in records that this equation made.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float
from scipy.stats import t as student

from jblast.discovery.integration import (
    CLOSE,
    MIN_ROWS,
    flow,
    reproducing_runs,
    restarts,
)
from jblast.discovery.record import (
    PER_HALF_WIDTH,
    Record,
    Sides,
    jumps_of,
    rows_of_runs,
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
SEGMENTS = 5
"""Segments of a record, each held out once: as in five-fold cross-validation."""
MIN_SEGMENT = 1.0
"""Half widths of a window in a held-out segment at least: a sixth of a period, in which
the motion differs from its start."""
RESTART_HALF_WIDTHS = 8.0
"""Half widths of a window after which an integration restarts: about 1.3 periods, so
that chaos and phase drift do not decide the prediction."""
MIN_SKILL = 0.3
"""Share by which a law must reduce the squared error of the better guess, declared."""
SIGNIFICANCE = 1e-3
"""p below which residuals are more than noise: three tests of each of several
states."""
MIN_MEMBERS = 5
"""Members of the ensemble that are needed for a p: fewer give no standard deviation."""
MIN_SD = (0.1, 0.05, 0.05)
"""Smallest standard deviations of the three statistics: smaller differences are due to
quadrature and smoothing, not to noise."""
EXACT = 1e-6
"""Residual, as a share of the derivative's square, below which a fit counts as exact
and is not tested: it is the error of quadrature."""
WINDOWS_PER_TERM = 4
"""Windows for each candidate outside of the search at least: with fewer, some candidate
resembles any residual."""
Find = Callable[[Bool[np.ndarray, " window"]], Float[np.ndarray, "state term"]]
"""Function from a mask of windows to coefficients."""


@dataclass(frozen=True)
class Replay:
    """Trajectory integrated from the first row, or the nearest one to the data.

    Attributes:
        states: States at the rows; NaN after the integration was stopped.
        misfit: Root mean square difference from the data, less the noise in quadrature,
            relative to the state's standard deviation.
        reproduced: Whether the misfit is at most 10 %, by state.
        nearest: Whether it is the trajectory of the equations nearest to the data,
            since errors of the first row grow and its integration leaves the data.
    """

    states: Float[np.ndarray, "row state"]
    misfit: Float[np.ndarray, " state"]
    reproduced: tuple[bool, ...]
    nearest: bool = False


@dataclass(frozen=True)
class Judgement:
    """Tests of an equation.

    Attributes:
        skill: Relative reduction, over held-out segments, of the squared error of the
            better of two guesses (mean and start); -inf if the integration diverges.
        excess: p of the size of the residuals under the equation with independent
            normal noise. NaN (untested) if the equations do not reproduce the record,
            or the ensemble is too small.
        serial: p of the correlation of the residuals with those of the next window.
        outside: p of their correlation with candidates outside of the search; NaN
            without such candidates.
        outside_term: Name of the most correlated one of them; "" without.
    """

    skill: float
    excess: float
    serial: float
    outside: float
    outside_term: str

    @property
    def law(self) -> bool:
        """True if held-out segments are predicted better than by a guess."""
        return self.skill >= MIN_SKILL

    @property
    def tested(self) -> bool:
        """True if the residuals could be compared with noise."""
        p = [self.excess, self.serial, *[self.outside] * bool(self.outside_term)]
        return bool(np.all(np.isfinite(p)))

    @property
    def whole(self) -> bool:
        """True if the residuals are no more than noise; False if untested."""
        odds = (self.excess, self.serial, self.outside)
        return self.tested and not any(p < SIGNIFICANCE for p in odds)


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
        start: Smoothed states at the first row of each run.
        judged: Tests of each equation.
        growing_s: Times since the first row at which an error has grown tenfold since
            the last of them, by the equations along the record (`restarts`) [s].
        segments: Number of segments, each held out once.
        jumps: Rows, from zero, at which a state jumps (`jumps_of`).
        runs: First row of each run.
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
    start: Float[np.ndarray, "run state"]
    judged: tuple[Judgement, ...]
    growing_s: tuple[float, ...] = ()
    segments: int = SEGMENTS
    jumps: tuple[int, ...] = ()
    runs: tuple[int, ...] = (0,)

    @property
    def growth_s(self) -> float:
        """Mean time in which an error grows tenfold [s]; infinite if it does not."""
        return self.growing_s[-1] / len(self.growing_s) if self.growing_s else np.inf

    def terms(self, state: int) -> tuple[str, ...]:
        """Return the names of the terms of an equation."""
        names = self.candidates.names
        return tuple(names[j] for j in np.flatnonzero(self.coefficients[state]))


def replay(
    discovery: Discovery,
    time_s: Float[np.ndarray, " row"],
    states: Float[np.ndarray, "row state"],
    inputs: Float[np.ndarray, "row input"] | None = None,
    *,
    held: bool = False,
    noise: bool = True,
) -> Replay:
    """Return the equations integrated from the first row, compared with the data.

    If this leaves the data and errors grow, it is the nearest trajectory instead.

    Args:
        discovery: Equations.
        time_s: Times of the rows, increasing [s].
        states: States at the rows.
        inputs: Inputs at the rows.
        held: Whether inputs are constant until the next row; else linear.
        noise: Whether the states have the estimated noise, which is then subtracted.
    """
    inputs = np.empty((len(time_s), 0)) if inputs is None else inputs
    # by times, as these rows need not be those of the search
    rows = np.unique(np.searchsorted(time_s - time_s[0], discovery.growing_s))
    own, off, nearest = reproducing_runs(
        discovery.candidates.evaluate,
        discovery.coefficients,
        discovery.start,
        time_s,
        states,
        inputs,
        noise * discovery.noise_sd,
        rows[rows <= len(time_s) - MIN_ROWS].tolist(),
        discovery.runs,
        held=held,
    )
    return Replay(own, off, tuple((off <= CLOSE).tolist()), nearest)


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
    state_names = tuple(names[: states.shape[1]])
    begin = stages(STAGES)
    begin("terms")
    _check_finite(record, candidates)
    terms = integrals(record, record.sides, candidates)
    # Of equal terms the first of the list is kept.
    distinct = ~repeated_terms(terms)
    to_left = record.windows.of_rows
    covariances = [(to_left @ to_left.T).toarray() * sd**2 for sd in record.noise_sd]

    def kept_in(
        terms: Float[np.ndarray, "window term"],
        left: Float[np.ndarray, "window state"],
    ) -> Bool[np.ndarray, "state term"]:
        # repeated terms are never candidates: the regression would be singular
        kept = np.zeros((len(state_names), len(distinct)), bool)
        for state, covariance in enumerate(covariances):
            regression = Regression(terms[:, distinct], covariance)
            kept[state, distinct] = sparse_terms(regression, left[:, state], threshold)
        return kept

    rng = np.random.default_rng(seed)
    through = counted(members, "records with new noise")
    count = np.zeros((len(state_names), len(distinct)), int)
    for member in range(members):
        sides = record.sides_of(record.with_noise(record.smooth, rng))
        found = kept_in(integrals(record, sides, candidates), sides.left)
        count += found
        through(member + 1)
    inclusion = count / members
    # The vote of the ensemble decides, not the one noisy record.
    kept = inclusion > MIN_INCLUSION
    own = coefficients_of(terms, record.sides.left, kept)
    growing = [
        part.start + row
        for part in rows_of_runs(runs, len(time_s))
        for row in restarts(
            candidates.evaluate,
            own,
            record.time_s[part],
            record.smooth[part],
            record.inputs[part],
            np.std(record.states, axis=0),
        )
    ]
    begin("uncertainty")
    sure = ensemble_uncertainty(
        record,
        candidates,
        outside_terms(record, candidates, outside),
        own,
        kept,
        growing,
        members,
        rng,
    )
    begin("held-out segments")

    def find(seen: Bool[np.ndarray, " window"]) -> Float[np.ndarray, "state term"]:
        return coefficients_of(terms[seen], record.sides.left[seen], kept)

    segments = SEGMENTS
    skill = held_out_skill(record, candidates, find)
    # The whole record is a trajectory of the equations, yet a fifth of it is not
    # predicted from the remaining rows if these do not constrain a coefficient there,
    # as after a decay. Shorter segments then test the equations.
    half_widths = np.ptp(record.windows.centre) / record.windows.half
    while (
        sure.reproduced
        and not np.all(skill >= MIN_SKILL)
        and 2 * segments * MIN_SEGMENT <= half_widths
    ):
        segments *= 2
        skill = held_out_skill(record, candidates, find, segments)
    term_names = np.asarray(candidates.names)
    return Discovery(
        state_names,
        candidates,
        own,
        sure.low,
        sure.high,
        interval_level(members),
        inclusion,
        record.noise_sd,
        tuple(term_names[~distinct].tolist()),
        tuple(
            tuple(
                (str(term_names[term]), str(term_names[other]))
                for term, other in exchangeable_terms(
                    Regression(terms, covariance),
                    record.sides.left[:, state],
                    row,
                    # a constant and single columns
                    np.isin(candidates.names, ("1", *names)),
                )
            )
            for state, (covariance, row) in enumerate(
                zip(covariances, kept, strict=True)
            )
        ),
        record.smooth[list(runs)],
        tuple(
            Judgement(float(skill[state]), *sure.odds[state], sure.likest[state])
            for state in range(len(state_names))
        ),
        tuple((record.time_s[growing] - record.time_s[0]).tolist()),
        segments,
        tuple(row for row in jumps_of(time_s, states) if row not in runs),
        tuple(runs),
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


class EnsembleUncertainty(NamedTuple):
    """Uncertainty of the equations of some states.

    Attributes:
        low: Lower bound of the interval of each coefficient (`interval_level`).
        high: Upper bound.
        odds: p of size, serial and outside correlation of the residuals, by state
            (`Judgement`).
        likest: Name of the most correlated term outside of the search, by state.
        reproduced: Whether a trajectory of the equations reproduces the record.
    """

    low: Float[np.ndarray, "state term"]
    high: Float[np.ndarray, "state term"]
    odds: list[tuple[float, float, float]]
    likest: list[str]
    reproduced: bool


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


def ensemble_uncertainty(
    record: Record,
    candidates: Candidates,
    others: Candidates | None,
    own: Float[np.ndarray, "state term"],
    kept: Bool[np.ndarray, "state term"],
    growing: Sequence[int],
    members: int,
    rng: np.random.Generator,
) -> EnsembleUncertainty:
    """Return the uncertainty from records with new noise.

    The records are integrated equations plus noise. If the equations do not reproduce
    the record (`reproducing_runs`, all states), they are the smoothed states plus
    noise, and there is no p.

    Args:
        record: Record of the equations.
        candidates: Candidate terms.
        others: Terms outside of the search that residuals are compared with.
        own: Coefficients of the equations.
        kept: Mask of the terms of each equation.
        growing: Rows at which errors have grown (`restarts`).
        members: Number of members of the ensemble.
        rng: Generator of the noise.
    """
    made, off, _ = reproducing_runs(
        candidates.evaluate,
        own,
        record.smooth[list(record.runs)],
        record.time_s,
        record.states,
        record.inputs,
        record.noise_sd,
        growing,
        record.runs,
        held=record.held,
    )
    reproduced = bool(np.all(off <= CLOSE))
    # errors are known exactly only in records that the equations made
    base = made if reproduced else record.smooth
    # windows two half widths apart share no row
    apart = 2 * PER_HALF_WIDTH

    def numbers(sides: Sides):
        terms = integrals(record, sides, candidates)
        beyond = np.zeros((len(terms), 0))
        if others is not None:
            beyond = integrals(record, sides, others)
        coefficients = coefficients_of(terms, sides.left, kept)
        over = [
            residual_statistics(terms[:, row], sides.left[:, state], beyond, apart)
            for state, row in enumerate(kept)
        ]
        return coefficients, np.stack([o[0] for o in over]), [o[1] for o in over]

    through = counted(members, "records with new noise")
    found, over = [], []
    for member in range(members):
        sides = record.sides_of(record.with_noise(base, rng))
        coefficients, over_by, _ = numbers(sides)
        found.append(coefficients)
        over.append(over_by)
        through(member + 1)
    middle = own if reproduced else numbers(record.sides_of(base))[0]
    low, high = basic_interval(own, np.stack(found) - middle)
    _, numbers_own, shares = numbers(record.sides)
    odds = np.full((len(own), 3), np.nan)
    if reproduced:
        for state in range(len(own)):
            odds[state] = unlikely(numbers_own[state], np.stack(over)[:, state])
    likest = [""] * len(own)
    if others is None:
        odds[:, 2] = np.nan
    else:
        likest = [others.names[int(np.argmax(share))] for share in shares]
    chances = [(float(a), float(b), float(c)) for a, b, c in odds]
    return EnsembleUncertainty(low, high, chances, likest, reproduced)


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

    The coefficients are fitted without the segment; the terms were chosen with all
    rows.

    Args:
        record: Record of the equations.
        candidates: Candidate terms.
        find: Function from a mask of windows to coefficients.
        segments: Number of segments, each held out once.
    """
    rows = len(record.time_s)
    cut, spread = record.windows, np.std(record.states, axis=0)
    squared_errors = np.zeros((3, record.states.shape[1]))
    bounds = np.linspace(0, rows, segments + 1).astype(int)
    for first, last in pairwise(bounds):
        # A window that touches the segment would carry its rows into the fit.
        seen = (cut.centre + cut.half <= record.time_s[first]) | (
            cut.centre - cut.half >= record.time_s[last - 1]
        )
        if not np.any(seen):
            continue
        # Both guesses use no equation: the mean of the other rows, and a constant.
        elsewhere = np.delete(record.states, slice(first, last), axis=0).mean(axis=0)
        coefficients = find(seen)
        length = record.time_s[last - 1] - record.time_s[first]
        parts = max(
            1,
            min(
                round(float(length) / (RESTART_HALF_WIDTHS * cut.half)),
                (last - first) // MIN_ROWS,
            ),
        )
        starts = np.linspace(first, last, parts + 1).astype(int).tolist()
        starts = sorted({*starts, *(r for r in record.runs if first < r < last)})
        # Earlier where errors of a start grow: they would hide those of the equation.
        grown = [
            begin + row
            for begin, end in pairwise(starts)
            for row in restarts(
                candidates.evaluate,
                coefficients,
                record.time_s[begin:end],
                record.smooth[begin:end],
                record.inputs[begin:end],
                spread,
            )
        ]
        for begin, end in pairwise(sorted({*starts, *grown})):
            some = slice(begin, end)
            start, truth = record.smooth[begin], record.states[some]
            recorded = flow(
                candidates.evaluate,
                coefficients,
                start,
                record.time_s[some],
                record.inputs[some],
                spread,
                held=record.held,
            )
            for nth, guess in enumerate((recorded, elsewhere, start)):
                squared_errors[nth] += np.sum((truth - guess) ** 2, axis=0)
    # a stopped integration predicts nothing: infinitely wrong
    squared_errors = np.where(np.isnan(squared_errors), np.inf, squared_errors)
    return 1.0 - squared_errors[0] / np.minimum(squared_errors[1], squared_errors[2])


def residual_statistics(
    terms: Float[np.ndarray, "window term"],
    left: Float[np.ndarray, " window"],
    outside: Float[np.ndarray, "window other"],
    windows_apart: int,
) -> tuple[Float[np.ndarray, "3"], Float[np.ndarray, " other"]]:
    """Return three statistics of the residuals of an equation, and shares of terms.

    They are ln of the mean square residual relative to the left side, the correlation
    of residuals of different windows, and -ln of the share that terms outside leave.

    Args:
        terms: Terms of the equation.
        left: Left side.
        outside: Terms outside of the search.
        windows_apart: Number of windows to the next one without common rows.
    """
    # An orthonormal basis: the residuals need no coefficients.
    base = np.linalg.qr(terms)[0] if terms.shape[1] else terms
    over = left - base @ (base.T @ left)
    # Never 0, so that an exact fit has a finite logarithm.
    square = max(float(over @ over), np.finfo(float).tiny)
    later = over[windows_apart:]
    correlation = float(over[: len(later)] @ later) / square
    size = np.log(square / float(left @ left))
    if not outside.shape[1]:
        return np.array([size, correlation, 0.0]), np.zeros(0)
    free = outside - base @ (base.T @ outside)
    norm = np.linalg.norm(free, axis=0)
    # a term outside that the equation nearly contains has no direction of its own
    outlying = norm > 1e-6 * np.linalg.norm(outside, axis=0)
    unit = np.where(outlying, free / np.where(outlying, norm, 1.0), 0.0)
    share = (unit.T @ over) ** 2 / square
    vectors, sizes, _ = np.linalg.svd(unit, full_matrices=False)
    vectors = vectors[:, sizes > 1e-6 * sizes[0]] if sizes[0] > 0.0 else vectors[:, :0]
    # below 1, so that the logarithm is finite
    gain = min(float(np.sum((vectors.T @ over) ** 2)) / square, 1.0 - 1e-12)
    return np.array([size, correlation, -np.log1p(-gain)]), share


def unlikely(
    own: Float[np.ndarray, "3"], members: Float[np.ndarray, "member 3"]
) -> Float[np.ndarray, "3"]:
    """Return p of each statistic as a further member of a normal ensemble."""
    count = len(members)
    if count < MIN_MEMBERS:
        return np.full(3, np.nan)
    # noise-free records: the residual is rounding and quadrature, not evidence
    if own[0] < np.log(EXACT):
        return np.ones(3)
    sd = np.maximum(np.std(members, axis=0, ddof=1), MIN_SD)
    # The spread of the mean of the members is included: a prediction interval.
    away = (own - np.mean(members, axis=0)) / (sd * np.sqrt(1.0 + 1.0 / count))
    return student.sf(away, count - 1)
