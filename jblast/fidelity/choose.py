"""The cheapest method that is accurate enough for a scene.

For all paths from charges to sensors, and for both ends of the priors, the predicted
error of a method is the larger of its measured difference from the reference and the
uncertainty of the reference. The choice is the cheapest method within the tolerance,
else the most accurate one. Costs within a factor of two count as equal, because a busy
machine changes them by as much.
"""

import math
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
    SOLVER,
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
from jblast.quantities import DERIVED_QUANTITIES, QUANTITIES, TIMES, components
from jblast.registry import Law, law_for, names_for
from jblast.scene import (
    Charge,
    Scene,
    Sensor,
    UncertainScene,
    parameter_named,
    with_values,
)
from jblast.scene.charge import BURSTS, Burst
from jblast.scene.uncertain import Free
from jblast.waves.height_of_burst import burst_notes, scaled_height
from jblast.waves.paths import Path, path_between

SHARE_OF_SIGMA = 1.0 / 3.0
"""Default tolerance, as a share of the data's sigma. In quadrature a method error of
this size widens the total by 5 %."""
ALIKE = 2.0
"""Costs within this factor count as equal: a busy machine changes them by as much. Of
methods of equal cost, the one with the smallest predicted error is taken."""
SCORES = tuple(NormalDist().inv_cdf(p) for p in (0.05, 0.95))
"""Of the ends of a prior's 90 % interval."""
ON_THE_GROUND = 0.05
"""Scaled height or depth of burst up to which a method without them as inputs is
accepted where the reference has them [m/kg^(1/3)]."""


@dataclass(frozen=True)
class Candidate:
    """One method that gives the quantity, over all places of a scene.

    Attributes:
        method: Its name.
        error: Largest relative difference to the reference; infinite where the method
            or the reference does not hold.
        predicted_error: The larger of that and of how far the reference may be off.
        cost_s: Seconds a reading, many at once, where it was measured.
        valid: Whether it holds at all places.
        is_reference: Whether it is the reference everywhere.
    """

    method: str
    error: float
    predicted_error: float
    cost_s: float
    valid: bool
    is_reference: bool


