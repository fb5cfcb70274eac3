"""What the data cannot tell: null directions, and the combinations that are told."""

from dataclasses import dataclass

import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from jblast.inference.fisher import (
    NULL,
    information,
    unit_diagonal,
    whitened,
    whitened_jacobian,
)
from jblast.inference.posterior import Posterior
from jblast.inference.starts import scales

STEP = 0.1
"""How far a null direction is followed to confirm it, in typical steps."""
UNSEEN = 1e-4
"""Data that move by less than this many standard deviations along it have not moved."""


@dataclass(frozen=True)
class Identifiability:
    """How the data divide the space of the parameters.

    Attributes:
        null: One row for each direction along which no datum moves, in coordinates.
        told: Basis of the rest, one column each.
        determined: Whether each parameter is out of every null direction.
    """

    null: Float[np.ndarray, "null free"]
    told: Float[np.ndarray, "free told"]
    determined: tuple[bool, ...]


def identifiability(
    posterior: Posterior, z: Float[np.ndarray, " free"]
) -> Identifiability:
    """Find the null directions at a place, and confirm each by moving along it."""
    size, values, vectors = map(
        np.asarray, unit_diagonal(information(posterior, jnp.asarray(z)))
    )
    is_null = np.array(
        [
            value < NULL and _confirmed(posterior, z, vector / size, size)
            for value, vector in zip(values, vectors.T, strict=True)
        ],
        dtype=bool,
    )
    hidden = vectors[:, is_null]
    return Identifiability(
        null=echelon(hidden.T / size) if is_null.any() else np.zeros((0, z.size)),
        told=vectors[:, ~is_null] / size[:, None],
        determined=tuple(bool((np.abs(row) < 1e-4).all()) for row in hidden),
    )


def _confirmed(posterior, z, direction, size) -> bool:
    """Follow a direction for a finite step, on its curve, and see if data move.

    A derivative can vanish by symmetry alone (a charge on the line of its sensors);
    then a finite step is seen. A true invariance may be curved (a charge on a circle
    about its one sensor), so after the step the told directions are adjusted.
    """
    step = STEP * direction / np.max(np.abs(direction) / np.asarray(scales(posterior)))
    started = _whitened_prediction(posterior, z, z)
    there = z + step
    for _ in range(10):
        miss = _whitened_prediction(posterior, there, z) - started
        if np.linalg.norm(miss) < UNSEEN:
            return True
        jacobian = np.asarray(whitened_jacobian(posterior, jnp.asarray(there)))
        there = there - np.linalg.pinv(jacobian / size, rcond=1e-6) @ miss / size
    return False


def _whitened_prediction(posterior, z, where):
    """Predictions and prior terms at z, in the standard deviations of elsewhere."""
    at, here = posterior.misfit(jnp.asarray(where)), posterior.misfit(jnp.asarray(z))
    data = whitened(posterior, at, -here.residual[:, None])[:, 0]
    return np.concatenate([data, posterior.parameters.has_prior() * z])


def echelon(rows: Float[np.ndarray, "row free"]) -> Float[np.ndarray, "row free"]:
    """Reduce rows so that each leads with a 1 no other row has: the shortest names.

    Exact to rounding; entries below 1e-9 of their row's largest become zero.
    """
    rows = np.array(rows, float)
    lead = 0
    for column in range(rows.shape[1]):
        if lead == len(rows):
            break
        left = np.abs(rows[lead:, column])
        norms = np.abs(rows[lead:]).max(axis=1)
        best = lead + int(np.argmax(left / np.where(norms > 0, norms, 1)))
        if np.abs(rows[best, column]) <= 1e-7 * np.abs(rows[best]).max():
            continue
        rows[[lead, best]] = rows[[best, lead]]
        rows[lead] /= rows[lead, column]
        for other in range(len(rows)):
            if other != lead:
                rows[other] -= rows[other, column] * rows[lead]
        lead += 1
    rows[np.abs(rows) < 1e-9 * np.abs(rows).max(axis=1, keepdims=True)] = 0.0
    return rows


def told_combinations(found: Identifiability) -> Float[np.ndarray, "told free"]:
    """Return the combinations of undetermined parameters that the data do tell.

    Each row is a linear form in the coordinates that vanishes along every null
    direction; parameters determined by themselves take no part.
    """
    shy = [i for i, determined in enumerate(found.determined) if not determined]
    if not shy:
        return np.zeros((0, len(found.determined)))
    # The forms on the shy parameters that vanish on the null directions; led by the
    # last parameter, so that speeds and times are told in terms of the mass.
    null = found.null[:, shy]
    _, singular, vh = np.linalg.svd(null)
    forms = vh[np.sum(singular > 1e-9 * singular.max()) :]
    told = np.zeros((len(forms), len(found.determined)))
    if len(forms):
        told[:, shy] = echelon(forms[:, ::-1])[:, ::-1]
    return told
