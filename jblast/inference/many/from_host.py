"""Many logs that lie on the host, fitted piece by piece while others are copied.

While the device fits one piece, the next comes to it and what was asked of the one
before goes back, so that copies cost nothing until they take longer than the fits.
"""

from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from jblast.errors import InputError, nearest
from jblast.inference.many.fit_many import fit_many
from jblast.inference.many.many_fits import ManyFits
from jblast.inference.many.residuals.readings import checked_shapes
from jblast.scene import UncertainScene
from jblast.sensors import Layout

PIECE = {"cpu": 1 << 14, "gpu": 1 << 20}
"""Logs of a piece, by platform."""
COPIES = 2
"""Pieces that are copied back at a time."""
KEPT: dict[str, Callable[[ManyFits], Array]] = {
    "z": lambda fits: fits.z,
    "sd": lambda fits: fits.sd(),
    "cost": lambda fits: fits.cost,
    "misfit": lambda fits: fits.misfit,
    "covariance": lambda fits: fits.covariance,
    "converged": lambda fits: fits.converged,
    "doubtful": lambda fits: fits.doubtful,
    "steps": lambda fits: fits.steps,
    "bad": lambda fits: fits.bad,
}
"""What may be asked of fits: fields of `ManyFits`, and standard deviations."""


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
    """Fit many logs of one layout from host to host.

    Args:
        uncertain: As in `fit_many`, like what follows.
        layout: Who recorded what.
        values: The readings.
        relative_sigma: Their errors, of each row or of each row of each log.
        laws: Names of laws by quantity.
        keep: What is wanted of each log: names of `KEPT`.
        piece: Logs that are fitted together.
        dtype: Of the numbers that come back; `numpy.float32` halves what is copied. The
            fits are in the precision of JAX whatever it is.
        out: Arrays to fill, as an earlier call returned them: memory that the system
            has given already is not asked for again.
        **options: Of `fit_many`: noise, tries, seed, devices.

    Returns:
        What was asked for by name, a row a log.

    Raises:
        InputError: As `fit_many`, or there is nothing of such a name to keep, or `out`
            has another shape.

    Example:
        `fit_from_host(uncertain, layout, readings, sigma, laws, keep=("z", "sd"))`
    """
    _refuse_other(keep, piece)
    shape = np.shape(values)
    checked_shapes(layout, shape, np.shape(relative_sigma))
    platform = "cpu" if jax.default_backend() == "cpu" else "gpu"
    size = min(piece or PIECE[platform], max(1, len(values)))
    if not len(values):
        values = np.ones((1, shape[1]))
        relative_sigma = np.broadcast_to(relative_sigma, (1, shape[1]))
        options |= {"tries": 1}
    begins = range(0, len(values), size)
    each = np.ndim(relative_sigma) == 2

    def cut(begin: int) -> tuple[Array, Any]:
        """Return a piece on the device: the last as long as the others."""
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
            if begin + size < len(values):
                coming = there.submit(cut, begin + size)
            fits = fit_many(uncertain, layout, here, sigma, laws, **options)
            found = {name: _in(dtype, KEPT[name](fits)) for name in keep}
            if not whole:
                whole |= {n: _filled(n, x, shape[0], out) for n, x in found.items()}
            for part in found.values():
                part.copy_to_host_async()
            waiting.append(returning.submit(back, found, begin))
            while len(waiting) > COPIES:  # no more answers on the device than that
                waiting.pop(0).result()
        for one in waiting:
            one.result()
    return whole


def _refuse_other(keep: Sequence[str], piece: int | None) -> None:
    """Refuse what cannot be kept, and pieces of nothing."""
    for name in keep:
        if name not in KEPT:
            raise InputError(
                f"keep: expected names of {', '.join(KEPT)}, got "
                f"{name!r}{nearest(name, KEPT)}"
            )
    if piece is not None and piece < 1:
        raise InputError(f"piece: expected a positive whole number, got {piece}")


def _in(dtype: Any, x: Array) -> Array:
    """Return numbers in another precision, where they are."""
    numbers = dtype is not None and jnp.issubdtype(x.dtype, jnp.floating)
    return x.astype(dtype) if numbers else x


def _filled(
    name: str, like: Array, logs: int, out: Mapping[str, np.ndarray] | None
) -> np.ndarray:
    """Return the array that answers of a name go into."""
    shape, dtype = (logs, *like.shape[1:]), np.dtype(like.dtype)
    if out is None:
        return np.empty(shape, dtype)
    given = out.get(name)
    if given is None or (given.shape, given.dtype) != (shape, dtype):
        got = "nothing" if given is None else f"{given.shape} of {given.dtype}"
        raise InputError(f"out, {name}: expected {shape} of {dtype}, got {got}")
    return given
