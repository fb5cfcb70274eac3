"""Errors of methods: references, measurement, tables and errors at given positions.

For real TNT the reference is Kingery and Bulmash within the range of their tables.
Beyond it the reference of the peak is the weak shock with the absorption of ISO 9613-1,
up to the range where recorded peaks depart from it. The reference of impulse and
duration is there the recordings to which `ford_2021` was fitted. The uncertainty of a
reference, $e_{ref}$, is measured against recordings where there are any.

In scaled terms most laws are curves of Z alone, so the error for 1 kg in standard air
holds for all masses. Other dependences (Wu's and Hao's arrival obeys neither Hopkinson
nor Sachs) are products of powers with measured exponents. The absorption in the far
reference depends on frequency, and therefore on distance, mass and air. It is measured
on a separate grid. `calibration/fidelity.py` writes the tables in `data/`, CSV files
with a commented header that dates them.
"""

import csv
import dataclasses
import math
from functools import cache
from importlib.resources import files
from itertools import product
from typing import NamedTuple

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float

import jblast.waves as _waves  # noqa: F401  laws enter the registry as they are imported
from jblast.constants import STANDARD_PRESSURE
from jblast.kept_programs import kept
from jblast.registry import call, law_for, names_for
from jblast.scene import Air, Scene
from jblast.scene.charge import Burst
from jblast.waves.paths import Path, path_between
from jblast.waves.scaling import scaled_distance
from jblast.waves.shock import FAR_END

# Seventeen steps to a factor of 2 are 4 % each.
PER_OCTAVE = 17
_OCTAVES = np.arange(-164, 79) / PER_OCTAVE
# Beyond a join by more than the rounding of float64, so that the next reference holds.
JUST_PAST = 1.0 + 1e-9
# The range of `ford_2021`.
END = 1000.0
"""Largest scaled distance of a reference, except for the peak [m/kg^(1/3)]."""
FORD_START = 20.0
"""Smallest scaled distance of the recordings of `ford_2021` [m/kg^(1/3)]."""
KINGERY_BULMASH_END = 40.0
"""Largest scaled distance of the tables of Kingery and Bulmash [m/kg^(1/3)]."""
NODES = np.sort(
    np.concatenate(
        [
            KINGERY_BULMASH_END * 2.0**_OCTAVES,
            JUST_PAST * np.array([FORD_START, KINGERY_BULMASH_END]),
            [END],
        ]
    )
)
"""Scaled distances of the measured errors, from 0.05 [m/kg^(1/3)]: 4 % apart, and on
both sides of each join of two references."""
BURSTS: tuple[Burst, ...] = ("surface", "free-air")
# A factor of 2: the laws are powers, so the size of the step does not matter.
STEP = math.log(2.0)
"""Step in ln of mass and of ambient pressure for the measurement of exponents."""
# Smaller exponents are rounding: the law does not depend on mass or pressure.
NO_POWER = 1e-9
# From a detonator of 0.1 g to 1 kt; one node a decade, as the errors vary slowly.
MASSES = 10.0 ** np.arange(-4.0, 6.01)
# Up to the highest inhabited ground, by 1 km: 11 % of pressure from node to node.
ALTITUDES = np.arange(0.0, 5001.0, 1000.0)
FAR_NODES = np.exp(np.linspace(math.log(KINGERY_BULMASH_END), math.log(END), 17))
"""The grid of the absorption [kg], [m], [m/kg^(1/3)]."""
CONTINUATIONS = (
    ("positive_duration_s", "shock_kinematics"),
    ("positive_impulse_pa_s", "shock_kinematics"),
)
"""Laws that equal their reference within its range and are theory beyond it, where
another law was fitted to recordings. They serve records that need one law at all
distances, and are no candidates for a choice by measured errors."""
# Farther away the weather determines what is recorded.
MAX_DISTANCE = 5000.0
"""Largest distance of a stated error beyond the tables [m]."""
DATA = files("jblast.fidelity") / "data"
Numbers = Float[Array | np.ndarray, " place"]
Marks = Bool[Array | np.ndarray, " place"]


