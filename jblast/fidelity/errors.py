"""How far a method is off at a place, read from what was measured."""

import math
from itertools import product

import numpy as np
from jaxtyping import Bool, Float

from jblast.constants import STANDARD_PRESSURE
from jblast.fidelity import error_tables
from jblast.fidelity.conditions import Conditions, Numbers
from jblast.fidelity.reference import (
    END,
    KINGERY_BULMASH_END,
    REFERENCES,
    covers,
    is_too_far,
)


def relative_errors(quantity: str, conditions: Conditions) -> dict[str, Numbers]:
    """Return how far every method is off its reference at every place, relative.

    Zero where a method is itself the reference; infinite where it does not hold, or
    where nothing is known.

    Args:
        quantity: One of `REFERENCES`.
        conditions: At every place.
    """
    table = error_tables.errors(quantity, conditions.burst)
    z = np.asarray(conditions.z)
    with np.errstate(divide="ignore"):  # a sensor at the charge: nothing is known there
        log_z = np.log(z)
    log_mass, log_pressure = (
        np.log(conditions.charge_mass),
        np.log(conditions.ambient_pressure),
    )
    loss = _log_loss(quantity, conditions.burst, log_z, log_mass, log_pressure)
    known = is_covered(quantity, conditions)
    found = {}
    for method, nodes in table.log_ratio.items():
        per_mass, per_pressure = table.exponents[method]
        ratio = np.interp(log_z, table.log_z, nodes, left=np.nan, right=np.nan)
        ratio = ratio + per_mass * log_mass - loss
        ratio = ratio + per_pressure * (log_pressure - math.log(STANDARD_PRESSURE))
        for branch in REFERENCES[quantity]:
            if branch.law == method:
                ratio = np.where(covers(branch, z), 0.0, ratio)
        good = known & np.asarray(conditions.holds[method])
        off = np.abs(np.expm1(np.where(good, ratio, np.nan)))
        found[method] = np.where(np.isfinite(off), off, np.inf)
    return found


def is_covered(quantity: str, conditions: Conditions) -> Bool[np.ndarray, " place"]:
    """Return where the reference holds, by place."""
    z = np.asarray(conditions.z)
    spans = error_tables.reference_uncertainties(quantity, conditions.burst)
    inside = (z >= spans[0].start) & (z <= spans[-1].end)
    return inside & ~is_too_far(z, conditions.slant_range)


def reference_uncertainty(
    quantity: str, conditions: Conditions
) -> Float[np.ndarray, " place"]:
    """Return how far the reference itself may be off at every place, relative."""
    spans = error_tables.reference_uncertainties(quantity, conditions.burst)
    ends = [span.end for span in spans[:-1]]
    errors = np.array([span.error for span in spans])
    return errors[np.searchsorted(ends, np.asarray(conditions.z))]


def _log_loss(quantity: str, burst: str, log_z, log_mass, log_pressure) -> np.ndarray:
    """Return what absorption takes past the tables, in ln, of a place; else zero."""
    lossy = any(branch.law != branch.lossless for branch in REFERENCES[quantity])
    far = log_z > math.log(KINGERY_BULMASH_END)
    if not (lossy and far.any()):
        return np.zeros_like(log_z)
    table = error_tables.losses(burst)
    axes = (table.log_z, table.log_mass, table.log_pressure)
    places = [
        np.clip(x, axis[0], axis[-1])
        for x, axis in zip((log_z, log_mass, log_pressure), axes, strict=True)
    ]
    loss = _trilinear(axes, table.log_loss, places)
    return np.where(far & (log_z <= math.log(END)), loss, 0.0)


def _trilinear(axes, values, places) -> np.ndarray:
    """Interpolate a table within its axes; SciPy's takes half an `import jax`."""
    total, cells = np.zeros_like(places[0]), []
    for x, axis in zip(places, axes, strict=True):
        left = np.clip(np.searchsorted(axis, x) - 1, 0, len(axis) - 2)
        share = (x - axis[left]) / (axis[left + 1] - axis[left])
        cells.append(((left, 1.0 - share), (left + 1, share)))
    for corner in product(*cells):
        at, weights = zip(*corner, strict=True)
        total = total + np.prod(weights, axis=0) * values[at]
    return total
