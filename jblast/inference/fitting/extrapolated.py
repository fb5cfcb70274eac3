"""Which numbers of an answer rest on recordings outside the range of their laws."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float

from jblast.inference.fitting.solution import Solution
from jblast.inference.fitting.unidentified import requested
from jblast.inference.mode.starts import typical_step
from jblast.inference.posterior.fisher_information import (
    NULL,
    unit_diagonal,
    whitened_rows,
)

MOST_OUTSIDE = 0.5
"""Share of the information about a number that may come from rows outside their laws.

Above one half, extrapolation decides: rows inside their laws would be outvoted. A few
uninformative rows inside their range (ground motion beside the sound of a deep charge)
do not make such an answer valid, and a few uninformative rows outside do not spoil one.
"""


def extrapolated(
    solution: Solution, valid: Bool[np.ndarray, " row"]
) -> tuple[str, ...]:
    r"""Return the requested numbers that rest on rows outside the range of their laws.

    Of a number with variance $1/I$, all other numbers fitted too, the share of the
    information that rows outside hold is $1 - I_{in}/I$. $I_{in}$ is of the rows
    inside and of the priors alone. Numbers that nothing identifies are not named.

    Args:
        solution: Result of the inference.
        valid: Whether the law of each row holds at the answer.
    """
    if valid.all():
        return ()
    everything = _information(solution, jnp.ones(len(valid), bool))
    inside = _information(solution, jnp.asarray(valid))
    names = solution.posterior.parameters.names
    asked = requested(names)
    return tuple(
        name
        for name, is_determined, all_rows, some in zip(
            names,
            solution.identifiability.determined,
            everything,
            inside,
            strict=True,
        )
        if name in asked and is_determined and some < (1 - MOST_OUTSIDE) * all_rows
    )


def _information(
    solution: Solution, used: Bool[Array, " row"]
) -> Float[np.ndarray, " free"]:
    """Return one over the variance of each number, of some rows and the priors."""
    posterior, z = solution.posterior, jnp.asarray(solution.laplace.z)
    misfit = posterior.misfit(z)
    misfit = eqx.tree_at(lambda m: m.sd, misfit, jnp.where(used, misfit.sd, jnp.inf))
    slopes = -jax.jacfwd(lambda z: posterior.misfit(z).residual)(z)
    rows = whitened_rows(posterior, misfit, slopes)
    rows = jnp.concatenate([rows, jnp.diag(posterior.parameters.has_prior())])
    matrix = rows.T @ rows
    if not bool(jnp.isfinite(matrix).all()):
        return np.full(len(z), np.nan)
    size, values, vectors = map(
        np.asarray, unit_diagonal(matrix, jnp.asarray(typical_step(posterior)))
    )
    variance = (vectors**2 / np.maximum(values, NULL)).sum(axis=1) / size**2
    return 1 / variance
