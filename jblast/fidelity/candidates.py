"""Every method that gives a quantity, and how well it does over some places."""

import math
from collections.abc import Sequence

import numpy as np

from jblast.fidelity import error_tables as stored, solver
from jblast.fidelity.choice import Candidate
from jblast.fidelity.errors import is_covered, own_error, relative_errors
from jblast.fidelity.reference import REFERENCES, is_piece, refers
from jblast.fidelity.regimes import Ways
from jblast.registry import Law, law_for, names_for

ON_THE_GROUND = 0.05
"""Scaled height or depth of burst up to which a method that knows of neither will do
beside a reference that does [m/kg^(1/3)]."""


def worst_own_error(quantity: str, ways: Sequence[Ways]) -> float:
    """Return how far the reference may be off; infinite where there is none."""
    if quantity not in REFERENCES:
        exact = all(law_for(quantity, name).is_exact() for name in names_for(quantity))
        return 0.0 if exact else math.inf
    if not all(is_covered(quantity, each).all() for each in ways):
        return math.inf
    return max(float(own_error(quantity, each).max()) for each in ways)


def candidates_for(quantity: str, ways: Sequence[Ways], own: float) -> list[Candidate]:
    """Return every method that gives the quantity."""
    if quantity in REFERENCES:
        of_paths = [relative_errors(quantity, each) for each in ways]
        errors = {
            method: np.concatenate([each[method] for each in of_paths])
            for method in of_paths[0]
        }
    else:
        errors = {name: np.full(1, own) for name in names_for(quantity)}
    blind = blind_to_height(quantity, ways)
    costs = stored.costs()
    found = []
    for method, error in errors.items():
        worst = math.inf if method in blind else float(error.max())
        found.append(
            Candidate(
                method=method,
                error=worst,
                predicted_error=max(worst, own),
                cost_s=costs.get((quantity, method), math.nan),
                valid=all(np.all(each.holds[method]) for each in ways),
                is_reference=all(
                    refers(quantity, method, np.asarray(each.z)) for each in ways
                ),
            )
        )
    return found


def blind_to_height(quantity: str, ways: Sequence[Ways]) -> set[str]:
    """Return the methods that do not know how high or deep the charge is.

    None where it stands on the ground, or where the reference does not know either.
    """
    for each in ways:
        z = np.asarray(each.z)
        pieces = REFERENCES.get(quantity, ())
        laws = [law_for(quantity, p.law) for p in pieces if is_piece(p, z).any()]
        lifted = np.abs(each.scaled_height).max() > ON_THE_GROUND
        if lifted and any(map(_knows_height, laws)):
            return {
                method
                for method in each.holds
                if method == solver.METHOD
                or not _knows_height(law_for(quantity, method))
            }
    return set()


def _knows_height(law: Law) -> bool:
    return "height_of_burst" in law.arguments()
