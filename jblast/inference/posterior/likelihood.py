r"""The likelihood of residuals whose rows share effects.

Row $i$ has the residual $r_i = \sum_k L_{ik} v_k + s_i \epsilon_i$: shared effects $v$
are standard normal with loadings $L$, the independent error $\epsilon$ is standard
normal or Student-t with 4 degrees of freedom. A lower bound states that its residual is
$r_i$ or more: its independent error enters with the survival function instead of the
density. The effects are integrated out: exactly for normal $\epsilon$, where the result
is $\ln N(r; 0, \mathrm{diag}(s^2) + L L^T)$, and otherwise by the variational Gaussian
approximation (Opper & Archambeau 2009, Neural Comput. 21:786). For any normal density
$q(v) = N(m, \Sigma)$

$$\ln p(r) \ge \sum_i E_q[\ln p(r_i | v)] - \tfrac{1}{2} m^T m
  - \tfrac{1}{2} \mathrm{tr} \Sigma + \tfrac{1}{2} \ln |\Sigma| + \tfrac{k}{2}.$$

Here $\Sigma = (I + L^T W L)^{-1}$ with $W$ the expected (Fisher) information of each
row about its mean, and $m$ maximises the bound. $\Sigma$ does not depend on $m$: the
bound has no poles, where Laplace's method has one wherever two modes of $v$ merge, and
where one maximum overtakes another it has a kink and no step. For 2 to 20 Student-t
rows that share one effect the bound is 0.001 to 0.01 below the exact integral, where
Laplace's method is off by up to 0.1.

With $u$ the independent error in standard deviations and $f$ its density, a reading
contributes $f(u)$, and a lower bound the survival function $S(u)$. For 4 degrees of
freedom, with $t/\sqrt{4 + t^2} = \sin\theta$, it is
$S = (1 - \sin\theta)^2 (2 + \sin\theta) / 4$, written so that neither tail loses
digits.

The mode of the effects needs $(I + L^T \mathrm{diag}(w) L)^{-1}$ and its determinant.
Effects of a shot load many rows. Effects of a path, and errors that the rows of one
record share, load the rows of that path alone, so their part of the matrix consists of
small blocks. These are eliminated first, each by itself, which leaves a system of the
effects of shots (the Schur complement). Ten records of four quantities share 30 errors
and have 20 effects of paths: ten systems of five and one of the shot's four, instead of
one of 54.
"""

from collections.abc import Sequence
from functools import partial
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax import lax
from jax.scipy.special import log_ndtr
from jaxtyping import Array, Bool, Float

from jblast.sensors.layout import picked
from jblast.sensors.path_scatter import solve_system
from jblast.sensors.simulated_readings import STUDENT_FREEDOM, Noise

ROUNDS = 100
"""Largest number of steps of one search. It needs a few; without convergence the
likelihood is NaN."""
SETTLED = 1e-5
"""Length of a step, in standard deviations, at which the search ends. The Newton steps
that are differentiated follow, and the first reduces the error to the square of
this."""
LEAST_DAMPING, DAMPING_FACTOR = 1e-3, 10.0
"""Smallest damping of a step, and factor of its changes (see `_step`). At the smallest,
steps are Newton's but for 1e-3 of the difference: the error falls by 1000 in each."""
NODES = 5
"""Gauss-Hermite nodes for the expectation over a row's error. Its standard deviation
under $q$ is at most 1.2 for readings: with 15 nodes the mass of `hri_2` changes by 5e-4
standard deviations."""
MANY_ROWS = 100
"""Rows per effect above which one node is used. The squares of those standard
deviations are then at most 0.014 on average (their sum times the information is below
the number of effects). 200,000 rows take 0.2 s instead of 0.8 s."""
MAX_BLOCK_EFFECTS = 16
"""Largest number of effects of a block (see `blocks_of`). Blocks are padded to the
largest, so one large block would make all of them large."""
Block = tuple[tuple[int, ...], tuple[int, ...]]
Blocks = tuple[Block, ...]
"""Rows and columns of each block. The effects of a block load its rows only, and no
other block loads them."""
SERIES_FROM = 10.0
"""Argument above which the series of Mills' ratio replaces `log_ndtr`: hazard minus
argument would cancel in the far tail."""
TERMS = 12
"""Terms of the series; at `SERIES_FROM` the remainder is 1e-13 of the sum."""