@dataclass(frozen=True)
class Choice:
    """The method that suffices, or the most accurate one.

    Attributes:
        quantity: What was asked for.
        method: The cheapest method within the tolerance; else the best there is.
        predicted_error: Its relative error; null if nothing is known.
        tolerance: What was asked for, relative; zero asks for the best.
        met: Whether it suffices.
        cost_s: Seconds a reading.
        candidates: All methods that were looked at, the cheapest first.
        span: Smallest and largest scaled distance [m/kg^(1/3)].
        reference_uncertainty: How far the reference itself may be off there.
        by_height: Curve sets selected by height, for charges without a stated set.
        notes: What contradicts the heights, a sentence each.
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
    by_height: tuple[Burst, ...] = ()
    notes: tuple[str, ...] = ()


@kept_between_runs()
def choose(
    scene: Scene | UncertainScene, quantity: str, tolerance: float | None = None
) -> Choice:
    """Return the cheapest method that is good enough for a scene's sensors.

    Args:
        scene: Charge, air and sensors; a number with a prior counts over its 90 %
            interval.
        quantity: What the sensors are to measure.
        tolerance: Largest relative error allowed; None takes a third of the smallest
            sigma the sensors state.

    Returns:
        The method, the error it was measured to have, what it costs, and what else was
        examined (`report.reason_for` words the reason).

    Raises:
        InputError: There is no such quantity, no sensor for it, no law or no place, the
            tolerance is no positive number, or a number that decides is free.

    Example:
        `jblast.choose(jblast.read_scene("scene.toml"), "air_arrival_s", 0.01).method`
    """
    uncertain = scene if isinstance(scene, UncertainScene) else UncertainScene(scene)
    if tolerance is not None and not (tolerance > 0 and math.isfinite(tolerance)):
        raise InputError(f"tolerance: expected a positive number, got {tolerance}")
    sensors = sensors_for(uncertain.scene, quantity)
    if not names_for(quantity):
        raise InputError(f"no law gives {quantity}: not supported yet")
    unsettled = paths_in(uncertain, quantity, sensors)
    paths = by_curves(unsettled)
    conditions = [
        jax.tree.map(np.asarray, jitted_conditions(quantity, path)) for path in paths
    ]
    if tolerance is None:
        sigma = np.array([dict(s.records).get(quantity, math.nan) for s in sensors])
        tolerance = tolerance_of(
            sigma, quantity, conditions[: 1 + len(uncertain.scene.others)]
        )
    choice = choose_for(quantity, conditions, tolerance)
    by_height, notes = _of_heights(uncertain.scene, unsettled, quantity, sensors)
    return replace(choice, by_height=by_height, notes=notes)


def _of_heights(
    scene: Scene, unsettled: Sequence[Path], quantity: str, sensors: Sequence[Sensor]
) -> tuple[tuple[Burst, ...], tuple[str, ...]]:
    """Return the curve sets selected by heights, and contradictions.

    Args:
        scene: The charges.
        unsettled: The paths from every charge, and again at every end of a prior.
        quantity: What is measured.
        sensors: Where.
    """
    place = jnp.stack([sensor.position_m for sensor in sensors])
    by_height, notes = [], []
    for n, charge in enumerate(scene.charges):
        if charge.burst is None:
            by_height += unsettled[n :: len(scene.charges)] if charge.up > 0.0 else []
            continue
        path = tnt_path(scene, replace(charge, burst=None), quantity, place)
        height = float(scaled_height(scene, charge))
        free = np.asarray(path.free_air)
        notes += burst_notes(charge, (height, height), free, "sensor")
    left = {path.burst for path in by_curves(by_height)} if by_height else set()
    return tuple(burst for burst in BURSTS if burst in left), tuple(notes)


def tolerance_of(
    sigma: Float[np.ndarray, " place"], quantity: str, conditions: Sequence[Conditions]
) -> float:
    """Return a third of the smallest sigma, relative; zero without any.

    Args:
        sigma: Of each place; seconds for times, else relative; NaN if not stated.
        quantity: What they are of.
        conditions: From each charge at these places. A time's sigma counts as a share
            of what sound would take.
    """
    shares = sigma
    if quantity in TIMES:
        longest = np.max([each.sound_time for each in conditions], axis=0)
        away = longest > 0.0  # at the charge itself there is no travel time
        shares = shares[away] / longest[away]
    stated = shares[np.isfinite(shares)]
    return SHARE_OF_SIGMA * float(stated.min()) if stated.size else 0.0


def choose_for(
    quantity: str,
    conditions: Sequence[Conditions],
    tolerance: float,
    *,
    laws_only: bool = False,
) -> Choice:
    """Return the cheapest method that is good enough over some places.

    Args:
        quantity: What is asked for; some law gives it.
        conditions: From every charge at its places.
        tolerance: Largest relative error allowed; zero asks for the best there is.
        laws_only: Whether the method has to be a law, as in a fit; the solver is then
            a candidate that is not taken.
    """
    z = np.concatenate([each.z for each in conditions])
    span = float(z.min()), float(z.max())
    uncertainty = worst_reference_uncertainty(quantity, conditions)
    candidates = sorted(candidates_for(quantity, conditions, uncertainty), key=_cost)
    taken = [c for c in candidates if not (laws_only and c.method == SOLVER)]
    enough = [c for c in taken if c.valid and c.predicted_error <= tolerance]
    if enough:
        most = ALIKE * _cost(enough[0])
        alike = [c for c in enough if _cost(c) <= most]
        found = min(alike, key=lambda c: _preference(quantity, c, conditions))
    else:
        blind = blind_to_height(quantity, conditions)
        # a method with the depth as input, even outside its range, before one without
        found = min(
            taken,
            key=lambda c: (c.method in blind, *_nearness(quantity, c, conditions)),
        )
    return Choice(
        quantity=quantity,
        method=found.method,
        predicted_error=found.predicted_error,
        tolerance=tolerance,
        met=bool(enough),
        cost_s=found.cost_s,
        candidates=tuple(candidates),
        span=span,
        reference_uncertainty=uncertainty,
    )


def _cost(candidate: Candidate) -> float:
    return math.inf if math.isnan(candidate.cost_s) else candidate.cost_s


def _nearness(
    quantity: str, candidate: Candidate, conditions: Sequence[Conditions]
) -> tuple:
    """Return what to compare methods by where none is good enough.

    First whether it holds at all places, then whether at the nearest and at how many,
    then whether it continues the reference, then as where several are.
    """
    holding = np.concatenate([each.holds[candidate.method] for each in conditions])
    z = np.concatenate([each.z for each in conditions])
    return (
        not candidate.valid,
        not holding[z.argmin()],
        int((~holding).sum()),
        not continues_reference(quantity, candidate.method, z),
        *_preference(quantity, candidate, conditions),
    )


def _preference(
    quantity: str, candidate: Candidate, conditions: Sequence[Conditions]
) -> tuple:
    """Return what to compare methods by that cost alike.

    First the error that can be promised; where that is the reference's, the
    reference without absorption, as the simpler one.
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
        InputError: There is no such quantity, or no such sensor.
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
            f"{quantity} is made of {' and '.join(parts)}: expected one of these"
        )
    found = tuple(
        sensor
        for sensor in scene.sensors
        if not sensor.records
        or quantity in DERIVED_QUANTITIES
        or any(quantity in dict(components(held)) for held, _ in sensor.records)
    )
    if not found:
        held = sorted({q for sensor in scene.sensors for q, _ in sensor.records})
        raise InputError(
            f"no sensor of the scene records {quantity}: expected a [[sensor]] with "
            f"records = {{ {quantity} = SIGMA }}, got "
            f"{', '.join(held) or 'no sensor at all'}"
        )
    return found


