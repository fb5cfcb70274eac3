"""The cheapest method that is accurate enough for a scene.

For all paths from charges to sensors, and for both ends of the priors, the predicted
error of a method is the larger of its measured difference from the reference and the
uncertainty of the reference. The choice is the cheapest method within the tolerance,
else the most accurate one. Costs within a factor of two count as equal, because a busy
machine changes them by as much.
"""

import math
import os
from collections.abc import Sequence
from dataclasses import dataclass, replace
from statistics import NormalDist

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from jblast.errors import InputError, nearest
from jblast.fidelity.errors import (
    REFERENCES,
    Conditions,
    continues_reference,
    cost_table,
    covers,
    is_covered,
    is_reference,
    jitted_conditions,
    reference_uncertainty,
    relative_errors,
)
from jblast.kept_programs import kept_between_runs
from jblast.progress import Progress, each, reported
from jblast.quantities import DERIVED_QUANTITIES, QUANTITIES, TIMES, components
from jblast.registry import Law, law_for, names_for
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
from jblast.waves.height_of_burst import burst_notes, scaled_height
from jblast.waves.paths import Path, path_between

# In quadrature a method error of this size widens the total by 5 %.
SHARE_OF_SIGMA = 1.0 / 3.0
"""Default tolerance, as a share of the standard error of the data."""
# A busy machine changes the cost of a method by as much.
ALIKE = 2.0
"""Costs within this factor count as equal. Of methods of equal cost, the one with the
smallest predicted error is chosen."""
SCORES = tuple(NormalDist().inv_cdf(p) for p in (0.05, 0.95))
"""Standard normal scores of the bounds of a 90 % interval."""
# Of the order of the radius of a bare charge of TNT, 0.053 m/kg^(1/3).
ON_THE_GROUND = 0.05
"""Scaled height or depth of burst up to which a method without them as inputs is
accepted where the reference has them [m/kg^(1/3)]."""


@dataclass(frozen=True)
class Candidate:
    """One method for a quantity, at all positions of a scene.

    Attributes:
        method: Name of the method.
        error: Largest relative difference from the reference; infinite where the method
            or the reference is not valid.
        predicted_error: The larger of `error` and the uncertainty of the reference.
        cost_s: Time of a reading in a large batch [s]; NaN if it was not measured.
        valid: True if the method is valid at all positions.
        is_reference: True if the method is the reference at all positions.
    """

    method: str
    error: float
    predicted_error: float
    cost_s: float
    valid: bool
    is_reference: bool


