"""Where the truth of a thousand random worlds ranks, by `fit_many` and weights.

    python -m calibration.world_weights [SECONDS [WORLDS [PROCESSES]]]

Worlds and subsets of readings are those of `calibration.world_subsets`. All logs of a
part are fitted at once; about the optimum of each 16,000 draws, half of them Student-t,
are weighted by its posterior (Pareto smoothed), and the truth is ranked among them.

Rows are added to calibration/results/world_weights.csv, a part of one subset after
another; what the file holds already is not done again, and after so many seconds no
part is begun. `calibration.world_round_trip` makes tables of it.
"""

import sys
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from calibration.world_answers import Answer, go_on
from calibration.world_fits import (
    least_at,
    posteriors,
    truth_of,
    weighted,
    worlds,
)
from calibration.world_subsets import PARTS, SUBSETS, sharpness
from jblast.inference import batch_of, fit_many
from jblast.observations.grouping import some_rows
from jblast.scene.reader.scene import world_from_document
from jblast.world import scene_of_one_blast

WORLDS, AT_ONCE = 1000, 100
KEPT = Path(__file__).parent / "results" / "world_weights.csv"


def answers(subset: str, seeds: Sequence[int]) -> list[Answer]:
    """Fit worlds at once by a subset, and weight draws about each optimum."""
    document = next(document for document, subsets in PARTS if subset in subsets)
    uncertain, spec = world_from_document(document, "world_round_trip")
    one = scene_of_one_blast(uncertain, spec)
    told = worlds(uncertain, spec, tuple(one.beliefs), seeds)
    quantities = SUBSETS[subset]
    rows = np.flatnonzero(np.isin(told[0].log.quantity, quantities))
    logs = [some_rows(world.log, rows) for world in told]
    fitted = fit_many(one, *batch_of(logs, one))
    places, spread = np.asarray(fitted.z), np.asarray(fitted.covariance)
    settled = np.asarray(fitted.converged)
    found, densities = [], posteriors(told, one, quantities)
    for i, (world, posterior) in enumerate(zip(told, densities, strict=True)):
        if not (np.isfinite(spread[i]).all() and np.isfinite(places[i]).all()):
            raise ValueError(f"{subset}, world {world.seed}: expected an optimum")
        truth = truth_of(posterior.parameters, world.truth)
        root = np.linalg.cholesky(spread[i])
        drawn = weighted(posterior, places[i], root, world.seed)
        sd, least = sharpness(
            posterior.parameters,
            drawn.z,
            drawn.weights,
            truth,
            least_at(posterior, truth),
        )
        rank = tuple(float(x) for x in drawn.weights @ (drawn.z < truth))
        about = subset, world.seed, "weights", bool(settled[i]), drawn.k_hat
        found.append(Answer(*about, sd, least, rank))
    return found


def main(seconds: int = 540, count: int = WORLDS, processes: int = 1) -> None:
    """Answer part after part until the time is up."""
    go_on(KEPT, tuple(SUBSETS), count, AT_ONCE, answers, seconds, processes)


if __name__ == "__main__":
    main(*map(int, sys.argv[1:]))
