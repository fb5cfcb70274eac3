r"""Correlation of the scatter of neighbouring paths.

Two paths from one charge that nearly coincide cross the same air, so they depart from
a law by nearly the same amount. The scatter of path $i$, in standard deviations, is a
Gaussian field over paths with covariance $K_{ij} = \rho(d_{ij})$. The separation
$d_{ij} = |y_i - y_j|$ is that of $y = (\ln R, e)$, with the slant range $R$ and the
unit direction $e$ from the charge. For neighbours it is their distance over the range.

$$\rho(d) = (1 - f)\,e^{-(d/k_1)^2} + f\,e^{-(d/k_2)^\alpha}.$$

The second term is due to turbulence. The phase structure function of a spherical wave
behind turbulence of the inertial range grows with the separation to the power
$\alpha = 5/3$ (Tatarskii 1971, The Effects of the Turbulent Atmosphere on Wave
Propagation; Ostashev & Wilson 2015, Acoustics in Moving Inhomogeneous Media, chapter
on line-of-sight propagation). The first is due to wind and temperature that differ from
those of the scene along the whole path, and so change slowly with direction.

Their amounts vary from site to site and from day to day. With $\alpha = 5/3$ and a
scatter of 1 %, the bearing of an array of width $D$ has an sd of about
$0.014\,(D/k_2R)^{5/6} R/D$: 3.7 degrees at $D/R$ = 0.01 with $k_2$ = 0.4. Infrasound
arrays of 1 to 4 km lose coherence as for angular widths of 0.4 to 7 degrees, and the
back azimuths of Humming Roadrunner 5 at eight arrays 230 to 470 km away
(`calibration/data/hrr5_infrapy_detections.csv`) are 3.6 degrees (rms) off the true
ones. No single kernel spans this range, so the kernel is unknown as well: the
likelihood of a log is the mean over all `KERNELS`, and the data weigh them. All nearly
vanish for neighbours 45 degrees apart, as in a layout around the charge.

The covariance of $n$ paths is split, $K = \mathrm{diag}(\psi) + B B^T$, so that the
part of each path alone ($\psi$) keeps the distribution of independent errors. With
$Q = K^{-1}$ the rest is positive semidefinite for $\psi_i = 1/\sum_j |Q_{ij}|$, since
$\mathrm{diag}(1/\psi) - Q$ is then diagonally dominant. For an isolated path $\psi$
is 1, for two paths $1 - \rho$, the largest possible. For more than `DENSE` paths $B$
is the part that `ANCHORS` of them share with all (a Nystrom approximation), so that
the cost grows in proportion to the number of paths.

The linear systems of some tens of unknowns are solved without LAPACK. XLA on CPUs
passes a batch of LAPACK calls to the thread pool that already runs the program, and
waits for it there. If two such calls meet, in one program or in two, all threads of a
machine with two cores wait for each other and the program never ends: so do LU and
triangular solves of jaxlib 0.10.2, and with them the derivative of a Cholesky factor.
The elimination here is a loop of operations on whole matrices.
"""

from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jax import lax
from jaxtyping import Array, Bool, Float

from jblast.types import namespace

KERNELS = np.array(
    [
        # f, k1, k2, alpha
        (1.0, 1.0, 0.1, 1.0),
        (1.0, 1.0, 0.15, 5 / 3),
        (1.0, 1.0, 0.4, 5 / 3),
        (0.1, 0.2, 0.2, 5 / 3),
    ]
)
"""Rows of $(f, k_1, k_2, \\alpha)$, from the roughest to the smoothest, equally
probable.

The third is inertial-range turbulence that decorrelates within the 45 degrees between
neighbours of an ordinary layout; the second has a shorter outer scale. The first
represents roughness at small separations, as from ground and obstacles. In the fourth a
tenth of the variance is turbulence: 0.3 % of the travel time for a law with 1 %, as for
index fluctuations of 0.5 % with eddies of L = 50 m over R = 300 m, which leave the
share sqrt(sqrt(pi) L/R) along the path. Least squares of a known mass, linearised, of
250 random layouts with errors of seven other correlation functions (exponential, von
Karman, Gaussian; lengths of 0.1 to 0.8): 90 % intervals of the bearing contain the
truth in 86 to 96 % with these four, in 33 to 98 % with the third alone. Fits with a
free mass do not reach that (`calibration/results/array_coverage.txt`)."""
TYPICAL = np.array([0.0, 0.0, 1.0, 0.0])
"""Weights of the kernels if no data weigh them, as for a planned layout."""
DENSE = 32
"""Largest number of paths whose covariance is split exactly, at a cost proportional to
the cube of their number."""
MAX_PATHS = 1000
"""Logs with more paths treat them as independent: columns of shared effects for a
million rows would multiply the time of a fit."""
ANCHORS = 16
"""Paths that represent the shared part of a longer log: half of `DENSE`, at a cost
proportional to their number."""
FEW_NEIGHBOURS = 0.05
"""Sum of correlations with other paths at which an anchor shares half of its variance;
an isolated one shares nothing, one in a cluster nearly all."""
NEAR_ZERO = 1e-4
"""Correlation below which its absolute value is smoothed, to have a derivative."""
ROOT_GUARD = 1e-16
"""Added to a squared separation, so that the derivative of its root is finite at 0."""


