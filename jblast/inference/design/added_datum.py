"""Which one more datum would help a planned layout most, and by how much."""

from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float

from jblast.inference.design.covariance import spread_left, worst
from jblast.inference.design.planned_log import Planned
from jblast.inference.design.summary import AddedDatum
from jblast.inference.identifiability.resolving_data import (
    aside,
    laws_beside,
)
from jblast.inference.posterior.fisher_information import whitened_rows
from jblast.inference.posterior.posterior import Posterior
from jblast.kept_programs import kept
from jblast.quantities import ADDABLE, TIMES
from jblast.sensors import Layout

DEFAULT_SIGMA = {"time": 1e-3, "relative": 0.05}
"""Error of a datum whose quantity the layout does not record: seconds, or relative."""
MOST_SENSORS = 12
"""Data are tried beside so many sensors of a layout, the nearest to the farthest."""


class Datum(NamedTuple):
    """One row that could be added: what, where, by which sensor, of which charge."""

    quantity: str
    position: Float[np.ndarray, "3"]
    sensor: str
    group: int
    clock: str
    shot: int
    sigma: float
    is_default: bool


def added_data(plan: Planned) -> tuple[tuple[AddedDatum, ...], int]:
    """Rank rows that could be added by the sd they leave.

    The sd is that of the charge mass; if no mass is fitted, of the number that is known
    worst for its typical size.

    Returns:
        An entry for each row, those first whose laws hold, the most helpful of them
        before all; and the number's index.
    """
    posterior, z = plan.posterior, plan.z
    target = worst(posterior, z)
    data = candidates(plan)
    more = Layout(
        quantity=tuple(d.quantity for d in data),
        position=jnp.asarray(np.array([d.position for d in data])),
        slant_range=jnp.full(len(data), jnp.nan),
        time=jnp.full(len(data), jnp.nan),
        group=tuple(d.group for d in data),
        shot=tuple(d.shot for d in data),
        clock=tuple(d.clock for d in data),
    )
    scene = posterior.parameters.scene_at(jnp.asarray(z))
    laws = dict(posterior.laws) | laws_beside(posterior, scene, more)
    both = Posterior(
        posterior.parameters,
        posterior.layout.beside(more),
        jnp.zeros(len(plan.log) + len(data)),
        jnp.concatenate([posterior.sigma, jnp.asarray([d.sigma for d in data])]),
        tuple(sorted(laws.items())),
        posterior.noise,
    )
    known, valid = map(np.asarray, _with_each(both, jnp.asarray(z), len(plan.log)))
    entries = []
    for datum, matrix, holds in zip(data, known, valid, strict=True):
        left = spread_left(posterior, z, matrix, target)
        entries.append(_entry(datum, plan, laws, bool(holds), target, left))
    entries.sort(key=lambda e: (not e.law_valid, e.left.width))
    return tuple(entries), target


def _entry(datum: Datum, plan: Planned, laws, holds, target, left) -> AddedDatum:
    parameters = plan.posterior.parameters
    charge = parameters.scene.charges[datum.shot]
    return AddedDatum(
        quantity=datum.quantity,
        sensor=datum.sensor,
        position=datum.position if charge.range_m is None else None,
        charge=charge.name,
        sigma=datum.sigma,
        is_default=datum.is_default,
        law=laws[datum.quantity],
        law_valid=holds,
        parameter=parameters.names[target],
        left=left,
    )


def candidates(plan: Planned) -> list[Datum]:
    """Return the rows to try: each quantity beside each sensor, and at a new place."""
    posterior, log = plan.posterior, plan.log
    layout = posterior.layout
    position, distance = (
        np.asarray(x)
        for x in (layout.position, posterior.misfit(jnp.asarray(plan.z)).slant_range)
    )
    sigmas = dict(
        zip(reversed(layout.quantity), np.asarray(posterior.sigma)[::-1], strict=True)
    )
    answer = []
    for shot, charge in enumerate(posterior.parameters.scene.charges):
        rows = {log.sensor[i]: i for i in np.flatnonzero(np.array(layout.shot) == shot)}
        ranked = sorted(rows, key=lambda name: distance[rows[name]])
        picked = np.unique(np.linspace(0, len(ranked) - 1, MOST_SENSORS).astype(int))
        places = [
            (position[i], name, layout.group[i], layout.clock[i])
            for name in (ranked[k] for k in picked)
            for i in (rows[name],)
        ]
        if charge.range_m is None:
            reach = float(np.median(distance))
            places.append(
                (aside(posterior, reach), "", max(layout.group) + 1 + shot, "")
            )
        for quantity in ADDABLE:
            timed = "time" if quantity in TIMES else "relative"
            sigma = float(sigmas.get(quantity, DEFAULT_SIGMA[timed]))
            answer += [
                Datum(quantity, at, name, group, clock, shot, sigma, is_default)
                for is_default in (quantity not in sigmas,)
                for at, name, group, clock in places
                if (name, quantity, shot)
                not in zip(log.sensor, log.quantity, layout.shot, strict=True)
            ]
    return answer


@kept
def _with_each(
    posterior: Posterior, z: Float[Array, " free"], planned: int
) -> tuple[Float[Array, "added free free"], Bool[Array, " added"]]:
    """Return the information of the first rows with each of the others added."""
    jacobian = -jax.jacfwd(lambda z: posterior.misfit(z).residual)(z)
    misfit = posterior.misfit(z)
    prior = jnp.diag(posterior.parameters.has_prior())

    def with_row(row: Array) -> Float[Array, "free free"]:
        rows = jnp.append(jnp.arange(planned), row)
        of_rows = jax.tree.map(lambda x: x[rows], misfit)
        gained = whitened_rows(posterior, of_rows, jacobian[rows])
        return gained.T @ gained + prior

    rows = jnp.arange(planned, len(jacobian))
    return jax.lax.map(with_row, rows), misfit.valid[planned:]
