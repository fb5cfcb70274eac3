r"""Linear systems of shared effects: all with all, or few with all and the rest apart.

With $L$ what the effects add to each row, and weights $w$ of the rows, the mode of the
effects asks for $(I + L^T \mathrm{diag}(w) L)^{-1}$ and for its determinant. Effects of
a shot load many rows. Those of a path, and errors that the rows of one record share,
load the rows of that path alone, so effects of two paths meet in none, and their part
of the matrix falls into small blocks: these are eliminated first, each by itself, and
what is left is a system of the effects of shots alone (the Schur complement). Ten
records of four quantities share 30 errors, and have 20 effects of paths: ten systems of
five and one of the shot's four, in place of one of 54.
"""

from collections.abc import Sequence
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from jblast.sensors.layout import picked
from jblast.sensors.path_scatter import solve_system

MOST_OF_A_BLOCK = 16
"""Groups of more effects are not eliminated one by one (see `blocks_of`)."""

Block = tuple[tuple[int, ...], tuple[int, ...]]
Blocks = tuple[Block, ...]
"""Rows and columns of each group of effects that load no rows but these, all of which
no other group loads."""


class Together(NamedTuple):
    r"""Effects each of which may load all rows.

    Of more effects than rows the system of the rows is solved, the smaller one. With
    $K = L L^T$ and $W$ the weights, $(I + L^T W L)^{-1} = I - L^T W (I + K W)^{-1} L$
    and $|I + L^T W L| = |I + K W|$.

    Attributes:
        load: What one standard deviation of each adds.
        covariance: $K$ where there are more effects than rows, else None.
    """

    load: Float[Array, "row effect"]
    covariance: Float[Array, "row row"] | None

    def added(self, v: Float[Array, " effect"]) -> Float[Array, " row"]:
        """Return what effects add to each row."""
        return self.load @ v

    def gathered(self, of_row: Float[Array, " row"]) -> Float[Array, " effect"]:
        """Return $L^T x$."""
        return self.load.T @ of_row

    def solved(self, weight: Float[Array, " row"], right: Float[Array, " effect"]):
        """Solve, and return ln of the determinant; NaN if not positive definite.

        By rows it is also NaN for some positive definite systems with negative weights.
        """
        if self.covariance is None:
            answer, size = solve_system(self._matrix(weight), right[:, None])
            return answer[:, 0], size
        answer, size = solve_system(self._matrix(weight), (self.load @ right)[:, None])
        return right - self.load.T @ (weight * answer[:, 0]), size

    def spread(self, weight: Float[Array, " row"]):
        """Return each row's variance under the inverse, and ln of the determinant."""
        if self.covariance is None:
            unit = jnp.eye(self.load.shape[1])
            inverse, size = solve_system(self._matrix(weight), unit)
            return jnp.sum((self.load @ inverse) * self.load, axis=1), size
        variance, size = solve_system(self._matrix(weight), self.covariance)
        return jnp.diagonal(variance), size

    def in_order(self, v: Float[Array, " effect"]) -> Float[Array, " effect"]:
        """Return effects in the order of the columns."""
        return v

    def _matrix(self, weight):
        if self.covariance is None:
            unit = jnp.eye(self.load.shape[1])
            return unit + self.load.T @ (weight[:, None] * self.load)
        return jnp.eye(len(weight)) + self.covariance * weight[None, :]


