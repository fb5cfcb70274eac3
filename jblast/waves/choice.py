"""The most accurate law for a scene, and whether it is accurate enough.

All laws of a quantity are evaluated on all paths from charges to sensors, and for both
bounds of the priors. The predicted error of a law is the larger of its difference from
the reference and the uncertainty of the reference. Of laws with equal errors the choice
is the reference itself, without absorption if that is equal too.

For real TNT the reference is Kingery and Bulmash within the range of their tables.
Beyond it the reference of the peak is the weak shock with the absorption of ISO 9613-1,
up to the range where recorded peaks depart from it. The reference of impulse and
duration is there the recordings to which `ford_2021` was fitted. The uncertainty of a
reference, $e_{ref}$, is measured against recordings where there are any:
`calibration/fidelity.py` writes `waves/data/references.csv` and, for information, the
time of one reading (`costs.csv`).
"""

import math
import os
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cache
from statistics import NormalDist
from typing import Any, NamedTuple

import numpy as np

import jblast.waves as _waves  # noqa: F401  laws enter the registry as they are imported
from jblast.errors import InputError, nearest, require
from jblast.progress import Progress, reported
from jblast.quantities import DERIVED_QUANTITIES, QUANTITIES, TIMES, components
from jblast.registry import PACKAGED, Law, law_for, names_for
from jblast.scene import (
    Charge,
    Scene,
    Sensor,
    UncertainScene,
    parameter_named,
    scene_of,
    with_values,
)
from jblast.scene.uncertain import Free
from jblast.types import Bool, Float, Int, in_numpy, unconverted
from jblast.waves.height_of_burst import burst_notes, scaled_height
from jblast.waves.paths import Evaluated, Path, evaluate, path_between
from jblast.waves.scaling import scaled_distance
from jblast.waves.tables import data_rows

# In quadrature a method error of this size widens the total by 5 %.
SHARE_OF_SIGMA = 1.0 / 3.0
"""Default tolerance, as a share of the standard error of the data."""
SCORES = tuple(NormalDist().inv_cdf(p) for p in (0.05, 0.95))
"""Standard normal scores of the bounds of a 90 % interval."""
# Of the order of the radius of a bare charge of TNT, 0.053 m/kg^(1/3).
ON_THE_GROUND = 0.05
"""Scaled height or depth of burst up to which a law without them as inputs is accepted
where the reference has them [m/kg^(1/3)]."""
# Farther away the weather determines what is recorded.
MAX_DISTANCE = 5000.0
"""Largest distance of a stated error beyond the tables [m]."""
TABLES_END = 40.0
"""Largest scaled distance of the tables of Kingery and Bulmash [m/kg^(1/3)]."""
CONTINUATIONS = (
    ("positive_duration_s", "shock_kinematics"),
    ("positive_impulse_pa_s", "shock_kinematics"),
)
"""Laws that equal their reference within its range and are theory beyond it, where
another law was fitted to recordings. They serve records that need one law at all
distances, and are no candidates for a choice by measured errors."""


@dataclass(frozen=True)
class Candidate:
    """One law for a quantity, at all positions of a scene.

    Attributes:
        method: Name of the law.
        error: Largest relative difference from the reference; infinite where the law or
            the reference is not valid.
        predicted_error: The larger of `error` and the uncertainty of the reference.
        cost_s: Time of a reading in a large batch [s]; NaN if it was not measured.
        valid: True if the law is valid at all positions.
        is_reference: True if the law is the reference at all positions.
    """

    method: str
    error: float
    predicted_error: float
    cost_s: float
    valid: bool
    is_reference: bool


@dataclass(frozen=True)
class Choice:
    """The most accurate law.

    Attributes:
        quantity: Requested quantity.
        method: Name of the law.
        predicted_error: Predicted relative error of the law; null if unknown.
        tolerance: Requested relative error; zero if none was requested.
        met: True if the law is within the tolerance.
        cost_s: Time of a reading [s].
        candidates: All examined laws, the best first.
        span: Smallest and largest scaled distance [m/kg^(1/3)].
        reference_uncertainty: Relative uncertainty of the reference in that span.
        notes: Curve sets of charges above the ground, a sentence each.
    """

    quantity: str
    method: str
    predicted_error: float
    tolerance: float
    met: bool
    cost_s: float
    candidates: tuple[Candidate, ...]
    span: tuple[float, float]
    reference_uncertainty: float
    notes: tuple[str, ...] = ()


class Reference(NamedTuple):
    """A law that is the reference of a quantity over a span of scaled distances.

    Attributes:
        start: Lower limit of Z [m/kg^(1/3)]; a limit belongs to the nearer span.
        end: Upper limit of Z [m/kg^(1/3)].
        law: Name of the law.
        lossless: Name of the law without absorption; `law` if it has none.
        error: Its relative uncertainty.
    """

    start: float
    end: float
    law: str
    lossless: str
    error: float