class Rows(NamedTuple):
    """Rows, and the uncertainty of their shared effects.

    Attributes:
        r: Residuals, in standard deviations.
        blur: Standard deviation under $q$ of the sum of effects in each row.
        noise: Distribution of the independent errors.
        lower_bound: True for lower bounds; None if none is.
        nodes: Number of Gauss-Hermite nodes.
    """

    r: Float[Array, " row"]
    blur: Float[Array, " row"]
    noise: Noise
    lower_bound: Bool[Array, " row"] | None
    nodes: int = NODES

    def log_density(self, added: Float[Array, " row"]) -> Float[Array, ""]:
        """Return the expectation of ln of the rows' probability.

        Args:
            added: Expected sum of the effects in each row.
        """
        one = jnp.ones_like(self.r)
        total = jnp.zeros((), self.r.dtype)
        for u, weight in self._at_nodes(added):
            total += weight * log_rows(u, one, self.noise, self.lower_bound)
        return total

    def slopes(self, added: Float[Array, " row"]) -> tuple[Array, Array, Array]:
        """Return first, second and `reweighted` derivative of minus the log density."""
        slope = curvature = sure = jnp.zeros_like(self.r)
        # summed node by node: XLA fuses the sum into one pass over the rows
        for u, weight in self._at_nodes(added):
            first, second = row_slopes(u, self.noise, self.lower_bound)
            slope, curvature = slope + weight * first, curvature + weight * second
            safe = reweighted(u, second, self.noise, self.lower_bound)
            sure = sure + weight * safe
        return slope, curvature, sure

    def _at_nodes(self, added):
        nodes, weights = np.polynomial.hermite_e.hermegauss(self.nodes)
        u = self.r - added
        return [
            (u + float(node) * self.blur, float(weight / weights.sum()))
            for node, weight in zip(nodes, weights, strict=True)
        ]


@partial(jax.jit, static_argnames=("noise", "blocks"))
def log_likelihood(
    residual: Float[Array, " row"],
    sd: Float[Array, " row"],
    loading: Float[Array, "row effect"],
    noise: Noise,
    lower_bound: Bool[Array, " row"] | None = None,
    blocks: Blocks = (),
) -> tuple[Float[Array, ""], Float[Array, " effect"]]:
    """Return ln of the probability of residuals, and the expected effects.

    The first is NaN if the search for the effects did not converge.

    Args:
        residual: Measured minus predicted $r$.
        sd: Independent scale of each row $s$.
        loading: Change of each row by one standard deviation of each effect $L$.
        noise: Distribution of the independent errors.
        lower_bound: True for readings that are lower bounds; None if none is.
        blocks: Effects of separate rows, for speed (see `Apart`).
    """
    r, load = residual / sd, loading / sd[:, None]
    if loading.shape[1] == 0:
        return log_rows(r, sd, noise, lower_bound), jnp.zeros(0)
    effects = effects_of(load, blocks)
    weight = _weights(r, load, noise, lower_bound)
    if noise == "gaussian" and lower_bound is None:
        v, log_determinant = effects.solved(weight, effects.gathered(r))
        rows = log_rows(r - effects.added(v), sd, noise, lower_bound)
        return rows - 0.5 * (v @ v + log_determinant), effects.in_order(v)
    rows, log_determinant = blurred(r, load, noise, lower_bound, blocks)
    still = effects_of(lax.stop_gradient(load), blocks)
    held = rows._replace(r=lax.stop_gradient(r), blur=lax.stop_gradient(rows.blur))
    v, damping, found = _expected(held, still)

    # The search is not differentiated: the steps after it carry the derivative of $m$,
    # which second derivatives of the likelihood need. One step leaves 1e-3 of it, which
    # is enough for long logs; two leave 1e-6.
    def onward(v, _):
        return v + _step(v, jnp.minimum(damping, 1.0), rows, effects)[0], None

    v, _ = lax.scan(onward, v, length=2 if rows.nodes > 1 else 1)
    # tr Sigma = k - sum of weight times squared blur, so no matrix of effects is formed
    bound = rows.log_density(effects.added(v)) - jnp.sum(jnp.log(sd)) - 0.5 * v @ v
    bound += 0.5 * (weight @ jnp.square(rows.blur) - log_determinant)
    if lower_bound is not None:  # a probability, not a density: it has no unit
        bound += jnp.sum(jnp.where(lower_bound, jnp.log(sd), 0.0))
    return jnp.where(found, bound, jnp.nan), effects.in_order(v)


