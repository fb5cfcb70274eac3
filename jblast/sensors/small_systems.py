"""Linear systems of some tens of unknowns, solved without LAPACK.

XLA on CPUs gives a batch of LAPACK calls to the pool of threads that already runs the
program, and waits there for it. Where two such calls meet, in one program or in two,
all threads of a machine with two cores wait for each other and the program never ends.
The elimination here is a loop of operations on whole matrices.
"""

import jax
import jax.numpy as jnp
from jax import lax
from jaxtyping import Array, Float


@jax.custom_jvp
def solve_system(
    matrix: Float[Array, "n n"], right: Float[Array, "n m"]
) -> tuple[Float[Array, "n m"], Float[Array, ""]]:
    """Solve, and return ln of the determinant, by Gauss-Jordan elimination.

    Without pivoting: for matrices that are positive definite, or triangular with a
    positive diagonal. Of others that are not positive definite ln of the determinant is
    NaN.

    Args:
        matrix: The system.
        right: Right sides, one a column.
    """
    return _eliminated(matrix, right)


@solve_system.defjvp
def _solve_system_jvp(primals, tangents):
    # the loop would keep a matrix for each unknown
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
        pivot = both[i, i]
        row = both[i] / pivot
        column = both[:, i] - jnp.where(jnp.arange(count) == i, 1.0, 0.0)
        return both - column[:, None] * row[None, :], size + jnp.log(pivot)

    both = jnp.concatenate([matrix, right], axis=1)
    both, size = lax.fori_loop(0, count, step, (both, jnp.zeros((), both.dtype)))
    return both[:, count:], size


def cholesky_factor(matrix: Float[Array, "n n"]) -> Float[Array, "n n"]:
    """Return the lower factor of a matrix; NaN where it is not positive definite."""
    count = len(matrix)
    rows = jnp.arange(count)

    def step(i, state):
        left, root = state
        column = jnp.where(rows >= i, left[:, i] / jnp.sqrt(left[i, i]), 0.0)
        root = jnp.where(rows[None, :] == i, column[:, None], root)
        return left - column[:, None] * column[None, :], root

    return lax.fori_loop(0, count, step, (matrix, jnp.zeros_like(matrix)))[1]