@cache
def references(quantity: str, burst: str = "surface") -> tuple[Reference, ...]:
    """Return the spans of the reference of a quantity, nearest first; () for none."""
    return tuple(
        Reference(
            float(row["z_from"]),
            float(row["z_to"]),
            row["law"],
            row["lossless"],
            float(row["e_ref"]),
        )
        for row in data_rows("references")
        if row["quantity"] == quantity and row["burst"] == burst
    )


@cache
def costs() -> dict[tuple[str, str], float]:
    """Return the time of one reading, by quantity and law [s]."""
    return {
        (row["quantity"], row["method"]): float(row["cost_s"])
        for row in data_rows("costs")
    }


@dataclass(frozen=True)
class Compared:
    """All laws of a quantity at some positions, and their differences from a reference.

    Attributes:
        quantity: The quantity.
        laws: The laws.
        z: Scaled distance of each position [m/kg^(1/3)].
        error: Relative difference of each law from the reference; infinite where a law
            is not valid, or no reference covers the position.
        valid: True where a law is valid.
        law: Index of the reference in `laws`, and of the reference without absorption;
            -1 if there is none.
        uncertainty: Relative uncertainty of the reference; infinite where none covers
            the position.
        lifted: True where the height or depth of burst matters.
    """

    quantity: str
    laws: tuple[Law, ...]
    z: Float[np.ndarray, " place"]
    error: Float[np.ndarray, "law place"]
    valid: Bool[np.ndarray, "law place"]
    law: Int[np.ndarray, "kind place"]
    uncertainty: Float[np.ndarray, " place"]
    lifted: Bool[np.ndarray, " place"]

    def choose(self, tolerance: float = 0.0, at: slice = slice(None)) -> Choice:
        """Return the most accurate law at some of the positions.

        Args:
            tolerance: Largest accepted relative error; zero for none.
            at: The positions.
        """
        z, error, valid = self.z[at], self.error[:, at], self.valid[:, at]
        references, lossless = self.law[:, at]
        own = float(self.uncertainty[at].max())
        # a law without the height is worse than any with it, also outside its range
        has_height = ["height_of_burst" in law.arguments() for law in self.laws]
        needs_height = self.lifted[at].any() and any(
            has_height[i] for i in np.unique(references) if i >= 0
        )
        keys = []
        for i, law in enumerate(self.laws):
            blind = bool(needs_height and not has_height[i])
            worst = math.inf if blind else float(error[i].max())
            found = Candidate(
                method=law.name,
                error=worst,
                predicted_error=max(worst, own),
                cost_s=costs().get((self.quantity, law.name), math.nan),
                valid=bool(valid[i].all()),
                is_reference=bool((references == i).all()),
            )
            # where no law is valid: the one that is valid nearest, and most often
            fallback = not found.valid, not valid[i, z.argmin()], int((~valid[i]).sum())
            plain = bool((lossless == i).all())
            order = blind, *fallback, found.predicted_error, not plain
            # the reference before laws that differ from it by less than its uncertainty
            keys.append(((*order, not found.is_reference, worst, i), found))
        candidates = tuple(found for _, found in sorted(keys, key=lambda key: key[0]))
        best = candidates[0]
        return Choice(
            quantity=self.quantity,
            method=best.method,
            predicted_error=best.predicted_error,
            tolerance=tolerance,
            met=best.valid and best.predicted_error <= tolerance,
            cost_s=best.cost_s,
            candidates=candidates,
            span=(float(z.min()), float(z.max())),
            reference_uncertainty=own,
        )


def compared(quantity: str, paths: Sequence[Path]) -> Compared:
    """Return all laws of a quantity on paths, and their differences from a reference.

    Args:
        quantity: Quantity with laws.
        paths: Paths from every charge to its positions, with the TNT-equivalent mass.
    """
    parts = [
        compared_on(path, evaluate(quantity, path), quantity)
        for path in map(in_numpy, paths)
    ]
    if len(parts) == 1:
        return parts[0]
    columns = ("z", "error", "valid", "law", "uncertainty", "lifted")
    joined: dict[str, Any] = {
        name: np.concatenate([getattr(part, name) for part in parts], axis=-1)
        for name in columns
    }
    return replace(parts[0], **joined)