def standard_path(
    z: Float[np.ndarray, " place"],
    burst: Burst,
    mass: float = 1.0,
    altitude: float = 0.0,
) -> Path:
    """Return paths to scaled distances from a charge of TNT on the ground.

    Args:
        z: Scaled distances [m/kg^(1/3)].
        burst: Curve set.
        mass: Mass of the charge [kg].
        altitude: Altitude in the standard atmosphere [m].
    """
    scene = Scene(air=Air(altitude=altitude))
    charge = dataclasses.replace(scene.charge, mass_kg=jnp.asarray(mass), burst=burst)
    nothing = jnp.full(len(z), jnp.nan)
    here = path_between(scene, charge, jnp.zeros((len(z), 3)), nothing, nothing)
    scale = jnp.cbrt(mass * STANDARD_PRESSURE / here.ambient_pressure)
    distance = jnp.asarray(z) * scale
    return dataclasses.replace(here, slant_range=distance, ground_range=distance)


def methods_for(quantity: str) -> tuple[str, ...]:
    """Return the candidate methods for a quantity."""
    return tuple(
        name
        for name in names_for(quantity)
        if "time_since_detonation" not in law_for(quantity, name).arguments()
        and (quantity, name) not in CONTINUATIONS
    )


def value_of(quantity: str, method: str, path: Path) -> Float[np.ndarray, " place"]:
    """Return the value by a method, also outside its range (see `holds`).

    Args:
        quantity: Requested quantity.
        method: One of `methods_for`.
        path: Paths to every position, with the TNT-equivalent mass.
    """
    value = np.asarray(call(law_for(quantity, method).function, path))
    return np.broadcast_to(value, path.slant_range.shape)


def holds(quantity: str, method: str, path: Path) -> Bool[np.ndarray, " place"]:
    """Return True at positions where a method is valid."""
    valid = np.asarray(call(law_for(quantity, method).valid, path))
    return np.broadcast_to(valid, path.slant_range.shape)


def log_ratio(
    quantity: str, method: str, path: Path, *, lossless: bool = False
) -> Float[np.ndarray, " place"]:
    """Return ln of a method over its reference; NaN where the reference is invalid."""
    value = value_of(quantity, method, path)
    reference = np.asarray(reference_value(quantity, path, lossless=lossless))
    return np.log(value) - np.log(reference)


def log_ratios(quantity: str, burst: Burst) -> dict[str, Float[np.ndarray, " node"]]:
    """Return ln of every method over its lossless reference, at `NODES`."""
    path = standard_path(NODES, burst)
    return {
        method: log_ratio(quantity, method, path, lossless=True)
        for method in methods_for(quantity)
    }


def exponents(quantity: str, method: str, burst: Burst) -> tuple[float, float]:
    """Return the exponents of mass and of ambient pressure in a ratio to the reference.

    Both are at constant Z, and zero for a law that obeys Hopkinson and Sachs. Each is
    the median over all nodes, because a law may have another exponent outside its
    range.
    """
    path = standard_path(NODES, burst)
    plain = log_ratio(quantity, method, path, lossless=True)
    factor = math.exp(STEP)
    # Z is constant in both changes: the range grows with the root of mass or shrinks
    # with that of pressure
    distance = path.slant_range * factor ** (1.0 / 3.0)
    heavier = dataclasses.replace(
        path,
        slant_range=distance,
        ground_range=distance,
        charge_mass=path.charge_mass * factor,
    )
    distance = path.slant_range / factor ** (1.0 / 3.0)
    denser = dataclasses.replace(
        path,
        slant_range=distance,
        ground_range=distance,
        ambient_pressure=path.ambient_pressure * factor,
    )
    found = []
    for changed in (heavier, denser):
        step = log_ratio(quantity, method, changed, lossless=True) - plain
        known = step[np.isfinite(step)]
        power = float(np.median(known)) / STEP if known.size else 0.0
        found.append(0.0 if abs(power) < NO_POWER else power)
    return found[0], found[1]


def log_losses(burst: Burst) -> Float[np.ndarray, "node mass altitude"]:
    """Return ln of the far reference of pressure with over without absorption."""
    law = law_for("peak_overpressure_pa", "weak_shock_iso")
    plain = law_for("peak_overpressure_pa", "shock_kinematics")
    grid = np.empty((len(FAR_NODES), len(MASSES), len(ALTITUDES)))
    for j, mass in enumerate(MASSES):
        for k, altitude in enumerate(ALTITUDES):
            path = standard_path(FAR_NODES, burst, float(mass), float(altitude))
            grid[:, j, k] = np.log(
                call(law.function, path) / call(plain.function, path)
            )
    return grid