def log_rows(
    u: Float[Array, " row"],
    sd: Float[Array, " row"],
    noise: Noise,
    lower_bound: Bool[Array, " row"] | None,
) -> Float[Array, ""]:
    """Return the sum of ln of the probabilities of independent rows.

    Args:
        u: Residuals in standard deviations.
        sd: Standard deviation of each row.
        noise: Distribution of the errors.
        lower_bound: True for lower bounds; None if none is.
    """
    read = log_noise(u, noise) - jnp.log(sd)
    if lower_bound is None:
        return jnp.sum(read)
    return jnp.sum(jnp.where(lower_bound, log_survival(u, noise), read))


def row_slopes(
    u: Float[Array, " row"], noise: Noise, lower_bound: Bool[Array, " row"] | None
) -> tuple[Array, ...]:
    """First and second derivative of minus ln of each row's probability."""
    read = noise_slopes(u, noise)
    if lower_bound is None:
        return read
    bound = survival_slopes(u, noise)
    return tuple(
        jnp.where(lower_bound, *pair) for pair in zip(bound, read, strict=True)
    )


def reweighted(
    u: Float[Array, " row"],
    curvature: Float[Array, " row"],
    noise: Noise,
    lower_bound: Bool[Array, " row"] | None,
) -> Float[Array, " row"]:
    """Return positive curvatures of minus ln of each row's probability.

    Steps with them always climb. Student-t readings are reweighted as normal ones
    (iteratively reweighted least squares). Bounds keep their curvature where it is
    positive.
    """
    weight = jnp.maximum(curvature, 0.0)
    if noise == "gaussian":
        return weight
    of_reading = (STUDENT_FREEDOM + 1) / (STUDENT_FREEDOM + jnp.square(u))
    if lower_bound is None:
        return of_reading
    return jnp.where(lower_bound, weight, of_reading)


def blurred(
    r: Float[Array, " row"],
    load: Float[Array, "row effect"],
    noise: Noise,
    lower_bound: Bool[Array, " row"] | None = None,
    blocks: Blocks = (),
) -> tuple[Rows, Float[Array, ""]]:
    r"""Return rows with their spread under $q$, and $-\ln |\Sigma|$.

    Args:
        r: Residuals, in standard deviations.
        load: Loadings, in standard deviations.
        noise: Distribution of the independent errors.
        lower_bound: True for lower bounds; None if none is.
        blocks: As for `log_likelihood`.
    """
    weight = _weights(r, load, noise, lower_bound)
    variance, log_determinant = effects_of(load, blocks).spread(weight)
    # Without any effect the variance is 0, and the root would have no slope: its
    # argument is replaced, not its result.
    some = variance > 0
    blur = jnp.where(some, jnp.sqrt(jnp.where(some, variance, 1.0)), 0.0)
    rows, effects = load.shape
    nodes = NODES if rows <= MANY_ROWS * effects else 1
    return Rows(r, blur, noise, lower_bound, nodes), log_determinant


def _weights(r, load, noise, lower_bound):
    """Return the information of each row about its mean, independent of the effects.

    For a lower bound it is evaluated at effects of zero with their prior spread. It
    vanishes if the bound is satisfied by far. Under normal errors the curvature is used
    instead: unlike the information it stays near 1 if a bound is violated by far.
    """
    weight = jnp.full_like(r, information_of_row(noise))
    if lower_bound is None:
        return weight
    about = r / jnp.sqrt(1 + jnp.sum(jnp.square(load), axis=1))
    if noise == "gaussian":
        return jnp.where(lower_bound, survival_slopes(about, noise)[1], weight)
    return jnp.where(lower_bound, survival_information(about, noise), weight)