def embedded(
    toward: Float[Array, "path 3"], slant_range: Float[Array, " path"]
) -> tuple[Float[Array, "path 4"], Bool[Array, " path"]]:
    """Return log-polar coordinates of paths, and the mask of those with a direction.

    Args:
        toward: Vector from the sensor to the charge [m]; zero for a range only.
        slant_range: Distance [m].
    """
    squared = jnp.sum(jnp.square(toward), axis=1)
    placed = (squared > 0) & (slant_range > 0)
    length = jnp.sqrt(jnp.where(placed, squared, 1.0))
    log_range = jnp.log(jnp.where(placed, slant_range, 1.0))
    # paths without direction get a dummy point and are masked by `placed`
    unit = jnp.where(placed[:, None], toward / length[:, None], 0.0)
    return jnp.concatenate([log_range[:, None], unit], axis=1), placed


def correlations(
    one: Float[Array, "path 4"],
    other: Float[Array, "mate 4"],
    weights: Float[Array, " kernel"],
) -> Float[Array, "path mate"]:
    """Return the weighted mean of the kernels between all pairs of paths."""
    apart = sum(
        jnp.square(one[:, i, None] - other[None, :, i]) for i in range(one.shape[1])
    )
    return correlation(jnp.asarray(apart) + ROOT_GUARD, weights)


def correlation(
    squared: Float[Any, "*shape"], weights: Float[Any, " kernel"]
) -> Float[Any, "*shape"]:
    r"""Return $\rho(d)$, the weighted mean of the kernels; NumPy or JAX.

    Args:
        squared: Square of the separation $d$ of two paths; for neighbours of distance
            over range.
        weights: Weights of the kernels; their sum is 1.
    """
    xp = namespace(squared, weights)
    found = xp.zeros_like(squared)
    for weight, (f, smooth, rough, power) in zip(weights, KERNELS, strict=True):
        # the separation is squared, hence half the power
        part = f * xp.exp(-((squared / rough**2) ** (power / 2)))
        if f < 1:
            part = part + (1 - f) * xp.exp(-squared / smooth**2)
        found = found + weight * part
    return found


def split(
    place: Float[Array, "path 4"],
    placed: Bool[Array, " path"],
    weights: Float[Array, " kernel"],
) -> tuple[Float[Array, " path"], Float[Array, "path column"]]:
    r"""Return the individual and the shared parts of the scatter of paths.

    Args:
        place: Coordinates from `embedded`.
        placed: Mask of paths with a direction; the others are independent.
        weights: Weights of the kernels; their sum is 1.

    Returns:
        Individual variance $\psi$ of each path, and contribution of one standard
        deviation of each shared effect ($B$), for a total variance of 1.
    """
    if len(place) > DENSE:
        return _split_by_anchors(place, placed, weights)
    unit = jnp.eye(len(place), dtype=place.dtype)
    matrix = _among(place, placed, weights)
    precision, _ = solve_system(matrix, unit)
    size = jnp.diagonal(precision)
    # smoothed |Q|: the exact absolute value has no derivative at 0
    least = NEAR_ZERO**2 * size[:, None] * size[None, :]
    absolute = jnp.sqrt(jnp.square(precision) + least)
    row_sum = jnp.sum(jnp.where(unit > 0, 0.0, absolute), axis=1)
    # bound of diagonal dominance (module docstring)
    own = 1 / (size + row_sum)
    return own, cholesky_columns(matrix - jnp.diag(own) + _nugget(place) * unit)


