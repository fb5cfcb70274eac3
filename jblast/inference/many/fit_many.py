"""The same fit for thousands to millions of independent logs of one layout.

`batch_of` joins logs of equal rows into the arrays that `fit_many` takes. Logs whose
rows differ, lower bounds and correlated errors are refused.
"""

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
from jaxtyping import Array, Float

from jblast.errors import InputError, shown
from jblast.inference.many.engine import engine_for
from jblast.inference.many.lanes import COST_Z_MAX, ManyFits
from jblast.inference.many.residuals import checked
from jblast.inference.posterior.posterior import refuse_exact
from jblast.kept_programs import kept_between_runs
from jblast.observations import Observations, resolve_positions
from jblast.observations.clocks import refuse_unresolved
from jblast.observations.grouping import located
from jblast.progress import Progress, reported, stages
from jblast.registry import names_for
from jblast.scene import UncertainScene
from jblast.scene.uncertain import NO_SCENE
from jblast.sensors import Layout, layout_of, resolve_laws
from jblast.sensors.law_choice import law_names
from jblast.sensors.simulated_readings import Noise

# columns of a log, and its arrays, that the logs of a batch have in common
SHARED_COLUMNS = ("sensor", "quantity", "path", "shot", "clock")
PLACED = ("position", "slant_range", "time")


@kept_between_runs()
@reported("fit_many")
def fit_many(
    uncertain: UncertainScene,
    layout: Layout,
    values: Float[Array, "log row"] | Float[np.ndarray, "log row"],
    relative_sigma: Float[Array, "..."] | Float[np.ndarray, "..."],
    laws: Mapping[str, str],
    *,
    noise: Noise = "student",
    starts: Float[Array, "..."] | Float[np.ndarray, "..."] | None = None,
    tries: int = 4,
    seed: int = 0,
    devices: int | None = None,
    again_z: float = COST_Z_MAX,
    progress: Progress = False,
) -> ManyFits:
    r"""Fit many logs of one layout.

    For each log, minus ln of the joint density of readings and shared effects is
    minimised by Levenberg-Marquardt (`many.solver`). `fit` integrates the effects out
    instead: where laws scatter, its optimum differs by the variation of ln det of their
    curvature.

    If `burst` follows from the height, the curve sets are chosen once at the scene's
    own numbers, for all logs. A log whose answer would change them is not marked.

    Args:
        uncertain: The scene and its uncertain parameters, common to all logs.
        layout: Quantity and sensor of each row.
        values: The readings.
        relative_sigma: Their instrument errors, of each row or of each row of each log:
            relative, but seconds and radians for times and directions (`ADDITIVE`). A
            log's own `sigma`, in the unit of the reading, is rejected with the number
            by which to divide it.
        laws: Name of the law for each of `layout.quantities()`.
        noise: Distribution of the independent errors.
        starts: Fitted coordinates to start from, (log, free) or (try, log, free). The
            default is the closed form (`many.starts.closed_form`). If that does not
            apply, and for tries after the first, it is the draw of the prior with the
            nearest readings (`many.starts.reference_set`).
        tries: Largest number of starts of a log whose result is doubtful. The lowest
            cost is returned.
        seed: Seed of the reference set.
        devices: 1 for the default device; None for all devices.
        again_z: Excess of a cost over its mean, in standard deviations, above which a
            log starts again. Smaller values find more of the logs that ended in another
            optimum.
        progress: As for `jblast.fit`.

    Returns:
        Estimates and standard deviations of each log, convergence, and faults.

    Raises:
        InputError: The whole batch cannot be fitted, for a wrong shape or an error that
            is not relative. A bad log does not raise: its result is NaN, with the
            reason in `faults`.

    Example:
        `jblast.fit_many(uncertain, *jblast.inference.batch_of(logs, uncertain))`
    """
    begin = stages({"preparing": 1.0, "fitting": 4.0})
    begin("preparing")
    values, sigma = checked(layout, values, relative_sigma)
    common = sigma if isinstance(sigma, np.ndarray) else None
    engine = engine_for(uncertain, layout, laws, noise, devices, common)
    begin("fitting")
    return engine.fit(
        values,
        sigma,
        starts=starts,
        tries=tries,
        seed=seed,
        again_z=again_z,
    )


class Batch(NamedTuple):
    """Arguments of `fit_many` after the scene, in its order.

    Attributes:
        layout: Quantity and sensor of each row, common to all logs.
        values: The readings.
        relative_sigma: Their instrument errors: relative, but seconds and radians for
            times and directions; 0 where the law's scatter is the only error.
        laws: Name of the law for each of `layout.quantities()`.
    """

    layout: Layout
    values: Float[np.ndarray, "log row"]
    relative_sigma: Float[np.ndarray, "log row"]
    laws: Mapping[str, str]


def batch_of(logs: Sequence[Observations], uncertain: UncertainScene) -> Batch:
    """Combine logs: `fit_many(uncertain, *batch_of(logs, uncertain))` fits them.

    All logs have the same laws, so the scene has to name them (`scene.with_laws`). The
    automatic choice would depend on the answer of each.

    Args:
        logs: Logs of separate blasts, with the same rows in the same order.
        uncertain: The scene and its uncertain parameters, common to all.

    Raises:
        InputError: There is no log; one has other rows than the first, a lower bound or
            covariances; log and scene do not match; or a law is not named.
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
    named = dict(uncertain.scene.law)
    for quantity in layout.quantities():
        names = names_for(quantity)
        if named.get(quantity, "auto") == "auto" and len(names) > 1:
            raise InputError(
                f"[law] {quantity}: expected a name, one of {', '.join(names)}, as all "
                "logs of a batch share their laws; got auto"
            )
    laws = law_names(resolve_laws(uncertain.scene, layout))
    for number, log in enumerate(logs):
        _refuse_other_rows(log, logs[0], number)
        if (bounds := log.bounds()).any():
            row = int(np.argmax(bounds))
            raise InputError(
                f"{log.where(row)}: expected a reading, got the lower bound "
                f">{log.value[row]:g}; fit logs with lower bounds with fit_each"
            )
        if log.covariances:  # lanes take the errors of readings as independent
            raise InputError(
                f"{log.source or 'observations'}: expected independent errors, got the "
                f"covariance of record {shown(log.covariances[0].record)}; fit logs "
                "whose readings share errors with fit_each"
            )
        refuse_exact(log, uncertain.scene.scatter, laws)
        refuse_unresolved(log)
    values = np.array([log.value for log in logs])
    sigma = np.nan_to_num(np.array([log.error_scale() for log in logs]))
    return Batch(layout, values, sigma, laws)


def _refuse_other_rows(log: Observations, first: Observations, number: int) -> None:
    """Reject a log whose rows differ from those of the first."""
    name = log.source or f"log {number}"
    if len(log) != len(first):
        raise InputError(
            f"{name}: expected {len(first)} rows as in the first log, got {len(log)}; "
            "fit logs of different rows with fit_each"
        )
    other = np.zeros(len(log), bool)
    for field in SHARED_COLUMNS:
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