def _expected(rows, effects):
    """Return the effects at the largest bound, the damping, and True if converged.

    Student-t readings that contradict the prior of an effect can give two maxima: the
    effect is large, or the readings are outliers. Searches from the solution for normal
    errors and from zero find both; the larger one is used.
    """
    read = jnp.ones_like(rows.r)
    if rows.lower_bound is not None:
        read = jnp.where(rows.lower_bound, 0.0, read)
    normal = effects.solved(read, effects.gathered(read * rows.r))[0]

    def end(start):
        v, height, damping, settled = _climbed(start, rows, effects)
        return v, damping, jnp.where(settled, height, -jnp.inf)

    # one after another, not under vmap: the search is compiled once, and the arrays of
    # long logs are in memory once
    starts = jnp.stack([normal, jnp.zeros_like(normal)])
    ends, damping, height = lax.map(end, starts)
    best = jnp.argmax(height)
    return ends[best], damping[best], height[best] > -jnp.inf


def _climbed(start, rows, effects):
    """Climb to a maximum; return place, height, damping and True if it was reached.

    A step that does not climb, or comes from a matrix that is not positive definite, is
    rejected and damped more.
    """

    def joint(v):
        return rows.log_density(effects.added(v)) - 0.5 * v @ v

    def again(state):
        rounds, v, height, damping, _ = state
        step, sure = _step(v, damping, rows, effects)
        there = joint(v + step)
        climbs = sure & (there > height)  # False for NaN
        # the undamped length: a damped step is short far from the maximum, too
        moved = jnp.max(jnp.abs(step)) * jnp.maximum(damping, 1.0)
        moved = jnp.where(sure, moved, jnp.inf)
        v = jnp.where(climbs, v + step, v)
        height = jnp.where(climbs, there, height)
        less = jnp.maximum(damping / DAMPING_FACTOR, LEAST_DAMPING)
        damping = jnp.where(climbs, less, damping * DAMPING_FACTOR)
        return rounds + 1, v, height, damping, moved

    def unsettled(state):
        rounds, v, _, _, moved = state
        # effects of 1e10 sd (an absurd start) cannot be resolved to SETTLED
        rounding = 8 * jnp.finfo(v.dtype).eps * jnp.max(jnp.abs(v))
        return (rounds < ROUNDS) & ~(moved <= SETTLED + rounding)  # NaN continues

    one, most = jnp.asarray(1.0, start.dtype), jnp.asarray(jnp.inf, start.dtype)
    begun = (0, start, joint(start), one, most)
    end = lax.while_loop(unsettled, again, begun)
    _, v, height, damping, _ = end
    return v, height, damping, ~unsettled((0, *end[1:]))


def _step(v, damping, rows, effects):
    """Return a step uphill, and True if its matrix was positive definite.

    With a damping of 1 the curvatures are `reweighted`, whose steps always climb. With
    less damping it is between that and Newton's step; with more it is shorter.
    """
    slope, curvature, safe = rows.slopes(effects.added(v))
    weight = curvature + jnp.minimum(damping, 1.0) * (safe - curvature)
    step, log_determinant = effects.solved(weight, effects.gathered(slope) - v)
    return step / jnp.maximum(damping, 1.0), jnp.isfinite(log_determinant)


