"""Is it a law? What it says of rows its coefficients have not seen, and what is left.

Two questions. Stretch by stretch the coefficients of its terms are found anew from
windows that touch none of it, and the equation is integrated over it from its first
row: a law has to come nearer to its rows than their mean elsewhere, or the stretch's
start, would. Which terms it has was chosen from all rows, these too. And what the
equation leaves over in the windows has to be what the noise leaves over in records that
this equation made: as much, as little like itself a window later, as little like
candidates outside those looked among.
"""

from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from jaxtyping import Bool, Float
from scipy.stats import t as student

from jblast.study.discovery.candidate_terms import Candidates
from jblast.study.discovery.flow import flow
from jblast.study.discovery.record import Record

STRETCHES = 5
"""Each is left out once."""
LONG = 8.0
"""Half widths of a window after which an integration starts anew: about 1.3 periods."""
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


@dataclass(frozen=True)
class Judgement:
    """What speaks for an equation and against it.

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


Find = Callable[[Bool[np.ndarray, " window"]], Float[np.ndarray, "state term"]]
"""Finds coefficients from some of the windows."""


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
            1, min(round(float(length) / (LONG * cut.half)), (last - first) // 4)
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
