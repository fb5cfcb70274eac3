"""The measured tables in `data/`: CSV with a commented header that dates it.

`calibration/fidelity.py` writes them, here they are read.
"""

import csv
from functools import cache
from importlib.resources import files
from typing import NamedTuple

import numpy as np
from jaxtyping import Float

DATA = files("jblast.fidelity") / "data"


class Errors(NamedTuple):
    """How far every method is off, for one quantity and burst.

    Attributes:
        log_z: ln of the scaled distances [m/kg^(1/3)].
        log_ratio: By method, ln of it over its lossless reference, for 1 kg in standard
            air; NaN where that is not known.
        exponents: By method, powers of mass [kg] and of ambient over standard pressure.
    """

    log_z: Float[np.ndarray, " node"]
    log_ratio: dict[str, Float[np.ndarray, " node"]]
    exponents: dict[str, tuple[float, float]]


class Losses(NamedTuple):
    """ln of what absorption leaves of the peak, on a grid."""

    log_z: Float[np.ndarray, " node"]
    log_mass: Float[np.ndarray, " mass"]
    log_pressure: Float[np.ndarray, " pressure"]
    log_loss: Float[np.ndarray, "node mass pressure"]


class ReferenceUncertainty(NamedTuple):
    """How far a reference itself may be off, relative, over a span of Z.

    Attributes:
        start: Where the span begins [m/kg^(1/3)].
        end: Where it ends.
        error: $e_{ref}$ [-].
        evidence: What it was measured by.
    """

    start: float
    end: float
    error: float
    evidence: str


def rows(name: str) -> list[dict[str, str]]:
    """Read a table, by column name."""
    text = (DATA / f"{name}.csv").read_text(encoding="utf-8")
    lines = (line for line in text.splitlines() if not line.startswith("#"))
    return list(csv.DictReader(lines))


def head(name: str) -> str:
    """Return when, by what and on what a table was measured."""
    text = (DATA / f"{name}.csv").read_text(encoding="utf-8")
    lines = [line for line in text.splitlines() if line.startswith("#")]
    return " ".join(line.lstrip("# ") for line in lines)


@cache
def errors(quantity: str, burst: str) -> Errors:
    """Return the errors of all methods that give a quantity."""
    table = [row for row in rows(f"error_{quantity}") if row["burst"] == burst]
    methods = [name for name in table[0] if name not in ("burst", "z")]
    powers = {
        row["method"]: (float(row["per_ln_mass"]), float(row["per_ln_pressure"]))
        for row in rows("exponents")
        if row["quantity"] == quantity and row["burst"] == burst
    }
    return Errors(
        np.log([float(row["z"]) for row in table]),
        {
            name: np.array([float(row[name] or "nan") for row in table])
            for name in methods
        },
        powers,
    )


@cache
def losses(burst: str) -> Losses:
    """Return what absorption takes from the peak past the tables."""
    names = ("z", "mass_kg", "ambient_pressure_pa", "log_loss")
    mine = [row for row in rows("absorption") if row["burst"] == burst]
    table = np.array([[float(row[name]) for name in names] for row in mine])
    axes = [np.unique(column) for column in table.T[:3]]
    grid = np.empty([len(axis) for axis in axes])
    grid[tuple(map(np.searchsorted, axes, table.T[:3]))] = table[:, 3]
    z, mass, pressure = (np.log(axis) for axis in axes)
    return Losses(z, mass, pressure, grid)


@cache
def reference_uncertainties(
    quantity: str, burst: str
) -> tuple[ReferenceUncertainty, ...]:
    """Return how far a quantity's reference may be off, nearest span first."""
    return tuple(
        ReferenceUncertainty(
            float(row["z_from"]),
            float(row["z_to"]),
            float(row["e_ref"]),
            row["evidence"],
        )
        for row in rows("references")
        if row["quantity"] == quantity and row["burst"] == burst
    )


@cache
def costs() -> dict[tuple[str, str], float]:
    """Return what one reading costs by quantity and method [s]."""
    return {
        (row["quantity"], row["method"]): float(row["cost_s"]) for row in rows("costs")
    }