class Together(NamedTuple):
    r"""Effects that may each load all rows.

    With more effects than rows, the smaller system of the rows is solved. With
    $K = L L^T$ and $W$ the weights, $(I + L^T W L)^{-1} = I - L^T W (I + K W)^{-1} L$
    and $|I + L^T W L| = |I + K W|$.

    Attributes:
        load: Change of each row by one standard deviation of each effect.
        covariance: $K$ if there are more effects than rows, else None.
    """

    load: Float[Array, "row effect"]
    covariance: Float[Array, "row row"] | None

    def added(self, v: Float[Array, " effect"]) -> Float[Array, " row"]:
        """Return the sum of effects in each row, $L v$."""
        return self.load @ v

    def gathered(self, of_row: Float[Array, " row"]) -> Float[Array, " effect"]:
        """Return $L^T x$."""
        return self.load.T @ of_row

    def solved(self, weight: Float[Array, " row"], right: Float[Array, " effect"]):
        """Solve $(I + L^T W L) x = b$, and return ln of the determinant.

        It is NaN if the matrix is not positive definite, and by rows also for some
        positive definite matrices with negative weights.
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
    """Effects of which some load all rows, and others the rows of one record only.

    The internal order of the effects is: common ones, then those of each record. Every
    record has equally many; padding effects load nothing and stay zero.

    Attributes:
        load: Loadings of the common effects.
        of_record: Loadings of the effects of records.
        record: Row numbers of `of_record`; the number of rows for padding.
        place: Internal position of each column.
    """

    load: Float[Array, "row effect"]
    of_record: Float[Array, "record row_of_record error"]
    record: np.ndarray
    place: np.ndarray

    def added(self, v: Float[Array, " held"]) -> Float[Array, " row"]:
        """Return the sum of effects in each row, $L v$."""
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
        """Eliminate the effects of records (Schur complement).

        Args:
            weight: Weight of each row.
            right: Right sides of each record's system.

        Returns:
            The coupling of common effects and those of records, the solutions for the
            coupling and for `right`, the remaining system of the common effects, and ln
            of the determinant of the eliminated blocks.
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
        """Return the common effects, and those of each record."""
        count, (records, _, errors) = self.load.shape[1], self.of_record.shape
        return v[:count], v[count:].reshape(records, errors)

    def _in_turn(self) -> bool:
        """Return True if rows are ordered by record, equally many each.

        A reshape then replaces gather and scatter, which is cheaper.
        """
        rows = np.arange(len(self.load))
        return self.record.size == rows.size and bool(
            (self.record.ravel() == rows).all()
        )

    def _by_row(self, of_records):
        """Return values of records by row; zero for rows without a record."""
        flat = of_records.reshape(self.record.size, *of_records.shape[2:])
        if self._in_turn():
            return flat
        place = np.full(len(self.load) + 1, len(flat))
        place[self.record.ravel()] = np.arange(len(flat))
        nothing = jnp.zeros((1, *flat.shape[1:]), flat.dtype)
        return jnp.concatenate([flat, nothing])[place[:-1]]

    def _by_record(self, of_row):
        """Return values of rows by record; zero for padding."""
        if self._in_turn():
            return of_row.reshape(*self.record.shape, *of_row.shape[1:])
        nothing = jnp.zeros((1, *of_row.shape[1:]), of_row.dtype)
        return jnp.concatenate([of_row, nothing])[self.record]


def effects_of(load: Float[Array, "row effect"], blocks: Blocks) -> Together | Apart:
    """Return effects in the form with the fastest solution."""
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
    """Return the blocks of effects with separate rows; () if a block is large.

    Args:
        loading: Change of each row by one standard deviation of each effect.
    """
    return joined_blocks(
        [
            (tuple(np.flatnonzero(loaded).tolist()), (column,))
            for column, loaded in enumerate(loading.T)
        ]
    )


def joined_blocks(parts: Sequence[Block]) -> Blocks:
    """Merge blocks that share rows; () if one then has many effects.

    Args:
        parts: Rows and columns of each block; each column is in one of them.
    """
    first: dict[int, int] = {}
    joined = list(range(len(parts)))

    # union-find with path compression: nearly linear in the number of rows
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
    if any(len(columns) > MAX_BLOCK_EFFECTS for _, columns in blocks.values()):
        return ()
    return tuple((tuple(sorted(r)), tuple(sorted(c))) for r, c in blocks.values())


def _padded(lists: list[tuple[int, ...]], missing: int) -> np.ndarray:
    """Return lists as rows of one array, padded with `missing`."""
    most = max(len(entries) for entries in lists)
    return np.array(
        [[*entries, *[missing] * (most - len(entries))] for entries in lists]
    )


def log_noise(u: Float[Array, "..."], noise: Noise) -> Float[Array, "..."]:
    """Return ln of the density of a standardised independent error."""
    if noise == "gaussian":
        return -0.5 * jnp.square(u) - 0.5 * jnp.log(2 * jnp.pi)
    nu = STUDENT_FREEDOM
    # Gamma((nu + 1)/2) / (Gamma(nu/2) sqrt(nu pi)) is 3/8 for nu = 4
    return jnp.log(0.375) - 0.5 * (nu + 1) * jnp.log1p(jnp.square(u) / nu)


def noise_slopes(u: Float[Array, "..."], noise: Noise) -> tuple[Array, Array]:
    """Return the first and second derivative of minus `log_noise`."""
    if noise == "gaussian":
        return u, jnp.ones_like(u)
    nu = STUDENT_FREEDOM
    heavy = nu + jnp.square(u)
    return (nu + 1) * u / heavy, (nu + 1) * (nu - jnp.square(u)) / jnp.square(heavy)