@dataclass(frozen=True)
class Choice:
    """The cheapest method within the tolerance, or else the most accurate one.

    Attributes:
        quantity: Requested quantity.
        method: Name of the method.
        predicted_error: Predicted relative error of the method; null if unknown.
        tolerance: Requested relative error; zero requests the most accurate method.
        met: True if the method is within the tolerance.
        cost_s: Time of a reading [s].
        candidates: All examined methods, the cheapest first.
        span: Smallest and largest scaled distance [m/kg^(1/3)].
        reference_uncertainty: Relative uncertainty of the reference in that span.
        notes: Contradictions between stated curve sets and heights, a sentence each.
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


@kept_between_runs()
@reported("choose")
def choose(
    scene: UncertainScene | Scene | str | os.PathLike[str],
    quantity: str,
    tolerance: float | None = None,
    *,
    progress: Progress = False,
) -> Choice:
    """Return the cheapest method that is accurate enough for the sensors of a scene.

    Args:
        scene: Charge, air and sensors, or their file; a number with a prior counts over
            its 90 % interval.
        quantity: Quantity that the sensors measure.
        tolerance: Largest accepted relative error; None for a third of the smallest
            standard error of the sensors.
        progress: As for `jblast.fit`.

    Returns:
        The method with its measured error and cost, and the other candidates
        (`report.reason_for` gives the reason in words).

    Raises:
        InputError: The quantity is unknown, no sensor records it, no law gives it, a
            sensor has no position, the tolerance is not positive, or a number that
            determines the choice is free.

    Example:
        `jblast.choose("scene.toml", "air_arrival_s", 0.01).method`
    """
    uncertain = scene_of(scene)
    if tolerance is not None and not (tolerance > 0 and math.isfinite(tolerance)):
        raise InputError(f"tolerance: expected a positive number, got {tolerance}")
    sensors = sensors_for(uncertain.scene, quantity)
    if not names_for(quantity):
        raise InputError(f"no law gives {quantity}: not supported yet")
    paths = by_curves(paths_in(uncertain, quantity, sensors))
    conditions = [
        jax.tree.map(np.asarray, jitted_conditions(quantity, path))
        for path in each(paths, "paths")
    ]
    if tolerance is None:
        sigma = np.array([dict(s.records).get(quantity, math.nan) for s in sensors])
        tolerance = tolerance_of(
            sigma, quantity, conditions[: len(uncertain.scene.charges)]
        )
    choice = choose_for(quantity, conditions, tolerance)
    notes = _height_notes(uncertain.scene, quantity, sensors)
    return replace(choice, notes=notes)


def _height_notes(
    scene: Scene, quantity: str, sensors: Sequence[Sensor]
) -> tuple[str, ...]:
    """Return notes on the curves of charges off the ground."""
    position, notes = jnp.stack([sensor.position_m for sensor in sensors]), []
    for charge in scene.charges:
        path = tnt_path(scene, replace(charge, burst=None), quantity, position)
        height = float(scaled_height(scene, charge))
        weight = np.broadcast_to(path.free_air, len(sensors))
        notes += burst_notes(charge, (height, height), weight, "sensor")
    return tuple(notes)


def tolerance_of(
    sigma: Float[np.ndarray, " place"], quantity: str, conditions: Sequence[Conditions]
) -> float:
    """Return a third of the smallest relative sigma; zero if none is stated.

    Args:
        sigma: Standard error at each position: seconds for times, else relative; NaN if
            not stated.
        quantity: Quantity of the standard errors.
        conditions: Conditions from each charge at these positions. The sigma of a time
            is divided by the travel time of sound.
    """
    shares = sigma
    if quantity in TIMES:
        longest = np.max([each.sound_time for each in conditions], axis=0)
        travels = longest > 0.0  # at the charge itself there is no travel time
        shares = shares[travels] / longest[travels]
    stated = shares[np.isfinite(shares)]
    return SHARE_OF_SIGMA * float(stated.min()) if stated.size else 0.0


def choose_for(
    quantity: str,
    conditions: Sequence[Conditions],
    tolerance: float,
) -> Choice:
    """Return the cheapest method that is accurate enough at all positions.

    Args:
        quantity: Quantity for which at least one law exists.
        conditions: Conditions from every charge at its positions.
        tolerance: Largest accepted relative error; zero requests the most accurate
            method.
    """
    z = np.concatenate([each.z for each in conditions])
    span = float(z.min()), float(z.max())
    uncertainty = worst_reference_uncertainty(quantity, conditions)
    candidates = sorted(candidates_for(quantity, conditions, uncertainty), key=_cost)
    accurate = [c for c in candidates if c.valid and c.predicted_error <= tolerance]
    if accurate:
        # The cheapest comes first, as candidates are sorted by cost.
        limit = ALIKE * _cost(accurate[0])
        alike = [c for c in accurate if _cost(c) <= limit]
        found = min(alike, key=lambda c: _preference(quantity, c, conditions))
    else:
        without_height = blind_to_height(quantity, conditions)
        # a method with the depth as input, even outside its range, before one without
        found = min(
            candidates,
            key=lambda c: (
                c.method in without_height,
                *_fallback_order(quantity, c, conditions),
            ),
        )
    return Choice(
        quantity=quantity,
        method=found.method,
        predicted_error=found.predicted_error,
        tolerance=tolerance,
        met=bool(accurate),
        cost_s=found.cost_s,
        candidates=tuple(candidates),
        span=span,
        reference_uncertainty=uncertainty,
    )


def _cost(candidate: Candidate) -> float:
    # a method without a measured cost is the last choice
    return math.inf if math.isnan(candidate.cost_s) else candidate.cost_s


def _fallback_order(
    quantity: str, candidate: Candidate, conditions: Sequence[Conditions]
) -> tuple:
    """Return the sort key of methods if none is accurate enough.

    Valid methods come first, then methods that are valid at the nearest position and at
    more positions, then methods that continue the reference. The rest of the key is
    `_preference`.
    """
    valid = np.concatenate([each.holds[candidate.method] for each in conditions])
    z = np.concatenate([each.z for each in conditions])
    return (
        not candidate.valid,
        not valid[z.argmin()],
        int((~valid).sum()),
        not continues_reference(quantity, candidate.method, z),
        *_preference(quantity, candidate, conditions),
    )


def _preference(
    quantity: str, candidate: Candidate, conditions: Sequence[Conditions]
) -> tuple:
    """Return the sort key of methods of equal cost.

    The smallest predicted error comes first. If that is the uncertainty of the
    reference, the reference without absorption comes first, because it is simpler.
    """
    branches = REFERENCES.get(quantity, ())
    names = list(
        dict.fromkeys([p.lossless for p in branches] + [p.law for p in branches])
    )
    plain = all(
        is_reference(quantity, candidate.method, np.asarray(each.z), lossless=True)
        for each in conditions
    )
    rank = names.index(candidate.method) if candidate.method in names else len(names)
    return candidate.predicted_error, not plain, rank, _cost(candidate)


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
    if not found:
        recorded = sorted({q for sensor in scene.sensors for q, _ in sensor.records})
        raise InputError(
            f"no sensor of the scene records {quantity}: expected a [[sensor]] with "
            f"records = {{ {quantity} = SIGMA }}, got "
            f"{', '.join(recorded) or 'no sensor at all'}"
        )
    return found


def paths_in(
    uncertain: UncertainScene, quantity: str, sensors: Sequence[Sensor]
) -> list[Path]:
    """Return the paths from every charge to sensors, with TNT-equivalent masses.

    The curve sets are not yet selected (see `by_curves`). Each number with a prior is
    varied to both bounds of its 90 % interval, one number at a time, with the others at
    their medians. The charge is the fastest index of the paths.

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
                "prior, because the choice of a method depends on it"
            )
        bounds = [belief.constrain(score) for score in SCORES]
        cases += [with_values(scene, {name: bound}) for bound in bounds]
    for sensor in sensors:
        # A charge with a range has its distance without any position.
        placed = scene.charge.range_m is not None
        if not placed and not np.isfinite(sensor.position_m).all():
            raise InputError(
                f"sensor {sensor.name!r}: expected position_m = [east, north, up] in "
                "its [[sensor]], got nothing"
            )
    position = jnp.stack([sensor.position_m for sensor in sensors])
    return [
        tnt_path(case, charge, quantity, position)
        for case in cases
        for charge in case.charges
    ]