class Conditions(eqx.Module):
    """Conditions for a choice of method, by position.

    Attributes:
        z: Scaled distance [m/kg^(1/3)].
        slant_range: Distance from the charge [m].
        charge_mass: TNT-equivalent mass [kg].
        ambient_pressure: $P_0$ [Pa].
        sound_time: Travel time of sound [s].
        scaled_height: Height of burst over the same length as Z [m/kg^(1/3)].
        holds: True where a method is valid, by method.
        burst: "surface" or "free-air".
    """

    z: Numbers
    slant_range: Numbers
    charge_mass: Numbers
    ambient_pressure: Numbers
    sound_time: Numbers
    scaled_height: Numbers
    holds: dict[str, Marks]
    burst: Burst = eqx.field(static=True)


def relative_errors(quantity: str, conditions: Conditions) -> dict[str, Numbers]:
    """Return the relative error of every method at every position.

    The error is zero where a method is itself the reference. It is infinite where the
    method is invalid or no reference covers the position.

    Args:
        quantity: A key of `REFERENCES`.
        conditions: Conditions at every position.
    """
    # Errors are read from tables: evaluating every law would first compile it.
    table = error_table(quantity, conditions.burst)
    z = np.asarray(conditions.z)
    with np.errstate(divide="ignore"):  # a sensor at the charge has an infinite error
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
                # Exactly zero: interpolation would leave an error of rounding.
                ratio = np.where(covers(branch, z), 0.0, ratio)
        good = known & np.asarray(conditions.holds[method])
        error = np.abs(np.expm1(np.where(good, ratio, np.nan)))
        found[method] = np.where(np.isfinite(error), error, np.inf)
    return found


def is_covered(quantity: str, conditions: Conditions) -> Bool[np.ndarray, " place"]:
    """Return True at positions where a reference is valid."""
    z = np.asarray(conditions.z)
    spans = reference_uncertainties(quantity, conditions.burst)
    inside = (z >= spans[0].start) & (z <= spans[-1].end)
    return inside & ~is_too_far(z, conditions.slant_range)


def reference_uncertainty(
    quantity: str, conditions: Conditions
) -> Float[np.ndarray, " place"]:
    """Return the relative uncertainty of the reference at every position."""
    spans = reference_uncertainties(quantity, conditions.burst)
    ends = [span.end for span in spans[:-1]]
    errors = np.array([span.error for span in spans])
    return errors[np.searchsorted(ends, np.asarray(conditions.z))]


def _log_loss(quantity: str, burst: str, log_z, log_mass, log_pressure) -> np.ndarray:
    """Return ln of the loss by absorption beyond the tables; zero within them.

    Outside the masses and pressures of the grid, the nearest node is used within one
    step of it: the last steps change the loss by 2.6 % at most. Farther out the result
    is NaN.
    """
    lossy = any(branch.law != branch.lossless for branch in REFERENCES[quantity])
    far = log_z > math.log(KINGERY_BULMASH_END)
    if not (lossy and far.any()):
        return np.zeros_like(log_z)
    table = loss_table(burst)
    axes = (table.log_z, table.log_mass, table.log_pressure)
    here = np.broadcast_arrays(log_z, log_mass, log_pressure)
    points = [np.clip(x, axis[0], axis[-1]) for x, axis in zip(here, axes, strict=True)]
    loss = _trilinear(axes, table.log_loss, points)
    for x, axis in zip(here[1:], axes[1:], strict=True):
        known = (x >= 2 * axis[0] - axis[1]) & (x <= 2 * axis[-1] - axis[-2])
        loss = np.where(known, loss, np.nan)
    return np.where(far & (log_z <= math.log(END)), loss, 0.0)


def _trilinear(axes, values, points) -> np.ndarray:
    """Return a table interpolated linearly at points within its axes."""
    # not scipy.interpolate, whose import takes half as long as that of JAX
    total, cells = np.zeros_like(points[0]), []
    for x, axis in zip(points, axes, strict=True):
        left = np.clip(np.searchsorted(axis, x) - 1, 0, len(axis) - 2)
        share = (x - axis[left]) / (axis[left + 1] - axis[left])
        cells.append(((left, 1.0 - share), (left + 1, share)))
    for corner in product(*cells):
        at, weights = zip(*corner, strict=True)
        total = total + np.prod(weights, axis=0) * values[at]
    return total