def information_of_row(noise: Noise) -> float:
    r"""Return the information of one standardised error about its mean.

    1 for a normal error, $(\nu + 1)/(\nu + 3)$ for Student-t (Lange, Little & Taylor
    1989, J. Am. Stat. Assoc. 84:881, appendix B, with one dimension).
    """
    nu = STUDENT_FREEDOM
    return 1.0 if noise == "gaussian" else (nu + 1) / (nu + 3)


def log_survival(u: Float[Array, "..."], noise: Noise) -> Float[Array, "..."]:
    """Return ln of the probability of a standardised error of $u$ or more."""
    if noise == "gaussian":
        is_far, near, far = _split(u)
        less = _mills_series(far)
        tail = log_noise(far, noise) - jnp.log(far) + jnp.log1p(-less)
        return jnp.where(is_far, tail, log_ndtr(-near))
    cosine, sine, above = _angle(u)
    is_right = u > 0
    size = 4 * jnp.log(cosine) - 2 * jnp.log(jnp.where(is_right, above, 1.0))
    below = jnp.where(is_right, 0.0, jnp.square(above) * (2 - sine) / 4)
    return jnp.where(is_right, size + jnp.log((2 + sine) / 4), jnp.log1p(-below))


def survival_slopes(u: Float[Array, "..."], noise: Noise) -> tuple[Array, Array]:
    r"""Return the first and second derivative of minus `log_survival`.

    The first is the hazard $\lambda = f/S$, the second $\lambda(\lambda - \psi)$ with
    $\psi = -f'/f$, which for Student-t is negative above 1.6.
    """
    if noise == "gaussian":
        is_far, near, far = _split(u)
        less = _mills_series(far)
        rate = jnp.exp(log_noise(near, noise) - log_ndtr(-near))
        hazard = jnp.where(is_far, far / (1 - less), rate)
        excess = jnp.where(is_far, far * less / (1 - less), rate - near)
        return hazard, hazard * excess
    cosine, sine, above = _angle(u)
    hazard = 1.5 * cosine * jnp.square(above) / (2 + sine)
    return hazard, hazard * (hazard - noise_slopes(u, noise)[0])


def survival_information(u: Float[Array, "..."], noise: Noise) -> Float[Array, "..."]:
    r"""Return the information of a lower bound about its mean: $f^2/(S(1-S))$.

    It is the information of the binary outcome, averaged over both outcomes, and never
    negative.
    """
    both = log_survival(u, noise) + log_survival(-u, noise)
    return jnp.exp(2 * log_noise(u, noise) - both)


def _angle(u):
    """Return cosine and sine of the angle whose tangent is u/2, and 1 + the sine."""
    is_wide = jnp.abs(u) > 2  # whose squares may overflow
    wide, slim = jnp.where(is_wide, u, 2.0), jnp.where(is_wide, 2.0, u)
    long = jnp.abs(wide) * jnp.sqrt(1 + jnp.square(2 / wide))
    length = jnp.where(is_wide, long, jnp.sqrt(4 + jnp.square(slim)))
    cosine, sine = 2 / length, u / length
    left = jnp.where(u > 0, 0.0, sine)
    # for u < 0, 1 + sin = cos^2 / (1 - sin): the sum would cancel
    above = jnp.where(u > 0, 1 + sine, jnp.square(cosine) / (1 - left))
    return cosine, sine, above


def _split(u):
    """Return the mask of u in the far tail, u below it, and u in it.

    Elsewhere the values are harmless: both branches of a `where` are differentiated.
    """
    is_far = u > SERIES_FROM
    return is_far, jnp.where(is_far, 0.0, u), jnp.where(is_far, u, SERIES_FROM)


def _mills_series(u):
    """Return $1 - u S(u)/f(u)$ of a normal in its far tail, by its series."""
    t = 1 / jnp.square(u)
    less = jnp.zeros_like(u)
    # nested (Horner) from the last term: 1/u^2 - 3/u^4 + 15/u^6 - ...
    for odd in range(2 * TERMS - 1, 0, -2):
        less = odd * t * (1 - less)
    return less
