"""The equation of motion in a recorded trajectory: terms, uncertainty, verdict.

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
is integrated over it from its first row. The prediction must be nearer to its rows than
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
from scipy.integrate import solve_ivp
from scipy.stats import t as student

from jblast.discovery.record import (
    PER_HALF_WIDTH,
    Record,
    Sides,
    input_at,
    trajectory_record,
)
from jblast.discovery.sparse_regression import (
    Candidates,
    Regression,
    Selection,
    exchangeable_terms,
    polynomial,
    repeated_terms,
    sparse_terms,
)
from jblast.errors import InputError
from jblast.progress import counted, stages

THRESHOLD = 0.05
"""Least share of a derivative's root mean square for a term to stay."""
MEMBERS = 100
"""Of the ensemble."""
LIKELY = 0.5
"""Share of the ensemble that has to hold a term."""
STAGES = {"which terms": 4.0, "how sure": 3.0, "stretches left out": 3.0}
"""Of a discovery, and about how long each takes."""
LEVEL = 0.9
"""Of an interval, nominal."""
FEWEST_OF_INTERVAL = 19
"""Members of which the 5 and 95 % quantiles are the least and the greatest."""
STRETCHES = 5
"""Each is left out once."""
RESTART_HALF_WIDTHS = 8.0
"""Half widths of a window after which an integration restarts: about 1.3 periods."""
LEAST_SKILL = 0.3
"""Share of the squared miss of the better guess that a law has to save."""
DOUBTFUL = 1e-3
"""p below which a law is not the whole of it."""
FEWEST_MEMBERS = 5
"""Of the ensemble, or there is no p."""
LEAST_SD = (0.1, 0.05, 0.05)
"""Of the three numbers: smaller differences are of our arithmetic, not of noise."""
EXACT = 1e-6
"""Share of the derivative's square that nothing is made of, if no more is left over."""
PER_TERM = 4
"""Windows, at least, for each candidate outside; else they are not tried."""
Find = Callable[[Bool[np.ndarray, " window"]], Float[np.ndarray, "state term"]]
"""Finds coefficients from some of the windows."""
CLOSE = 0.1
"""Miss, as a share of the spread of a state, up to which it is reproduced: 1 % of its
variance."""
DIVERGED_SPREADS = 1e3
"""Spreads of a state at which an integration is given up."""
CALLS = 500
"""Evaluations of the equations per row, at most."""
TOLERANCE = 1e-6
"""Of the integrator, relative: far below any noise."""


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


@dataclass(frozen=True)
class Judgement:
    """Evidence for an equation and against it.

    Attributes:
        skill: Share of the squared miss of the better of two guesses, mean and start,
            that the equation saves over stretches its coefficients have not seen; -inf
            if it runs away.
        excess: p of so much being left over, were the equation and independent normal
            noise all; NaN where it does not give the record back, all states at once,
            or the ensemble is too small: then it is untested.
        serial: p of what is left over being so much like itself a window later.
        outside: p of it being so much like candidates outside; NaN if none were tried.
        outside_term: Name of the likest of them; "" if none were tried.
    """

    skill: float
    excess: float
    serial: float
    outside: float
    outside_term: str

    @property
    def law(self) -> bool:
        """Whether it foretells stretches left out better than a guess."""
        return self.skill >= LEAST_SKILL

    @property
    def tested(self) -> bool:
        """Whether what is left over could be held against noise."""
        p = [self.excess, self.serial, *[self.outside] * bool(self.outside_term)]
        return bool(np.all(np.isfinite(p)))

    @property
    def whole(self) -> bool:
        """Whether nothing is left over that noise would not leave; no, untested."""
        odds = (self.excess, self.serial, self.outside)
        return self.tested and not any(p < DOUBTFUL for p in odds)


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
        judged: Evidence for and against each equation.
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


def replay(
    discovery: Discovery,
    time_s: Float[np.ndarray, " row"],
    states: Float[np.ndarray, "row state"],
    inputs: Float[np.ndarray, "row input"] | None = None,
    *,
    held: bool = False,
    noise: bool = True,
) -> Replay:
    """Integrate the equations and hold them against the data.

    Args:
        discovery: The equations.
        time_s: Of the rows, rising [s].
        states: At the rows.
        inputs: At the rows.
        held: Inputs keep their value until the next row; else linear between rows.
        noise: Whether the states have the noise found; it is taken off then.
    """
    inputs = np.empty((len(time_s), 0)) if inputs is None else inputs
    own = flow(
        discovery.candidates.evaluate,
        discovery.coefficients,
        discovery.start,
        time_s,
        inputs,
        np.std(states, axis=0),
        held=held,
    )
    off = misfit(own, states, noise * discovery.noise_sd)
    return Replay(own, off, tuple((off <= CLOSE).tolist()))


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