class Branch(NamedTuple):
    """A law that is the reference over a span of scaled distances.

    Attributes:
        law: Name of the law.
        start: Lower limit of Z, exclusive [m/kg^(1/3)].
        end: Upper limit of Z, inclusive [m/kg^(1/3)].
        lossless: Name of the law without absorption; `law` if it has none.
    """

    law: str
    start: float
    end: float
    lossless: str


def _branch(law: str, start: float, end: float, lossless: str = "") -> Branch:
    return Branch(law, start, end, lossless or law)


NEAR_BRANCH = _branch("kingery_bulmash", 0.0, KINGERY_BULMASH_END)
REFERENCES: dict[str, tuple[Branch, ...]] = {
    "air_arrival_s": (
        NEAR_BRANCH,
        _branch("shock_kinematics", KINGERY_BULMASH_END, END),
    ),
    "peak_overpressure_pa": (
        NEAR_BRANCH,
        _branch("weak_shock_iso", KINGERY_BULMASH_END, FAR_END, "shock_kinematics"),
    ),
    "shock_speed_m_s": (
        NEAR_BRANCH,
        _branch("shock_kinematics", KINGERY_BULMASH_END, END),
    ),
    **dict.fromkeys(
        ("positive_impulse_pa_s", "positive_duration_s"),
        (
            _branch("kingery_bulmash", 0.0, FORD_START),
            _branch("ford_2021", FORD_START, END),
        ),
    ),
    **dict.fromkeys(
        ("reflected_pressure_pa", "reflected_impulse_pa_s"), (NEAR_BRANCH,)
    ),
}
"""Branches of the reference by quantity, nearest first; other quantities have none."""


def scaled_distances(path: Path) -> Float[np.ndarray, " place"]:
    """Return Z at every position of a path [m/kg^(1/3)]."""
    z = scaled_distance(path.slant_range, path.charge_mass, path.ambient_pressure)
    return np.atleast_1d(np.asarray(z))


def covers(
    branch: Branch, z: Float[np.ndarray, " place"]
) -> Bool[np.ndarray, " place"]:
    """Return True where a branch is the reference; a join belongs to the nearer one."""
    return (z > branch.start) & (z <= branch.end)


def is_reference(
    quantity: str, name: str, z: Float[np.ndarray, " place"], *, lossless: bool = False
) -> bool:
    """Return True if a method is the reference of a quantity at all scaled distances.

    Args:
        quantity: Any quantity; False for one without a reference.
        name: Name of the method.
        z: Scaled distances [m/kg^(1/3)].
        lossless: True for the reference without absorption.
    """
    branches = [
        branch
        for branch in REFERENCES.get(quantity, ())
        if name == (branch.lossless if lossless else branch.law)
    ]
    return bool(branches) and bool(
        np.any([covers(p, z) for p in branches], axis=0).all()
    )


def continues_reference(
    quantity: str, name: str, z: Float[np.ndarray, " place"]
) -> bool:
    """Return True if a method is the lossless reference or its continuation.

    At Z = 600 no method is valid for the peak. The weak shock continues the reference
    there; the power law that extrapolates the tables does not.
    """
    starts = [branch.start for branch in REFERENCES.get(quantity, ())]
    if not starts:
        return False
    # A join belongs to the nearer branch, as in `covers`.
    at = np.searchsorted(starts, z, side="left") - 1
    nearest = [REFERENCES[quantity][max(int(i), 0)].lossless for i in at]
    return all(law == name for law in nearest)


def is_too_far(
    z: Float[np.ndarray, " place"], slant_range: Float[Array | np.ndarray, " place"]
) -> Bool[np.ndarray, " place"]:
    """Return True beyond the tables where the distance exceeds `MAX_DISTANCE`."""
    return (z > KINGERY_BULMASH_END) & (np.asarray(slant_range) > MAX_DISTANCE)


def reference_value(
    quantity: str, path: Path, *, lossless: bool = False
) -> Float[Array, " place"]:
    """Return the value by the reference; NaN where there is none.

    Args:
        quantity: A key of `REFERENCES`.
        path: Paths to every position, with the TNT-equivalent mass.
        lossless: True for the reference without absorption.
    """
    z = scaled_distances(path)
    value = jnp.full(z.shape, jnp.nan)
    for branch in REFERENCES[quantity]:
        law = law_for(quantity, branch.lossless if lossless else branch.law)
        by_law = jnp.where(call(law.valid, path), call(law.function, path), jnp.nan)
        value = jnp.where(covers(branch, z), by_law, value)
    return jnp.where(is_too_far(z, path.slant_range), jnp.nan, value)