def compared_on(path: Path, found: Evaluated, quantity: str) -> Compared:
    """Return the laws on a path, evaluated there, and their differences."""
    laws = [law_for(quantity, name) for name in found.names]
    measured = bool(references(quantity))
    kept = [i for i, law in enumerate(laws) if not measured or is_candidate(law)]
    names = [found.names[i] for i in kept]
    value, valid = found.value[kept], found.valid[kept]
    z = scaled_distance(path.slant_range, path.charge_mass, path.ambient_pressure)
    z = np.atleast_1d(z)
    value, valid = (np.broadcast_to(x, (len(kept), z.size)) for x in (value, valid))
    law, uncertainty = _reference(quantity, path, names, z)
    if measured:
        # NaN where a law has no value, and infinite at the charge itself
        with np.errstate(all="ignore"):
            error = np.abs(value / value[law[0], np.arange(z.size)] - 1.0)
        known = valid & np.isfinite(error) & np.isfinite(uncertainty)
        error = np.where(known, error, np.inf)
    else:  # without a reference all laws have the same predicted error
        error = np.broadcast_to(uncertainty, value.shape)
    with np.errstate(divide="ignore", invalid="ignore"):
        height = np.abs(z * path.height_of_burst / path.slant_range)
    return Compared(
        quantity=quantity,
        laws=tuple(laws[i] for i in kept),
        z=z,
        error=error,
        valid=valid,
        law=law,
        uncertainty=uncertainty,
        lifted=height > ON_THE_GROUND,
    )


def is_candidate(law: Law) -> bool:
    """Return whether a law may be chosen by its difference from a reference.

    A law from outside the package is used where it is named.
    """
    key = law.quantity, law.name
    needs_time = "time_since_detonation" in law.arguments()
    return PACKAGED.get(key) is law and not needs_time and key not in CONTINUATIONS


def _reference(
    quantity: str, path: Path, names: Sequence[str], z: Float[np.ndarray, " place"]
) -> tuple[Int[np.ndarray, "kind place"], Float[np.ndarray, " place"]]:
    """Return the references at each position, and their uncertainty.

    Outside of all spans the reference is the nearest one; its uncertainty is infinite.
    """
    law, uncertainty = np.full((2, z.size), -1), np.full(z.size, np.inf)
    if not references(quantity):
        exact = all(law_for(quantity, name).is_exact() for name in names)
        return law, np.full(z.size, 0.0 if exact else np.inf)
    free = path.free_air >= 0.5 if path.burst is None else path.burst == "free-air"
    too_far = (z > TABLES_END) & (path.slant_range > MAX_DISTANCE)
    for burst in ("surface", "free-air"):
        spans = references(quantity, burst)
        which = np.searchsorted([span.end for span in spans[:-1]], z)
        inside = (z >= spans[0].start) & (z <= spans[-1].end) & ~too_far
        mine = free == (burst == "free-air")
        indices = [[names.index(s.law), names.index(s.lossless)] for s in spans]
        errors = np.array([span.error for span in spans])[which]
        law = np.where(mine, np.array(indices).T[:, which], law)
        uncertainty = np.where(mine & inside, errors, uncertainty)
    return law, uncertainty


@reported("choose")
def choose(
    scene: UncertainScene | Scene | str | os.PathLike[str],
    quantity: str,
    tolerance: float | None = None,
    *,
    progress: Progress = False,
) -> Choice:
    """Return the most accurate law for the sensors of a scene.

    Args:
        scene: Charge, air and sensors, or their file; a number with a prior counts over
            its 90 % interval.
        quantity: Quantity that the sensors measure.
        tolerance: Largest accepted relative error; None for a third of the smallest
            standard error of the sensors.
        progress: As for `jblast.fit`.

    Returns:
        The law with its error, and the other candidates (`report.reason_for` gives the
        reason in words).

    Raises:
        InputError: The quantity is unknown, no sensor records it, no law gives it, a
            sensor has no position, the tolerance is not positive, or a number that
            determines the choice is free.

    Example:
        `jblast.choose("scene.toml", "air_arrival_s", 0.01).method`
    """
    uncertain = scene_of(scene)
    good = tolerance is None or (tolerance > 0 and math.isfinite(tolerance))
    require(good, "tolerance", "a positive number", tolerance)
    sensors = sensors_for(uncertain.scene, quantity)
    if not names_for(quantity):
        raise InputError(f"no law gives {quantity}: not supported yet")
    paths = paths_in(uncertain, quantity, sensors)
    if tolerance is None:
        sigma = np.array([dict(s.records).get(quantity, math.nan) for s in sensors])
        own = paths[: len(uncertain.scene.charges)]  # the others are bounds of priors
        tolerance = tolerance_of(sigma, quantity, own)
    choice = compared(quantity, paths).choose(tolerance)
    here, position = in_numpy(uncertain.scene), _positions(sensors)
    notes = []
    for charge in here.charges:
        path = _path(here, unconverted(charge, burst=None), quantity, position)
        height = float(scaled_height(here, charge))
        notes += burst_notes(charge, (height, height), path.free_air, "sensor")
    return replace(choice, notes=tuple(notes))