class Apart(NamedTuple):
    """Effects of which some load all rows, and others those of their record alone.

    Here effects are in an order of their own: the first kind, and then those of each
    record, as many of each; the ones that are missing load nothing and stay zero.

    Attributes:
        load: Of the first kind.
        of_record: Of the second kind.
        record: Whose rows those of `of_record` are; rows of no record are missing.
        place: Of each column among the effects.
    """

    load: Float[Array, "row effect"]
    of_record: Float[Array, "record row_of_record error"]
    record: np.ndarray
    place: np.ndarray

    def added(self, v: Float[Array, " held"]) -> Float[Array, " row"]:
        """Return what effects add to each row."""
        first, own = self._parted(v)
        of_records = jnp.sum(self.of_record * own[:, None, :], axis=2)
        return self.load @ first + self._by_row(of_records)

    def gathered(self, of_row: Float[Array, " row"]) -> Float[Array, " held"]:
        """Return $L^T x$."""
        own = jnp.sum(self.of_record * self._by_record(of_row)[:, :, None], axis=1)
        return jnp.concatenate([self.load.T @ of_row, own.ravel()])

    def solved(self, weight: Float[Array, " row"], right: Float[Array, " held"]):
        """Solve, and return ln of the determinant; NaN if not positive definite."""
        first, own = self._parted(right)
        across, inner, matrix, sizes = self._first_kind(weight, own[:, :, None])
        first -= jnp.einsum("kag,ka->g", across, inner[:, :, -1])
        outer, size = solve_system(matrix, first[:, None])
        outer = outer[:, 0]
        own = inner[:, :, -1] - jnp.einsum("kag,g->ka", inner[:, :, :-1], outer)
        return jnp.concatenate([outer, own.ravel()]), size + sizes

    def spread(self, weight: Float[Array, " row"]):
        """Return each row's variance under the inverse, and ln of the determinant."""
        count = self.load.shape[1]
        turned = jnp.swapaxes(self.of_record, 1, 2)
        _, inner, matrix, sizes = self._first_kind(weight, turned)
        alone = jnp.sum(turned * inner[:, :, count:], axis=1)
        inverse, size = solve_system(matrix, jnp.eye(count))
        along = jnp.einsum("kra,kag->krg", self.of_record, inner[:, :, :count])
        left = self.load - self._by_row(along)
        variance = jnp.sum((left @ inverse) * left, axis=1) + self._by_row(alone)
        return variance, size + sizes

    def _first_kind(self, weight, right):
        """Eliminate the effects of records.

        Args:
            weight: Of each row.
            right: Right sides of each record's system.

        Returns:
            What effects of the first kind and of records share, this and `right`
            solved, the system that is left of the first kind, and ln of the
            determinant of those of records.
        """
        count, errors = self.load.shape[1], self.of_record.shape[2]
        weighted = self.of_record * self._by_record(weight)[:, :, None]
        block = jnp.eye(errors)[None] + jnp.einsum(
            "kra,krb->kab", weighted, self.of_record
        )
        across = jnp.einsum("kra,krg->kag", weighted, self._by_record(self.load))
        both = jnp.concatenate([across, right], axis=2)
        inner, sizes = jax.vmap(solve_system)(block, both)
        matrix = jnp.eye(count) + self.load.T @ (weight[:, None] * self.load)
        matrix -= jnp.einsum("kag,kah->gh", across, inner[:, :, :count])
        return across, inner, matrix, jnp.sum(sizes)

    def in_order(self, v: Float[Array, " held"]) -> Float[Array, " effect"]:
        """Return effects in the order of the columns."""
        return v[self.place]

    def _parted(self, v):
        """Return effects of the first kind, and those of each record."""
        count, (records, _, errors) = self.load.shape[1], self.of_record.shape
        return v[:count], v[count:].reshape(records, errors)

    def _in_turn(self) -> bool:
        """Return whether rows stand record by record, of each as many: cheaper so."""
        rows = np.arange(len(self.load))
        return self.record.size == rows.size and bool(
            (self.record.ravel() == rows).all()
        )

    def _by_row(self, of_records):
        """Return what records have of each row; zero of rows of no record."""
        flat = of_records.reshape(self.record.size, *of_records.shape[2:])
        if self._in_turn():
            return flat
        place = np.full(len(self.load) + 1, len(flat))
        place[self.record.ravel()] = np.arange(len(flat))
        nothing = jnp.zeros((1, *flat.shape[1:]), flat.dtype)
        return jnp.concatenate([flat, nothing])[place[:-1]]

    def _by_record(self, of_row):
        """Return what the rows of each record have; zero of what is missing."""
        if self._in_turn():
            return of_row.reshape(*self.record.shape, *of_row.shape[1:])
        nothing = jnp.zeros((1, *of_row.shape[1:]), of_row.dtype)
        return jnp.concatenate([of_row, nothing])[self.record]


def effects_of(load: Float[Array, "row effect"], blocks: Blocks) -> Together | Apart:
    """Return effects in the form that is solved fastest."""
    rows, columns = load.shape
    if rows < columns:
        return Together(load, load @ load.T)
    if not blocks or columns <= 1:
        return Together(load, None)
    record = _padded([block for block, _ in blocks], rows)
    error = _padded([block for _, block in blocks], columns)
    alone = np.setdiff1d(np.arange(columns), error)
    place = np.zeros(columns + 1, int)
    place[alone] = np.arange(alone.size)
    place[error] = alone.size + np.arange(error.size).reshape(error.shape)
    wide = jnp.pad(load, ((0, 1), (0, 1)))
    of_record = wide[record[:, :, None], error[:, None, :]]
    return Apart(picked(load.T, alone).T, of_record, record, place[:-1])


def blocks_of(loading: Float[np.ndarray, "row effect"]) -> Blocks:
    """Return which effects load rows that no others do; () if a group is large.

    Args:
        loading: What one standard deviation of each effect adds to each row.
    """
    return joined_blocks(
        [
            (tuple(np.flatnonzero(loaded).tolist()), (column,))
            for column, loaded in enumerate(loading.T)
        ]
    )


def joined_blocks(parts: Sequence[Block]) -> Blocks:
    """Make one of those that share rows; () if it then has many effects.

    Args:
        parts: Rows and columns; each column stands in one of them.
    """
    first: dict[int, int] = {}
    joined = list(range(len(parts)))

    def root(part: int) -> int:
        while joined[part] != part:
            joined[part] = part = joined[joined[part]]
        return part

    for part, (rows, _) in enumerate(parts):
        for row in rows:
            joined[root(part)] = root(first.setdefault(row, part))
    blocks: dict[int, tuple[set[int], set[int]]] = {}
    for part, (rows, columns) in enumerate(parts):
        block = blocks.setdefault(root(part), (set(), set()))
        block[0].update(rows)
        block[1].update(columns)
    if any(len(columns) > MOST_OF_A_BLOCK for _, columns in blocks.values()):
        return ()
    return tuple((tuple(sorted(r)), tuple(sorted(c))) for r, c in blocks.values())


def _padded(lists: list[tuple[int, ...]], missing: int) -> np.ndarray:
    """Return lists as rows of one array, what is missing by a number of its own."""
    most = max(len(entries) for entries in lists)
    return np.array(
        [[*entries, *[missing] * (most - len(entries))] for entries in lists]
    )
