"""Influence of one more datum, prior or known number on the least certain number.

The information of a planned layout changes by a row that could be added, by a number
that becomes known, or by a prior that is dropped. Each change gives the standard
deviation that it would leave.
"""

from dataclasses import dataclass

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from jblast.inference.design.planned_log import Planned
from jblast.inference.identify import aside, laws_beside
from jblast.inference.posterior.fisher_information import (
    information_with_each,
    linearised,
    silent_posterior,
)
from jblast.inference.posterior.parameters import Spread
from jblast.quantities import ADDABLE
from jblast.sensors import Layout

MAX_SENSORS = 12
"""Largest number of sensors at which data are added, evenly spaced from the nearest to
the farthest. Each adds a row for every quantity that can be added."""
KNOWN_GAIN = 1.5
"""Smallest factor by which an sd shrinks once another number is known, for a report:
less does not justify a measurement of that number."""
PRIOR_LOSS = 1.2
"""Smallest factor by which an sd grows without the prior of another number, for a
report: the prior then contributes 30 % of the information."""


@dataclass(frozen=True)
class AddedDatum:
    """One row that could be added to a layout, and the uncertainty with it.

    Attributes:
        quantity: Quantity to record.
        sensor: Sensor of the layout at that position; "" off the sensors' line.
        position: Position [m]; None in a scene without positions.
        charge: Name of the charge, or "".
        sigma: Its error: seconds, or relative.
        is_default: True if the error is that of `ADDABLE`, not of the layout.
        law: Name of its law.
        law_valid: True if the row is within the range of the law.
        parameter: Number whose uncertainty is reported.
        left: Standard deviations of that number with the row.
    """

    quantity: str
    sensor: str
    position: Float[np.ndarray, "3"] | None
    charge: str
    sigma: float
    is_default: bool
    law: str
    law_valid: bool
    parameter: str
    left: Spread


@dataclass(frozen=True)
class Sensitivity:
    """Sensitivity of the width of one number to knowledge of another.

    Attributes:
        parameter: Number whose width is reported.
        on: The other number.
        if_known: Standard deviations if the other number is known.
        without_prior: Standard deviations without the prior of the other number; None
            if it has none.
    """

    parameter: str
    on: str
    if_known: Spread
    without_prior: Spread | None


def added_data(plan: Planned) -> tuple[AddedDatum, ...]:
    """Rank rows that could be added by the standard deviation of the target.

    Rows within their laws come first, then by increasing standard deviation.
    """
    parameters, posterior, planned = plan.parameters, plan.posterior, len(plan.log)
    z = jnp.asarray(plan.z)
    more = candidates(plan)
    # reversed, so that the first row of a quantity gives its sigma
    pairs = zip(posterior.layout.quantity, posterior.sigma.tolist(), strict=True)
    sigmas = dict(reversed([*pairs]))
    sigma = [sigmas.get(quantity, ADDABLE[quantity]) for quantity in more.quantity]
    laws = dict(posterior.laws)
    laws |= laws_beside(laws, parameters.scene_at(z), more)
    # planned and additional rows in one layout, so that all share one program
    both = silent_posterior(
        parameters,
        posterior.layout.beside(more),
        jnp.concatenate([posterior.sigma, jnp.asarray(sigma)]),
        laws,
        posterior.noise,
    )
    misfit, slopes = jax.tree.map(np.asarray, linearised(both, z))
    known = information_with_each(both, misfit, slopes, planned)[1:]
    left = plan.left(plan.target, known)
    charges = [parameters.scene.charges[shot] for shot in more.shot]
    entries = [
        AddedDatum(
            quantity=quantity,
            sensor=more.clock[i],
            position=np.asarray(more.position[i]) if charge.range_m is None else None,
            charge=charge.name,
            sigma=sigma[i],
            is_default=quantity not in sigmas,
            law=laws[quantity],
            law_valid=bool(misfit.valid[planned + i]),
            parameter=parameters.names[plan.target],
            left=left[i],
        )
        for i, (quantity, charge) in enumerate(zip(more.quantity, charges, strict=True))
    ]
    return tuple(sorted(entries, key=lambda e: (not e.law_valid, e.left.width)))


def candidates(plan: Planned) -> Layout:
    """Return the rows to try: each quantity at each sensor and at a new position.

    The clock of a row is its sensor; "" at the new position.
    """
    layout = plan.posterior.layout
    taken = set(zip(layout.clock, layout.quantity, layout.shot, strict=True))
    rows = [
        (quantity, sensor, row)
        for shot in dict.fromkeys(layout.shot)
        for quantity in ADDABLE
        for sensor, row in _places(plan, shot)
        if (sensor, quantity, shot) not in taken
    ]
    quantity, sensor, row = zip(*rows, strict=True) if rows else ((), (), ())
    like, is_new = layout.only(np.array(row, int)), np.array(sensor, str) == ""
    unknown = jnp.full(len(rows), jnp.nan)
    new = aside(plan.density, float(np.median(plan.misfit.slant_range)))
    # a new path for each shot
    paths = max(layout.group) + 1 + np.array(like.shot)
    return Layout(
        quantity=quantity,
        position=jnp.asarray(np.where(is_new[:, None], new, like.position)),
        slant_range=unknown,
        time=unknown,
        group=tuple(np.where(is_new, paths, like.group).tolist()),
        shot=like.shot,
        clock=sensor,
    )


def _places(plan: Planned, shot: int) -> list[tuple[str, int]]:
    """Return sensors, with a row of each, and "" for a new position."""
    layout, distance = plan.posterior.layout, plan.misfit.slant_range
    rows = {layout.clock[i]: i for i, s in enumerate(layout.shot) if s == shot}
    ranked = sorted(rows, key=lambda sensor: distance[rows[sensor]])
    picked = np.unique(np.linspace(0, len(ranked) - 1, MAX_SENSORS).astype(int))
    places = [(ranked[k], rows[ranked[k]]) for k in picked]
    if plan.parameters.scene.charges[shot].range_m is None:
        places.append(("", places[0][1]))
    return places


def leans_on(plan: Planned) -> tuple[Sensitivity, ...]:
    """Return the other numbers to which the width of the target is sensitive.

    Returns:
        One entry for each sensitivity, the largest first.
    """
    names, changes, priors = plan.parameters.names, [plan.information], [plan.has_prior]
    for one in np.eye(len(names)):
        # a known number is independent of the others
        changes.append(plan.information * np.outer(1 - one, 1 - one) + np.diag(one))
        changes.append(plan.information - np.diag(one * plan.has_prior))
        priors += [plan.has_prior, plan.has_prior * (1 - one)]
    now, *left = plan.left(plan.target, np.array(changes), np.array(priors))
    found = []
    for i, (name, known, without) in enumerate(
        zip(names, left[::2], left[1::2], strict=True)
    ):
        gain, loss = _ratio(now, known), _ratio(without, now)
        if i != plan.target and (gain >= KNOWN_GAIN or loss >= PRIOR_LOSS):
            without_prior = without if plan.has_prior[i] else None
            entry = Sensitivity(names[plan.target], name, known, without_prior)
            found.append((max(gain, loss), entry))
    return tuple(entry for _, entry in sorted(found, key=lambda pair: -pair[0]))


def _ratio(wide: Spread, narrow: Spread) -> float:
    """Return the ratio of two widths; 1 if both are infinite."""
    if np.isinf(wide.width):
        return 1.0 if np.isinf(narrow.width) else np.inf
    return wide.width / narrow.width if narrow.width > 0 else np.inf
