"""The readings of a batch of logs, checked, and as they are fitted."""

from typing import NamedTuple

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float

from jblast.errors import InputError
from jblast.inference.many.residuals.rows import LaneRows
from jblast.quantities import ADDITIVE, TIMES
from jblast.sensors import Layout

NAMED = 20
"""So many bad logs are named."""


class Readings(NamedTuple):
    """Logs as they are fitted; the lane is the last axis.

    Attributes:
        measured: Readings; in ln unless `ADDITIVE`, by clocks that are right.
        errors: Their instrument errors, unless all logs have the same.
        bad: Whether a log could not be read; it holds numbers that stand for nothing.
    """

    measured: Float[Array, "row lane"]
    errors: Float[Array, "row lane"] | None
    bad: Bool[Array, " lane"]


def checked(layout: Layout, values, sigma):
    """Return values and sigmas, whose shapes fit together.

    Raises:
        InputError: They do not, errors that all logs share are not finite, or errors
            are in the unit of the reading where shares are expected.
    """
    checked_shapes(layout, np.shape(values), np.shape(sigma))
    _refuse_absolute(layout, values, sigma)
    values = jnp.asarray(values)
    if np.ndim(sigma) > 1:
        return values, jnp.asarray(sigma)
    # known beforehand, so that programs hold them as constants
    sigma = np.asarray(sigma, values.dtype)
    if not (np.isfinite(sigma) & (sigma >= 0)).all():
        raise InputError(f"relative_sigma: expected finite errors, got {sigma}")
    return values, sigma


def checked_shapes(
    layout: Layout, values: tuple[int, ...], sigma: tuple[int, ...]
) -> None:
    """Refuse readings and errors of shapes that do not fit together.

    Raises:
        InputError: They do not.
    """
    if len(values) != 2 or values[1] != len(layout.quantity):
        rows = len(layout.quantity)
        raise InputError(f"values: expected (log, row) with {rows} rows, got {values}")
    if sigma not in (values, values[1:]):
        raise InputError(
            f"relative_sigma: expected {values[1:]} or {values}, got {sigma}"
        )


def _refuse_absolute(layout: Layout, values, sigma) -> None:
    """Refuse errors of most logs that are more than the whole reading: no shares."""
    errors = np.atleast_2d(np.asarray(sigma))
    most = np.mean(errors > 1.0, axis=0) > 0.5
    for row in np.flatnonzero(most & ~np.isin(layout.quantity, ADDITIVE)):
        typical = float(np.median(errors[:, row]))
        reading = float(np.median(np.abs(np.asarray(values)[:, row])))
        if np.isfinite(reading) and reading > typical:
            raise InputError(
                f"relative_sigma, row {row} ({layout.quantity[row]}): expected a share "
                f"of the reading, got {typical:g}: divide by the reading, {reading:g} "
                f"there, which makes {typical / reading:.3g}"
            )


def read(rows: LaneRows, values, sigma) -> Readings:
    """Turn readings into what is fitted, and find the logs that cannot be."""
    additive = np.isin(rows.layout.quantity, ADDITIVE)[None, :]
    good = jnp.isfinite(values) & (additive | (values > 0))
    sigmas = jnp.broadcast_to(jnp.atleast_2d(jnp.asarray(sigma)), values.shape)
    good = good & jnp.isfinite(sigmas) & (sigmas >= 0)
    bad = ~good.all(axis=1)
    measured = rows.to_error_scale(jnp.where(good, values, 1.0))
    same = np.ndim(sigma) == 1
    errors = None if same else jnp.where(bad[:, None], 1.0, sigmas).T
    return Readings(measured, errors, bad)


def faults_of(
    layout: Layout, values, sigma, bad: Bool[Array, " log"]
) -> tuple[tuple[int, str], ...]:
    """Say what is wrong with the first bad logs, each by its number."""
    if not bad.any():  # one number, where the mask would have to come from a device
        return ()
    logs = [int(log) for log in np.flatnonzero(np.asarray(bad))[:NAMED]]
    return tuple((log, _fault(layout, values, sigma, log)) for log in logs)


def _fault(layout: Layout, values, sigma, log: int) -> str:
    """Say what is wrong with the first bad row of a log."""
    value = np.asarray(values[log])
    error = np.asarray(sigma if np.ndim(sigma) == 1 else sigma[log])
    for row, quantity in enumerate(layout.quantity):
        additive = quantity in ADDITIVE
        if not np.isfinite(value[row]) or not (additive or value[row] > 0):
            wanted = "a finite angle" if additive else "a positive number"
            wanted = "a finite time" if quantity in TIMES else wanted
            got = f"{value[row]}"
        elif not (np.isfinite(error[row]) and error[row] >= 0):
            wanted, got = "a finite sigma", f"{error[row]}"
        else:
            continue
        return f"log {log}, row {row}, {quantity}: expected {wanted}, got {got}"
    raise AssertionError(f"log {log} is not bad")