def by_curves(paths: Sequence[Path]) -> list[Path]:
    """Return paths with the curve set that the height selects.

    Where the height allows both sets, a method has to be accurate for either at every
    position: the surface curves come first, the free-air ones after all others.
    """
    first, more = [], []
    for path in paths:
        if path.burst is not None:
            first.append(path)
            continue
        free = np.asarray(path.free_air) >= 1.0
        one = "free-air" if free.all() else "surface"
        first.append(replace(path, burst=one))
        if free.any() and not free.all():
            more.append(replace(path, burst="free-air"))
    return first + more


def tnt_path(scene: Scene, charge: Charge, quantity: str, position: Array) -> Path:
    """Return the paths from a charge to positions, with the TNT-equivalent mass."""
    nothing = jnp.full(len(position), jnp.nan)
    path = path_between(scene, charge, position, nothing, nothing)
    return replace(path, charge_mass=charge.tnt_mass(quantity))


def worst_reference_uncertainty(
    quantity: str, conditions: Sequence[Conditions]
) -> float:
    """Return the largest relative uncertainty of the reference; infinite if none."""
    if quantity not in REFERENCES:
        exact = all(law_for(quantity, name).is_exact() for name in names_for(quantity))
        return 0.0 if exact else math.inf
    if not all(is_covered(quantity, each).all() for each in conditions):
        return math.inf
    return max(
        float(reference_uncertainty(quantity, each).max()) for each in conditions
    )


def candidates_for(
    quantity: str, conditions: Sequence[Conditions], uncertainty: float
) -> list[Candidate]:
    """Return every method for the quantity, with errors and costs."""
    # without a measured table every law has the uncertainty of the reference
    if quantity in REFERENCES:
        of_paths = [relative_errors(quantity, each) for each in conditions]
        errors = {
            method: np.concatenate([each[method] for each in of_paths])
            for method in of_paths[0]
        }
    else:
        errors = {name: np.full(1, uncertainty) for name in names_for(quantity)}
    without_height = blind_to_height(quantity, conditions)
    costs = cost_table()
    found = []
    for method, error in errors.items():
        worst = math.inf if method in without_height else float(error.max())
        found.append(
            Candidate(
                method=method,
                error=worst,
                predicted_error=max(worst, uncertainty),
                cost_s=costs.get((quantity, method), math.nan),
                valid=all(np.all(each.holds[method]) for each in conditions),
                is_reference=all(
                    is_reference(quantity, method, np.asarray(each.z))
                    for each in conditions
                ),
            )
        )
    return found


def blind_to_height(quantity: str, conditions: Sequence[Conditions]) -> set[str]:
    """Return the methods without a height or depth of the charge as input.

    The set is empty if the charge is on the ground, or if the reference has no such
    input either.
    """
    for one in conditions:
        z = np.asarray(one.z)
        branches = REFERENCES.get(quantity, ())
        laws = [law_for(quantity, p.law) for p in branches if covers(p, z).any()]
        lifted = np.abs(one.scaled_height).max() > ON_THE_GROUND
        if lifted and any(map(_has_height, laws)):
            return {
                method
                for method in one.holds
                if not _has_height(law_for(quantity, method))
            }
    return set()


def _has_height(law: Law) -> bool:
    return "height_of_burst" in law.arguments()


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
