"""The same fit for thousands to millions of independent logs of one layout.

`batch_of` joins logs of equal rows into the arrays that `fit_many` takes. Logs whose
rows differ, lower bounds and correlated errors are refused.

`fit_from_host` fits logs in host memory in chunks. While the device fits one chunk, the
next is copied to it and the results of the previous one are copied back, so copies take
no extra time until they take longer than the fits.
"""

from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from jblast.errors import InputError, nearest, shown
from jblast.inference.many.lanes import COST_Z_MAX, ManyFits
from jblast.inference.many.residuals import checked_shapes
from jblast.inference.posterior.posterior import refuse_exact
from jblast.kept_programs import kept_between_runs
from jblast.observations import Observations, resolve_positions
from jblast.observations.clocks import refuse_unresolved
from jblast.observations.grouping import located
from jblast.progress import stages
from jblast.progress_line import Progress, reported
from jblast.registry import names_for
from jblast.scene import UncertainScene
from jblast.scene.uncertain import NO_SCENE
from jblast.sensors import Layout, layout_of, resolve_laws
from jblast.sensors.law_choice import law_names
from jblast.sensors.simulated_readings import Noise

PIECE = {"cpu": 1 << 14, "gpu": 1 << 20}
"""Logs of a chunk, by platform: one call of the compiled program (`engine.LANES`)."""
COPIES = 2
"""Chunks that are copied back simultaneously: more would fill the device's memory."""
KEPT: dict[str, Callable[[ManyFits], Array]] = {
    "z": lambda fits: fits.z,
    "sd": lambda fits: fits.sd(),
    "cost": lambda fits: fits.cost,
    "misfit": lambda fits: fits.misfit,
    "covariance": lambda fits: fits.covariance,
    "converged": lambda fits: fits.converged,
    "doubtful": lambda fits: fits.doubtful,
    "beyond_array": lambda fits: fits.beyond_array,
    "steps": lambda fits: fits.steps,
    "bad": lambda fits: fits.bad,
}
"""Results that can be requested: fields of `ManyFits`, and standard deviations."""
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
    minimised by Levenberg-Marquardt (`LaneLevenbergMarquardt`). `fit` integrates the
    effects out instead: where laws scatter, its optimum differs by the variation of
    ln det of their curvature.

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
    # imported here: it needs optimistix, which takes longer to import than the stored
    # programs of a single fit to load
    from jblast.inference.many.engine import engine_for

    begin = stages({"preparing": 1.0, "fitting": 4.0})
    begin("preparing")
    engine = engine_for(uncertain, layout, laws, noise, devices)
    begin("fitting")
    return engine.fit(
        values,
        relative_sigma,
        starts=starts,
        tries=tries,
        seed=seed,
        again_z=again_z,
    )


def fit_from_host(
    uncertain: UncertainScene,
    layout: Layout,
    values: Float[np.ndarray, "log row"],
    relative_sigma: Float[np.ndarray, "..."],
    laws: Mapping[str, str],
    *,
    keep: Sequence[str] = ("z", "sd", "converged"),
    piece: int | None = None,
    dtype: Any = None,
    out: Mapping[str, np.ndarray] | None = None,
    **options: Any,
) -> dict[str, np.ndarray]:
    """Fit many logs of one layout from host memory to host memory.

    Args:
        uncertain: As for `fit_many`.
        layout: As for `fit_many`.
        values: The readings.
        relative_sigma: Their errors, of each row or of each row of each log.
        laws: Names of laws by quantity.
        keep: Results to return: names of `KEPT`.
        piece: Number of logs that are fitted together.
        dtype: Type of the returned numbers; `numpy.float32` halves the copies. It does
            not change the precision of the fits.
        out: Arrays to fill, as returned by an earlier call: their memory is reused.
        **options: Options of `fit_many`: noise, tries, seed, devices.

    Returns:
        The requested results by name, one row per log.

    Raises:
        InputError: As for `fit_many`, or `keep` has an unknown name, or `out` has
            another shape.

    Example:
        `fit_from_host(uncertain, layout, readings, sigma, laws, keep=("z", "sd"))`
    """
    _refuse_other(keep, piece)
    shape = np.shape(values)
    checked_shapes(layout, shape, np.shape(relative_sigma))
    platform = "cpu" if jax.default_backend() == "cpu" else "gpu"
    size = min(piece or PIECE[platform], max(1, len(values)))
    # without logs one dummy is fitted: it gives the types of the results
    if not len(values):
        values = np.ones((1, shape[1]))
        relative_sigma = np.broadcast_to(relative_sigma, (1, shape[1]))
        options |= {"tries": 1}
    begins = range(0, len(values), size)
    each = np.ndim(relative_sigma) == 2

    def cut(begin: int) -> tuple[Array, Any]:
        """Return a chunk on the device; the last one is padded to the same size."""
        # the last log is repeated: all chunks have one size, which is compiled once
        rows = np.minimum(np.arange(begin, begin + size), len(values) - 1)
        whole = begin + size <= len(values)
        some = values[begin : begin + size] if whole else values[rows]
        return jax.device_put(some), relative_sigma[rows] if each else relative_sigma

    def back(found: Mapping[str, Array], begin: int) -> None:
        end = min(begin + size, shape[0])
        for name, part in found.items():
            whole[name][begin:end] = np.asarray(part)[: end - begin]

    whole: dict[str, np.ndarray] = {}
    with ThreadPoolExecutor(1) as there, ThreadPoolExecutor(COPIES) as returning:
        coming = there.submit(cut, 0)
        waiting = []
        for begin in begins:
            here, sigma = coming.result()
            # the next copy starts before this chunk is fitted
            if begin + size < len(values):
                coming = there.submit(cut, begin + size)
            fits = fit_many(uncertain, layout, here, sigma, laws, **options)
            found = {name: KEPT[name](fits) for name in keep}
            if dtype is not None:  # flags and counts keep their type
                found = {
                    name: x.astype(dtype)
                    if jnp.issubdtype(x.dtype, jnp.floating)
                    else x
                    for name, x in found.items()
                }
            if not whole:
                whole |= {n: _filled(n, x, shape[0], out) for n, x in found.items()}
            for part in found.values():
                # the copy overlaps with the fit of the next chunk
                part.copy_to_host_async()
            waiting.append(returning.submit(back, found, begin))
            while len(waiting) > COPIES:  # bounds the results in device memory
                waiting.pop(0).result()
        for one in waiting:
            one.result()
    return whole


def _refuse_other(keep: Sequence[str], piece: int | None) -> None:
    """Reject unknown names of results, and chunks without logs."""
    for name in keep:
        if name not in KEPT:
            raise InputError(
                f"keep: expected names of {', '.join(KEPT)}, got "
                f"{name!r}{nearest(name, KEPT)}"
            )
    if piece is not None and piece < 1:
        raise InputError(f"piece: expected a positive whole number, got {piece}")


def _filled(
    name: str, like: Array, logs: int, out: Mapping[str, np.ndarray] | None
) -> np.ndarray:
    """Return the array for the results of a name."""
    shape, dtype = (logs, *like.shape[1:]), np.dtype(like.dtype)
    if out is None:
        return np.empty(shape, dtype)
    given = out.get(name)
    if given is None or (given.shape, given.dtype) != (shape, dtype):
        got = "nothing" if given is None else f"{given.shape} of {given.dtype}"
        raise InputError(f"out, {name}: expected {shape} of {dtype}, got {got}")
    return given


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
