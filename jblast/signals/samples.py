"""Checks of the samples of one channel: finite numbers in a row, and enough of them."""

import numpy as np
from jaxtyping import Float
from numpy.typing import ArrayLike

from jblast.errors import InputError, argument, shown


def checked_samples(
    name: str, samples: ArrayLike, least: int = 1
) -> Float[np.ndarray, " sample"]:
    """Return samples as an array of numbers in double precision.

    Args:
        name: Name of the argument, for messages.
        samples: Samples of one channel, in any unit.
        least: Smallest number of samples.

    Raises:
        InputError: They are not one row of numbers, too few, or not finite.
    """
    try:
        row = np.asarray(samples).astype(float, copy=False)
    except (TypeError, ValueError):
        raise InputError(
            f"{argument(name)}: expected numbers, got {shown(samples)}"
        ) from None
    if row.ndim != 1:
        raise InputError(
            f"{argument(name)}: expected one channel, a row of samples, "
            f"got the shape {row.shape}"
        )
    if row.size < least:
        raise InputError(
            f"{argument(name)}: expected at least {least} samples, got {row.size}"
        )
    finite = np.isfinite(row)
    if not finite.all():
        at = int(np.argmin(finite))
        raise InputError(
            f"{argument(name)}: expected finite samples, got {row[at]} at sample {at} "
            f"({row.size - int(finite.sum())} in total)"
        )
    return row


def checked_template(template: ArrayLike) -> Float[np.ndarray, " tap"]:
    """Return the samples of a template.

    Raises:
        InputError: It has no samples, only zeros, or is not finite.
    """
    row = checked_samples("template", template)
    if not np.any(row):
        raise InputError(
            f"{argument('template')}: expected a sound, got {row.size} samples of 0"
        )
    return row


def checked_positive(name: str, value: float, unit: str) -> float:
    """Return a positive finite number.

    Args:
        name: Name of the argument, for messages.
        value: The number.
        unit: Its unit, for messages.

    Raises:
        InputError: The number is not positive or not finite.
    """
    if not (np.isfinite(value) and value > 0):
        raise InputError(
            f"{argument(name)}: expected a positive number [{unit}], got {shown(value)}"
        )
    return float(value)
