"""No more than a scene needs: the cheapest method that is good enough for it."""

import math
from collections.abc import Sequence
from dataclasses import replace

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from jblast.errors import InputError
from jblast.fidelity import solver
from jblast.fidelity.candidates import (
    blind_to_height,
    candidates_for,
    worst_reference_uncertainty,
)
from jblast.fidelity.choice import Candidate, Choice
from jblast.fidelity.conditions import Conditions, jitted_conditions
from jblast.fidelity.reference import REFERENCES, continues_reference, is_reference
from jblast.fidelity.sensor_paths import by_curves, paths_in, sensors_for, tnt_path
from jblast.quantities import TIMES
from jblast.registry import names_for
from jblast.scene import Scene, Sensor, UncertainScene
from jblast.scene.charge import BURSTS, Burst
from jblast.waves.height_of_burst import burst_notes, scaled_height
from jblast.waves.paths import Path

SHARE_OF_SIGMA = 1.0 / 3.0
"""Of the data's sigma: the tolerance where none is told. In quadrature a method that
far off widens an error by 5 %."""

ALIKE = 2.0
"""Costs within this factor count as one: a busy machine moves them by as much. Of
methods that cost alike, the one with the smallest promised error is taken."""


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
        looked at: `report.reason_for` says why it.

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
    """Return which curve sets heights leave where none is said, and what is odd.

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
    """Return a third of the smallest sigma, relative; zero if none is told.

    Args:
        sigma: Of each place; seconds for times, else relative; NaN if not told.
        quantity: What they are of.
        conditions: From each charge at these places. A time's sigma counts as a share
            of what sound would take.
    """
    shares = sigma
    if quantity in TIMES:
        longest = np.max([each.sound_time for each in conditions], axis=0)
        away = longest > 0.0  # a sensor at the charge says nothing
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
    taken = [c for c in candidates if not (laws_only and c.method == solver.METHOD)]
    enough = [c for c in taken if c.valid and c.predicted_error <= tolerance]
    if enough:
        most = ALIKE * _cost(enough[0])
        alike = [c for c in enough if _cost(c) <= most]
        found = min(alike, key=lambda c: _preference(quantity, c, conditions))
    else:
        blind = blind_to_height(quantity, conditions)
        # one that knows of burial, out of its range, before any that does not
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
