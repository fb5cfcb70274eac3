"""What the data cannot tell: null directions, and the combinations that are told."""

from dataclasses import dataclass

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from jblast.inference.mode.starts import typical_step
from jblast.inference.posterior.fisher_information import (
    NULL,
    information,
    unit_diagonal,
    whitened_jacobian,
    whitened_rows,
)
from jblast.inference.posterior.posterior import Posterior

STEP = 1.0
"""How far a null direction is followed to confirm it, in typical steps."""
NULL_TOLERANCE = 1e-4
"""Data that move by less than this many standard deviations along it have not moved."""
ROUNDS = 20
"""Steps back onto the curve of a null direction, at most."""
HALVINGS = 12
"""Such a step is halved so often before it is given up: it must bring data nearer."""


ROUNDING = 1e-5
"""A part of a direction smaller than this, in standard deviations, is rounding."""


@dataclass(frozen=True)
class Identifiability:
    """How the data divide the space of the parameters.

    Attributes:
        null: One row for each direction along which no datum moves, in coordinates.
        identified_basis: Basis of the rest, one column each.
        determined: Whether each parameter is out of every null direction.
        followed: Where following each null direction for a finite step led.
    """

    null: Float[np.ndarray, "null free"]
    identified_basis: Float[np.ndarray, "free identified"]
    determined: tuple[bool, ...]
    followed: Float[np.ndarray, "null free"]


def identifiability(
    posterior: Posterior, z: Float[np.ndarray, " free"]
) -> Identifiability:
    """Find the null directions at a place, and confirm each by moving along it.

    A number with a prior is known, however little beside what the data know; so its
    information counts as no less than the data's.
    """
    scale = typical_step(posterior)
    known = np.asarray(information(posterior, jax.device_put(z)))
    prior = np.diag(np.asarray(posterior.parameters.has_prior()) * np.diag(known))
    size, values, vectors = map(
        np.asarray, unit_diagonal(jax.device_put(known + prior), scale)
    )
    followed = [
        _followed(posterior, z, vector / size, size) if value < NULL else None
        for value, vector in zip(values, vectors.T, strict=True)
    ]
    data = len(posterior.measured) + int(np.sum(posterior.parameters.has_prior()))
    for k in range(z.size - data):  # fewer data than unknowns, whatever was found
        followed[k] = z if followed[k] is None else followed[k]
    is_null = np.array([there is not None for there in followed], dtype=bool)
    null = echelon(vectors[:, is_null].T)
    return Identifiability(
        null=_led_by_one(null / size),
        identified_basis=vectors[:, ~is_null] / size[:, None],
        determined=tuple(bool((column == 0).all()) for column in null.T),
        followed=np.array([t for t in followed if t is not None]).reshape(null.shape),
    )


def _followed(posterior, z, direction, size) -> np.ndarray | None:
    """Follow a direction for a finite step, on its curve; None if data move.

    A derivative can vanish by symmetry alone (a charge at the height of its sensors);
    then a finite step is seen. A true invariance may be curved (a charge on a circle
    about its one sensor), so after the step the told directions are adjusted.
    """
    step = (
        STEP
        * direction
        / np.max(np.abs(direction) / np.asarray(typical_step(posterior)))
    )
    started = _whitened_prediction(posterior, z, z)
    there = z + step
    miss = _whitened_prediction(posterior, there, z) - started
    for _ in range(ROUNDS):
        if np.linalg.norm(miss) < NULL_TOLERANCE:
            away = np.linalg.norm((there - z) * size)
            return there if away > 0.5 * np.linalg.norm(step * size) else None
        jacobian = np.asarray(whitened_jacobian(posterior, jnp.asarray(there)))
        if not (np.isfinite(jacobian).all() and np.isfinite(miss).all()):
            return None
        back = -np.linalg.pinv(jacobian / size, rcond=1e-6) @ miss / size
        for part in 0.5 ** np.arange(HALVINGS):  # whole steps run away off a cone
            nearer = _whitened_prediction(posterior, there + part * back, z) - started
            with np.errstate(over="ignore"):  # beyond all reach is no nearer
                is_nearer = np.linalg.norm(nearer) < np.linalg.norm(miss)
            if is_nearer:
                there, miss = there + part * back, nearer
                break
        else:
            return None
    return None


def _whitened_prediction(posterior, z, where):
    """Predictions and prior terms at z, in the standard deviations of elsewhere."""
    at, here = posterior.misfit(jnp.asarray(where)), posterior.misfit(jnp.asarray(z))
    data = whitened_rows(posterior, at, -here.residual[:, None])[:, 0]
    return np.concatenate([data, posterior.parameters.has_prior() * z])


def echelon(rows: Float[np.ndarray, "row free"]) -> Float[np.ndarray, "row free"]:
    """Combine rows so that each leads with a 1 no other row has: the shortest names.

    Rows are of length about 1; what is left of an entry by rounding becomes zero.
    """
    rows = np.array(rows, float)
    lead = 0
    for column in range(rows.shape[1]):
        if lead == len(rows):
            break
        best = lead + int(np.argmax(np.abs(rows[lead:, column])))
        if np.abs(rows[best, column]) <= ROUNDING:
            continue
        rows[[lead, best]] = rows[[best, lead]]
        rows[lead] /= rows[lead, column]
        for other in range(len(rows)):
            if other != lead:
                rows[other] -= rows[other, column] * rows[lead]
        lead += 1
    sizes = np.abs(rows).max(axis=1, keepdims=True, initial=0.0)
    rows[np.abs(rows) < ROUNDING * sizes] = 0.0
    return rows


def _led_by_one(rows: Float[np.ndarray, "row free"]) -> Float[np.ndarray, "row free"]:
    """Scale each row so that its first entry is 1."""
    return np.array([row / row[np.flatnonzero(row)[0]] for row in rows]).reshape(
        rows.shape
    )


def estimable_forms(found: Identifiability) -> Float[np.ndarray, "told free"]:
    """Return the estimable combinations of parameters not identified singly.

    Each row is a linear form in the coordinates that vanishes along every null
    direction; parameters determined by themselves take no part.
    """
    shy = [i for i, determined in enumerate(found.determined) if not determined]
    if not shy:
        return np.zeros((0, len(found.determined)))
    # The forms on the shy parameters that vanish on the null directions; led by the
    # last parameter, so that speeds and times are told in terms of the mass. Scaled,
    # so that a metre and a second count alike.
    size = np.abs(found.null).max(axis=0)[shy]
    null = found.null[:, shy] / size
    forms = np.linalg.svd(null)[2][len(null) :]
    estimable = np.zeros((len(forms), len(found.determined)))
    estimable[:, shy] = _led_by_one(echelon(forms[:, ::-1]) / size[::-1])[:, ::-1]
    return estimable