class Sureness(NamedTuple):
    """How sure the equations of some states are.

    Attributes:
        low: Lower end of the interval of each coefficient (`interval_level`).
        high: Upper end.
        odds: p of so much, so like itself and so like terms outside being left over,
            state by state (`Judgement`).
        likest: Name of the likest of the terms outside, state by state.
    """

    low: Float[np.ndarray, "state term"]
    high: Float[np.ndarray, "state term"]
    odds: list[tuple[float, float, float]]
    likest: list[str]


def interval_level(members: int) -> float:
    """Return the nominal level of an interval: 90 %, of fewer than 19 members less.

    The least and the greatest of them hold one more with (members - 1)/(members + 1).
    """
    return min(LEVEL, (members - 1) / (members + 1))


def basic_interval(
    own: Float[np.ndarray, "..."], off: Float[np.ndarray, "member ..."]
) -> Float[np.ndarray, "2 ..."]:
    """Return the ends of an interval: a number less how far off members come.

    Quantile p of so many members is the (members + 1) p-th of them, and the least or
    the greatest where there is none: its level is `interval_level`.
    """
    tail = 0.5 * (1.0 - LEVEL)
    return own - np.quantile(off, (1.0 - tail, tail), axis=0, method="weibull")


def ensemble_uncertainty(
    record: Record,
    candidates: Candidates,
    others: Candidates | None,
    own: Float[np.ndarray, "state term"],
    kept: Bool[np.ndarray, "state term"],
    members: int,
    rng: np.random.Generator,
) -> Sureness:
    """Make records with new noise, and find the coefficients in each.

    The equations make them; where they do not give the record back (`misfit`, all
    states), the smoothed states do, and there is no p.

    Args:
        record: What the equations were found in.
        candidates: Terms they were looked for among.
        others: Terms that what is left over is held against.
        own: Coefficients found.
        kept: Which terms they have.
        members: Of the ensemble.
        rng: Of the noise.
    """
    made = flow(
        candidates.evaluate,
        own,
        record.smooth[0],
        record.time_s,
        record.inputs,
        np.std(record.states, axis=0),
        held=record.held,
    )
    off = misfit(made, record.states, record.noise_in_unit)
    reproduced = bool(np.all(off <= CLOSE))
    if record.relative:
        reproduced = reproduced and bool(np.all(made > 0.0))
    base = made if reproduced else record.smooth
    apart = 2 * PER_HALF_WIDTH

    def numbers(sides: Sides):
        terms = integrals(record, sides, candidates)
        beyond = np.zeros((len(terms), 0))
        if others is not None:
            beyond = integrals(record, sides, others)
        coefficients = coefficients_of(terms, sides.left, kept)
        over = [
            left_over(terms[:, row], sides.left[:, state], beyond, apart)
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
    return Sureness(low, high, chances, likest)


def outside_terms(
    record: Record,
    candidates: Candidates,
    outside: Candidates | None,
) -> Candidates | None:
    """Return the terms outside, if they are numbers and few enough to tell."""
    if outside is None:
        return None
    new = np.array([name not in candidates.names for name in outside.names])
    names = tuple(np.asarray(outside.names)[new].tolist())
    with np.errstate(over="ignore", invalid="ignore"):  # not tried then
        finite = np.all(np.isfinite(outside.evaluate(record.sides.columns)))
    few = PER_TERM * len(names) <= len(record.windows.centre)
    if not (names and finite and few):
        return None
    return Candidates(names, lambda values: outside.evaluate(values)[:, new])


def integrals(
    record: Record, sides: Sides, candidates: Candidates
) -> Float[np.ndarray, "window term"]:
    """Return the integral of each candidate over each window."""
    values = candidates.evaluate(sides.columns) * record.rate[:, None]
    return record.windows.integral @ values


def coefficients_of(
    terms: Float[np.ndarray, "window term"],
    left: Float[np.ndarray, "window state"],
    kept: Bool[np.ndarray, "state term"],
) -> Float[np.ndarray, "state term"]:
    """Return each state's coefficients by least squares, zero for terms not kept."""
    found = np.zeros(kept.shape)
    for state, row in enumerate(kept):
        found[state, row] = np.linalg.lstsq(terms[:, row], left[:, state])[0]
    return found


def held_out_skill(
    record: Record, candidates: Candidates, find: Find
) -> Float[np.ndarray, " state"]:
    """Return how much better than a guess equations foretell stretches left out.

    Their coefficients have not seen these; their terms were chosen from all rows.
    """
    rows = len(record.time_s)
    place = np.log(record.time_s) if record.relative else record.time_s
    cut, spread = record.windows, np.std(record.states, axis=0)
    missed = np.zeros((3, record.states.shape[1]))
    ends = np.linspace(0, rows, STRETCHES + 1).astype(int)
    for first, last in pairwise(ends):
        seen = (cut.centre + cut.half <= place[first]) | (
            cut.centre - cut.half >= place[last - 1]
        )
        if not np.any(seen):
            continue
        elsewhere = np.delete(record.states, slice(first, last), axis=0).mean(axis=0)
        coefficients = find(seen)
        length = place[last - 1] - place[first]
        parts = max(
            1,
            min(
                round(float(length) / (RESTART_HALF_WIDTHS * cut.half)),
                (last - first) // 4,
            ),
        )
        starts = np.linspace(first, last, parts + 1).astype(int)
        for begin, end in pairwise(starts):
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
                missed[nth] += np.sum((truth - guess) ** 2, axis=0)
    missed = np.where(np.isnan(missed), np.inf, missed)
    return 1.0 - missed[0] / np.minimum(missed[1], missed[2])


def left_over(
    terms: Float[np.ndarray, "window term"],
    left: Float[np.ndarray, " window"],
    outside: Float[np.ndarray, "window other"],
    windows_apart: int,
) -> tuple[Float[np.ndarray, "3"], Float[np.ndarray, " other"]]:
    """Return three numbers of what an equation leaves over, and the share of each term.

    They are ln of its mean square beside that of the left side, how much it is like
    itself a window later, and -ln of the share that terms outside leave of it.

    Args:
        terms: Those of the equation.
        left: Left side.
        outside: Other terms.
        windows_apart: Windows from one to the next that shares nothing with it.
    """
    base = np.linalg.qr(terms)[0] if terms.shape[1] else terms
    over = left - base @ (base.T @ left)
    square = max(float(over @ over), np.finfo(float).tiny)
    later = over[windows_apart:]
    like_itself = float(over[: len(later)] @ later) / square
    size = np.log(square / float(left @ left))
    if not outside.shape[1]:
        return np.array([size, like_itself, 0.0]), np.zeros(0)
    free = outside - base @ (base.T @ outside)
    norm = np.linalg.norm(free, axis=0)
    outlying = norm > 1e-6 * np.linalg.norm(outside, axis=0)
    unit = np.where(outlying, free / np.where(outlying, norm, 1.0), 0.0)
    share = (unit.T @ over) ** 2 / square
    vectors, sizes, _ = np.linalg.svd(unit, full_matrices=False)
    vectors = vectors[:, sizes > 1e-6 * sizes[0]] if sizes[0] > 0.0 else vectors[:, :0]
    gain = min(float(np.sum((vectors.T @ over) ** 2)) / square, 1.0 - 1e-12)
    return np.array([size, like_itself, -np.log1p(-gain)]), share


def unlikely(
    own: Float[np.ndarray, "3"], members: Float[np.ndarray, "member 3"]
) -> Float[np.ndarray, "3"]:
    """Return p of each number, were it one more of the members'; they are normal."""
    count = len(members)
    if count < FEWEST_MEMBERS:
        return np.full(3, np.nan)
    if own[0] < np.log(EXACT):
        return np.ones(3)
    sd = np.maximum(np.std(members, axis=0, ddof=1), LEAST_SD)
    away = (own - np.mean(members, axis=0)) / (sd * np.sqrt(1.0 + 1.0 / count))
    return student.sf(away, count - 1)


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
        far = np.max(np.abs(states - start) / spread) > DIVERGED_SPREADS
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