def tolerance_of(
    sigma: Float[np.ndarray, " place"], quantity: str, paths: Sequence[Path]
) -> float:
    """Return a third of the smallest relative sigma; zero if none is stated.

    Args:
        sigma: Standard error at each position: seconds for times, else relative; NaN if
            not stated.
        quantity: Quantity of the standard errors.
        paths: Paths from each charge to these positions. The sigma of a time is divided
            by the travel time of sound.
    """
    shares = sigma
    if quantity in TIMES:
        travel = [np.asarray(path.slant_range / path.sound_speed) for path in paths]
        longest = np.max(travel, axis=0)
        moves = longest > 0.0  # at the charge itself there is no travel time
        shares = shares[moves] / longest[moves]
    stated = shares[np.isfinite(shares)]
    return SHARE_OF_SIGMA * float(stated.min()) if stated.size else 0.0


def sensors_for(scene: Scene, quantity: str) -> tuple[Sensor, ...]:
    """Return the sensors of a scene that measure a quantity.

    A sensor without stated records may measure any quantity. A derived quantity
    (`shock_speed_m_s`) is computed at all sensors.

    Raises:
        InputError: The quantity is unknown or composed, or no sensor records it.
    """
    known = (*QUANTITIES, *DERIVED_QUANTITIES)
    if quantity not in known:
        raise InputError(
            f"unknown quantity {quantity!r}{nearest(quantity, known)}; expected one of "
            f"{', '.join(known)}"
        )
    parts = [part for part, _ in components(quantity)]
    if parts != [quantity]:
        raise InputError(
            f"{quantity} consists of {' and '.join(parts)}: expected one of these"
        )
    found = tuple(
        sensor
        for sensor in scene.sensors
        if not sensor.records
        or quantity in DERIVED_QUANTITIES
        or any(quantity in dict(components(recorded)) for recorded, _ in sensor.records)
    )
    recorded = sorted({q for sensor in scene.sensors for q, _ in sensor.records})
    require(
        found,
        f"no sensor of the scene records {quantity}",
        f"a [[sensor]] with records = {{ {quantity} = SIGMA }}",
        ", ".join(recorded) or "no sensor at all",
    )
    return found


def paths_in(
    uncertain: UncertainScene, quantity: str, sensors: Sequence[Sensor]
) -> list[Path]:
    """Return the paths from every charge to sensors, with TNT-equivalent masses.

    Each number with a prior is varied to both bounds of its 90 % interval, one number
    at a time, with the others at their medians. The charge is the fastest index of the
    paths.

    Raises:
        InputError: A sensor has no position, or a number that determines the choice is
            free.
    """
    scene = uncertain.scene
    # One number at a time: all combinations of the bounds would double with each.
    cases = [scene]
    for name, belief in uncertain.beliefs.items():
        if not parameter_named(name).decides:
            continue
        if isinstance(belief, Free):
            raise InputError(
                f"{uncertain.source or 'scene'}: {name} is free: expected a value or a "
                "prior, because the choice of a law depends on it"
            )
        bounds = [belief.constrain(score) for score in SCORES]
        cases += [with_values(scene, {name: bound}) for bound in bounds]
    for sensor in sensors:
        # A charge with a range has its distance without any position.
        has_range = scene.charge.range_m is not None
        require(
            has_range or np.isfinite(sensor.position_m).all(),
            f"sensor {sensor.name!r}",
            "position_m = [east, north, up] in its [[sensor]]",
            "nothing",
        )
    position = _positions(sensors)
    return [
        _path(case, charge, quantity, position)
        for case in map(in_numpy, cases)
        for charge in case.charges
    ]


def _positions(sensors: Sequence[Sensor]) -> Float[np.ndarray, "place 3"]:
    return np.stack([np.asarray(sensor.position_m) for sensor in sensors])


def _path(
    scene: Scene, charge: Charge, quantity: str, position: Float[np.ndarray, "place 3"]
) -> Path:
    nothing = np.full(len(position), np.nan)
    return tnt_path(scene, charge, quantity, position, nothing, nothing)


def tnt_path(
    scene: Scene,
    charge: Charge,
    quantity: str,
    position: Float[np.ndarray, "place 3"],
    stated_range: Float[np.ndarray, " place"],
    time_since_detonation: Float[np.ndarray, " place"],
) -> Path:
    """Return `path_between` in NumPy, with the TNT-equivalent mass for a quantity."""
    with np.errstate(over="ignore"):  # of positions that are refused later
        path = path_between(
            scene, charge, position, stated_range, time_since_detonation
        )
    return in_numpy(replace(path, charge_mass=charge.tnt_mass(quantity)))


@dataclass(frozen=True)
class TakenLaw:
    """The law of a quantity.

    Attributes:
        name: Name of the law.
        choice: Reason of the law; None if it was requested. The choice at the result of
            a fit may differ from the law that was chosen before the fit.
    """

    name: str
    choice: Choice | None = None