class Errors(NamedTuple):
    """Errors of every method, for one quantity and burst.

    Attributes:
        log_z: ln of the scaled distances [m/kg^(1/3)].
        log_ratio: ln of each method over its lossless reference, for 1 kg in standard
            air; NaN where it is unknown.
        exponents: Exponents of mass [kg] and of ambient over standard pressure, by
            method.
    """

    log_z: Float[np.ndarray, " node"]
    log_ratio: dict[str, Float[np.ndarray, " node"]]
    exponents: dict[str, tuple[float, float]]


class Losses(NamedTuple):
    """ln of the share of the peak that absorption leaves, on a grid."""

    log_z: Float[np.ndarray, " node"]
    log_mass: Float[np.ndarray, " mass"]
    log_pressure: Float[np.ndarray, " pressure"]
    log_loss: Float[np.ndarray, "node mass pressure"]


class ReferenceUncertainty(NamedTuple):
    """Relative uncertainty of a reference over a span of Z.

    Attributes:
        start: Lower limit of the span [m/kg^(1/3)].
        end: Upper limit of the span [m/kg^(1/3)].
        error: $e_{ref}$ [-].
        evidence: Measurement of the uncertainty.
    """

    start: float
    end: float
    error: float
    evidence: str


def table_rows(name: str) -> list[dict[str, str]]:
    """Read a table, by column name."""
    text = (DATA / f"{name}.csv").read_text(encoding="utf-8")
    lines = (line for line in text.splitlines() if not line.startswith("#"))
    return list(csv.DictReader(lines))


@cache
def error_table(quantity: str, burst: str) -> Errors:
    """Return the errors of all methods for a quantity."""
    table = [row for row in table_rows(f"error_{quantity}") if row["burst"] == burst]
    methods = [name for name in table[0] if name not in ("burst", "z")]
    powers = {
        row["method"]: (float(row["per_ln_mass"]), float(row["per_ln_pressure"]))
        for row in table_rows("exponents")
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
def loss_table(burst: str) -> Losses:
    """Return the loss of the peak by absorption beyond the tables."""
    names = ("z", "mass_kg", "ambient_pressure_pa", "log_loss")
    mine = [row for row in table_rows("absorption") if row["burst"] == burst]
    table = np.array([[float(row[name]) for name in names] for row in mine])
    axes = [np.unique(column) for column in table.T[:3]]
    grid = np.empty([len(axis) for axis in axes])
    # rows may be in any order: each is placed by its own coordinates
    grid[tuple(map(np.searchsorted, axes, table.T[:3]))] = table[:, 3]
    z, mass, pressure = (np.log(axis) for axis in axes)
    return Losses(z, mass, pressure, grid)


@cache
def reference_uncertainties(
    quantity: str, burst: str
) -> tuple[ReferenceUncertainty, ...]:
    """Return the uncertainties of the reference of a quantity, nearest span first."""
    return tuple(
        ReferenceUncertainty(
            float(row["z_from"]),
            float(row["z_to"]),
            float(row["e_ref"]),
            row["evidence"],
        )
        for row in table_rows("references")
        if row["quantity"] == quantity and row["burst"] == burst
    )


@cache
def cost_table() -> dict[tuple[str, str], float]:
    """Return the time of one reading, by quantity and method [s]."""
    return {
        (row["quantity"], row["method"]): float(row["cost_s"])
        for row in table_rows("costs")
    }


def conditions_of(quantity: str, path: Path) -> Conditions:
    """Return the conditions for a choice of method; may be jitted.

    Args:
        quantity: Requested quantity.
        path: Paths to every position, with the TNT-equivalent mass.
    """

    def each(number):
        return jnp.broadcast_to(number, path.slant_range.shape)

    z = scaled_distance(path.slant_range, path.charge_mass, path.ambient_pressure)
    holds = {
        name: call(law_for(quantity, name).valid, path) for name in names_for(quantity)
    }
    return Conditions(
        z=z,
        slant_range=path.slant_range,
        charge_mass=each(path.charge_mass),
        ambient_pressure=each(path.ambient_pressure),
        sound_time=path.slant_range / path.sound_speed,
        scaled_height=z * path.height_of_burst / path.slant_range,
        holds={name: each(where) for name, where in holds.items()},
        burst=path.burst or "surface",
    )


jitted_conditions = kept(conditions_of)
