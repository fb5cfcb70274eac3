"""Logs of one layout put together, as `fit_many` takes them."""

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from jblast.errors import InputError, shown
from jblast.inference.posterior.refused_logs import refuse_exact
from jblast.observations import Observations, resolve_positions
from jblast.observations.clocks import refuse_unresolved
from jblast.observations.grouping import located
from jblast.registry import names_for
from jblast.scene import Scene, UncertainScene
from jblast.scene.uncertain import NO_SCENE
from jblast.sensors import Layout, layout_of, resolve_laws
from jblast.sensors.law_choice import law_names

SAME = ("sensor", "quantity", "path", "shot", "clock")
PLACED = ("position", "slant_range", "time")


class Batch(NamedTuple):
    """What `fit_many` takes after the scene, in its order.

    Attributes:
        layout: Who recorded what, the same in every log.
        values: The readings.
        relative_sigma: Their instrument errors: shares of the readings, of times and
            directions seconds and radians; 0 where the law's scatter is all there is.
        laws: Name of the law for each of `layout.quantities()`.
    """

    layout: Layout
    values: Float[np.ndarray, "log row"]
    relative_sigma: Float[np.ndarray, "log row"]
    laws: Mapping[str, str]


def batch_of(logs: Sequence[Observations], uncertain: UncertainScene) -> Batch:
    """Put logs together: `fit_many(uncertain, *batch_of(logs, uncertain))` fits them.

    All logs share their laws, so the scene has to name them (`scene.with_laws`): the
    automatic choice depends on the answer of each.

    Args:
        logs: Each of a blast of its own: the same rows in the same order.
        uncertain: The scene and what is not known of it, the same for all.

    Raises:
        InputError: There is no log, one has other rows than the first, a lower bound
            or covariances; one and the
            scene do not go together, or the choice of a law is left open.
    """
    if not logs:
        raise InputError("logs: expected at least one, got none")
    first = located(logs[0], uncertain)
    first = resolve_positions(
        first,
        uncertain.scene,
        uncertain.beliefs,
        is_default=uncertain.source == NO_SCENE,
    )
    layout = layout_of(first, uncertain.scene)
    laws = _named_laws(uncertain.scene, layout)
    for number, log in enumerate(logs):
        _refuse_other_rows(log, logs[0], number)
        _refuse_bounds(log)
        _refuse_covariances(log)
        refuse_exact(log, uncertain.scene.scatter, laws)
        refuse_unresolved(log)
    values = np.array([log.value for log in logs])
    sigma = np.nan_to_num(np.array([log.error_scale() for log in logs]))
    return Batch(layout, values, sigma, laws)


def _named_laws(scene: Scene, layout: Layout) -> dict[str, str]:
    """Return the law of every quantity, if there is no choice left."""
    named = dict(scene.law)
    for quantity in layout.quantities():
        if named.get(quantity, "auto") == "auto" and len(names_for(quantity)) > 1:
            raise InputError(
                f"[law] {quantity}: expected a name, one of "
                f"{', '.join(names_for(quantity))}, as all logs of a batch share their "
                "laws; got auto"
            )
    return law_names(resolve_laws(scene, layout))


def _refuse_bounds(log: Observations) -> None:
    """Refuse a log one of whose readings is a lower bound."""
    if (bounds := log.bounds()).any():
        row = int(np.argmax(bounds))
        raise InputError(
            f"{log.where(row)}: expected a reading, got the lower bound "
            f">{log.value[row]:g}; fit logs with lower bounds with fit_each"
        )


def _refuse_covariances(log: Observations) -> None:
    """Refuse a log whose readings share errors, which lanes take as independent."""
    if log.covariances:
        raise InputError(
            f"{log.source or 'observations'}: expected independent errors, got the "
            f"covariance of record {shown(log.covariances[0].record)}; fit logs whose "
            "readings share errors with fit_each"
        )


def _refuse_other_rows(log: Observations, first: Observations, number: int) -> None:
    """Refuse a log whose rows are not those of the first."""
    name = log.source or f"log {number}"
    if len(log) != len(first):
        raise InputError(
            f"{name}: expected {len(first)} rows as in the first log, got {len(log)}; "
            "fit logs of different rows with fit_each"
        )
    other = np.zeros(len(log), bool)
    for field in SAME:
        other |= np.array(getattr(log, field)) != np.array(getattr(first, field))
    for field in PLACED:
        pair = getattr(log, field), getattr(first, field)
        same = np.isclose(*pair, rtol=0, atol=0, equal_nan=True)
        other |= ~same.reshape(len(log), -1).all(axis=1)
    if other.any():
        row = int(np.argmax(other))
        raise InputError(
            f"{name}: row {row + 1}: expected {first.sensor[row]}, "
            f"{first.quantity[row]}, placed as in the first log; got "
            f"{log.sensor[row]}, {log.quantity[row]}; fit logs of different rows with "
            "fit_each"
        )