def _split_by_anchors(place, placed, weights):
    """Return the parts of many paths, shared through some of them as anchors."""
    # Anchors are evenly spread over the rows of a log.
    anchors = np.linspace(0, len(place) - 1, ANCHORS).astype(int)
    at, is_placed = place[anchors], placed[anchors]
    among = placed[:, None] & is_placed[None, :]
    across = jnp.where(among, correlations(place, at, weights), 0.0)
    inner = _among(at, is_placed, weights)
    columns = cholesky_columns(jnp.concatenate([inner, across]))[ANCHORS:]
    # without the anchor's correlation with itself
    neighbours = jnp.maximum(jnp.sum(across, axis=0) - 1, 0.0)
    share = neighbours / (neighbours + FEW_NEIGHBOURS)
    columns = columns * jnp.sqrt(share + _nugget(place))[None, :]
    own = 1 - jnp.sum(jnp.square(columns), axis=1)
    # rounding may leave a variance just below 0
    return jnp.maximum(own, _nugget(place)), columns


def _among(place, placed, weights):
    """Return the correlations among paths; those without a direction have none."""
    unit = jnp.eye(len(place), dtype=place.dtype)
    both = placed[:, None] & placed[None, :] & (unit == 0)
    matrix = jnp.where(both, correlations(place, place, weights), 0.0)
    return matrix + (1 + _nugget(place)) * unit


def _nugget(place):
    """Return the variance that keeps the matrix of duplicate paths invertible."""
    return jnp.sqrt(jnp.finfo(place.dtype).eps)


@jax.custom_jvp
def solve_system(
    matrix: Float[Array, "n n"], right: Float[Array, "n m"]
) -> tuple[Float[Array, "n m"], Float[Array, ""]]:
    """Return the solution and ln of the determinant, by Gauss-Jordan elimination.

    Without pivoting: for matrices that are positive definite, or triangular with a
    positive diagonal. For others that are not positive definite, ln of the determinant
    is NaN.

    Args:
        matrix: The system.
        right: Right-hand sides, one per column.
    """
    return _eliminated(matrix, right)


@solve_system.defjvp
def _solve_system_jvp(primals, tangents):
    # differentiating the loop would store a matrix for each unknown
    matrix, right = primals
    d_matrix, d_right = tangents
    count, wide = right.shape
    unit = jnp.eye(count, dtype=right.dtype)
    solved, size = _eliminated(matrix, jnp.concatenate([right, unit], axis=1))
    answer, inverse = solved[:, :wide], solved[:, wide:]
    change = inverse @ (d_right - d_matrix @ answer)
    return (answer, size), (change, jnp.sum(inverse.T * d_matrix))


def _eliminated(matrix, right):
    count = len(matrix)
    if count == 0:
        return right, jnp.zeros((), right.dtype)

    def step(i, state):
        both, size = state
        # positive for these matrices, so no pivoting is needed
        pivot = both[i, i]
        row = both[i] / pivot
        column = both[:, i] - jnp.where(jnp.arange(count) == i, 1.0, 0.0)
        return both - column[:, None] * row[None, :], size + jnp.log(pivot)

    both = jnp.concatenate([matrix, right], axis=1)
    both, size = lax.fori_loop(0, count, step, (both, jnp.zeros((), both.dtype)))
    return both[:, count:], size


def cholesky_columns(matrix: Float[Array, "row n"]) -> Float[Array, "row n"]:
    r"""Return the Cholesky factor $L$ of the first n rows, and $a L^{-T}$ of others.

    NaN where the first rows are not positive definite.

    Args:
        matrix: A symmetric matrix, and further rows $a$ below it.
    """
    rows = jnp.arange(len(matrix))
    count = matrix.shape[1]

    def step(i, state):
        left, root = state
        column = jnp.where(rows >= i, left[:, i] / jnp.sqrt(left[i, i]), 0.0)
        root = jnp.where(rows[None, :count] == i, column[:, None], root)
        return left - column[:, None] * column[None, :count], root

    return lax.fori_loop(0, count, step, (matrix, jnp.zeros_like(matrix)))[1]
