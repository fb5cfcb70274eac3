"""Many logs that lie on the host, fitted piece by piece while others are copied.

While the device fits one piece, the next comes to it and what was asked of the one
before goes back, so that copies cost nothing until they take longer than the fits.
"""

from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import jax
import numpy as np
from jaxtyping import Array, Float

from jblast.errors import InputError, nearest
from jblast.inference.many.many_fits import ManyFits
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
    **options: Any,
) -> dict[str, np.ndarray]:
    """Fit many logs of one layout from host to host.

    Args:
        uncertain: As in `fit_many`, like what follows.
        layout: Who recorded what.
        values: The readings.
        relative_sigma: Their errors, of each row.
        laws: Names of laws by quantity.
        keep: What is wanted of each log: names of `KEPT`.
        piece: Logs that are fitted together.
        **options: Of `fit_many`: noise, tries, seed, devices.

    Returns:
        What was asked for by name, a row a log.

    Raises:
        InputError: As `fit_many`, or there is nothing of such a name to keep.

    Example:
        `fit_from_host(uncertain, layout, readings, sigma, laws, keep=("z", "sd"))`
    """
    from jblast.inference.many.fit_many import fit_many

    for name in keep:
        if name not in KEPT:
            raise InputError(
                f"keep: expected names of {', '.join(KEPT)}, got "
                f"{name!r}{nearest(name, KEPT)}"
            )
    platform = "cpu" if jax.default_backend() == "cpu" else "gpu"
    size = piece or PIECE[platform]
    begins = range(0, max(1, len(values)), size)

    def back(found: Mapping[str, Array], begin: int) -> None:
        for name, part in found.items():
            whole[name][begin : begin + len(part)] = np.asarray(part)

    whole: dict[str, np.ndarray] = {}
    with ThreadPoolExecutor(1) as there, ThreadPoolExecutor(COPIES) as returning:
        coming = there.submit(jax.device_put, values[:size])
        waiting = []
        for begin in begins:
            here, after = coming.result(), begin + size
            if after < len(values):
                coming = there.submit(jax.device_put, values[after : after + size])
            fits = fit_many(uncertain, layout, here, relative_sigma, laws, **options)
            found = {name: KEPT[name](fits) for name in keep}
            if not whole:
                whole |= {
                    name: np.empty((len(values), *part.shape[1:]), part.dtype)
                    for name, part in found.items()
                }
            for part in found.values():
                part.copy_to_host_async()
            waiting.append(returning.submit(back, found, begin))
            while len(waiting) > COPIES:  # no more answers on the device than that
                waiting.pop(0).result()
        for one in waiting:
            one.result()
    return whole