def paths_in(
    uncertain: UncertainScene, quantity: str, sensors: Sequence[Sensor]
) -> list[Path]:
    """Return the paths from every charge to some sensors; masses are those of TNT.

    Curve sets are not settled (see `by_curves`). A number with a prior is taken at both
    ends of its 90 % interval, one number at a time, the others at their medians; of the
    paths, the charges run fastest.

    Raises:
        InputError: A sensor has no place, or a number that decides is free.
    """
    scene = uncertain.scene
    cases = [scene]
    for name, belief in uncertain.beliefs.items():
        if not parameter_named(name).decides:
            continue
        if isinstance(belief, Free):
            raise InputError(
                f"{uncertain.source or 'scene'}: {name} is free: expected a value or a "
                "prior, as what suffices depends on it"
            )
        ends = [belief.constrain(score) for score in SCORES]
        cases += [with_values(scene, {name: end}) for end in ends]
    for sensor in sensors:
        placed = scene.charge.range_m is not None
        if not placed and not np.isfinite(sensor.position_m).all():
            raise InputError(
                f"sensor {sensor.name!r}: expected position_m = [east, north, up] in "
                "its [[sensor]], got nothing"
            )
    place = jnp.stack([sensor.position_m for sensor in sensors])
    return [
        tnt_path(case, charge, quantity, place)
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
        if path.free_air is None:
            first.append(path)
            continue
        free = np.asarray(path.free_air)
        one = "free-air" if free.all() else "surface"
        first.append(replace(path, burst=one, free_air=None))
        if free.any() and not free.all():
            more.append(replace(path, burst="free-air", free_air=None))
    return first + more


def tnt_path(scene: Scene, charge: Charge, quantity: str, place: Array) -> Path:
    """Return the path from a charge to places; the mass is that of TNT."""
    nothing = jnp.full(len(place), jnp.nan)
    path = path_between(scene, charge, place, nothing, nothing)
    return replace(path, charge_mass=charge.tnt_mass(quantity))


def worst_reference_uncertainty(
    quantity: str, conditions: Sequence[Conditions]
) -> float:
    """Return how far the reference may be off; infinite where there is none."""
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
    """Return every method that gives the quantity."""
    if quantity in REFERENCES:
        of_paths = [relative_errors(quantity, each) for each in conditions]
        errors = {
            method: np.concatenate([each[method] for each in of_paths])
            for method in of_paths[0]
        }
    else:
        errors = {name: np.full(1, uncertainty) for name in names_for(quantity)}
    blind = blind_to_height(quantity, conditions)
    costs = cost_table()
    found = []
    for method, error in errors.items():
        worst = math.inf if method in blind else float(error.max())
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

    None where it stands on the ground, or where the reference has no such input either.
    """
    for each in conditions:
        z = np.asarray(each.z)
        branches = REFERENCES.get(quantity, ())
        laws = [law_for(quantity, p.law) for p in branches if covers(p, z).any()]
        lifted = np.abs(each.scaled_height).max() > ON_THE_GROUND
        if lifted and any(map(_knows_height, laws)):
            return {
                method
                for method in each.holds
                if method == SOLVER or not _knows_height(law_for(quantity, method))
            }
    return set()


def _knows_height(law: Law) -> bool:
    return "height_of_burst" in law.arguments()


@dataclass(frozen=True)
class TakenLaw:
    """The law of a quantity.

    Attributes:
        name: Its name.
        choice: Its reason; None where the law was requested. The choice at the answer
            may be another method than the one taken before the answer was known.
    """

    name: str
    choice: Choice | None = None
