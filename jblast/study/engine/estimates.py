"""What is known of each outcome so far: mean and standard error, by cell of the axes.

Sums of values and of squares about the mean are merged by Chan, Golub and LeVeque
(1983), eqs. 2.1: what was added when makes no difference but for rounding.
"""

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
from jaxtyping import Float, Int

from jblast.study.engine.numbering import Numbering
from jblast.study.engine.variable import Variable


class Moments(NamedTuple):
    """Of samples, by variant and cell, and by sensor where an outcome has them.

    Attributes:
        answers: Samples that have an answer.
        failed: Samples that have none.
        mean: Of the answers.
        square: Sum of the squares about the mean.
    """

    answers: Int[np.ndarray, "..."]
    failed: Int[np.ndarray, "..."]
    mean: Float[np.ndarray, "..."]
    square: Float[np.ndarray, "..."]

    def standard_error(self) -> Float[np.ndarray, "..."]:
        """Return that of each mean; infinite of fewer than two answers."""
        few = self.answers < 2
        count = np.where(few, 2, self.answers)
        return np.where(few, np.inf, np.sqrt(self.square / (count - 1) / count))

    def whole(self) -> "Moments":
        """Return those of all cells together, by sensor."""
        together = self
        while len(together.answers) > 1:
            half = len(together.answers) // 2
            two = Moments(*(x[: 2 * half] for x in together))
            rest = Moments(*(x[2 * half :] for x in together))
            pairs = merged(
                Moments(*(x[0::2] for x in two)), Moments(*(x[1::2] for x in two))
            )
            together = Moments(
                *(np.concatenate(x) for x in zip(pairs, rest, strict=True))
            )
        return together


def merged(a: Moments, b: Moments) -> Moments:
    """Return the moments of two sets of samples together."""
    count = a.answers + b.answers
    there = np.where(count > 0, count, 1)
    apart = b.mean - a.mean
    mean = a.mean + apart * (b.answers / there)
    square = a.square + b.square + apart**2 * (a.answers * (b.answers / there))
    return Moments(count, a.failed + b.failed, mean, square)


class Estimates:
    """Running estimates of the outcomes of a study.

    Attributes:
        moments: By name of the outcome.
    """

    def __init__(self, variables: Sequence[Variable], numbering: Numbering) -> None:
        self._numbering = numbering
        self._outcomes = [v for v in variables if v.role == "outcome"]
        cells = numbering.variants * numbering.cells
        self.moments = {
            v.name: Moments(
                *(np.zeros((cells, *v.shape(0)[1:]), kind) for kind in (int, int)),
                *(np.zeros((cells, *v.shape(0)[1:])) for _ in range(2)),
            )
            for v in self._outcomes
        }

    def add(self, begin: int, columns: Mapping[str, np.ndarray]) -> None:
        """Take in samples from a number on."""
        numbering = self._numbering
        count = len(columns[self._outcomes[0].name]) if self._outcomes else 0
        cells = numbering.variants * numbering.cells
        which = None
        if cells > 1:
            variant, cell = numbering.of_samples(begin, begin + count)
            which = variant * numbering.cells + cell
        for variable in self._outcomes:
            values = np.asarray(columns[variable.name])
            good = values >= 0 if variable.kind == "yes_no" else ~np.isnan(values)
            more = _moments(values, good, which, cells)
            self.moments[variable.name] = merged(self.moments[variable.name], more)

    def reached(self, targets: Mapping[str, float]) -> bool:
        """Whether every standard error, of every cell and sensor, is down."""
        return bool(targets) and all(
            (self.moments[name].standard_error() <= target).all()
            for name, target in targets.items()
        )


def _moments(
    values: np.ndarray, good: np.ndarray, which: np.ndarray | None, cells: int
) -> Moments:
    """Return the moments of some samples."""
    number = np.where(good, values, 0.0).astype(float)
    if which is None:
        count = good.sum(axis=0, keepdims=True)
        there = np.where(count > 0, count, 1)
        mean = number.sum(axis=0, keepdims=True) / there
        square = (np.where(good, number - mean, 0.0) ** 2).sum(axis=0, keepdims=True)
        return Moments(count, len(values) - count, mean, square)
    flat, good_flat = number.reshape(len(values), -1), good.reshape(len(values), -1)

    def by_cell(column: np.ndarray) -> np.ndarray:
        return np.stack(
            [np.bincount(which, c, minlength=cells) for c in column.T.astype(float)],
            axis=-1,
        )

    count, all_of = by_cell(good_flat), by_cell(np.ones_like(flat))
    mean = by_cell(flat) / np.where(count > 0, count, 1)
    square = by_cell(np.where(good_flat, flat - mean[which], 0.0) ** 2)
    shape = (cells, *values.shape[1:])
    return Moments(
        count.astype(int).reshape(shape),
        (all_of - count).astype(int).reshape(shape),
        mean.reshape(shape),
        square.reshape(shape),
    )
