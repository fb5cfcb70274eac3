"""Where the truth of random worlds ranks, as `--posterior auto` answers them.

    python -m calibration.world_autos [SECONDS [WORLDS [PROCESSES]]]

Worlds and subsets of readings are those of `calibration.world_round_trip`. Each world's
fit goes as `auto` goes: its normal approximation, where importance sampling finds
nothing against it and all numbers are narrow; else walkers, from every optimum that
counts, until the quantiles are known to 0.05 sd. Here the walk's moves are compiled
(`sampler="scan"`), which takes a fifth of the time of emcee's, whose moves they are.

A row a world is added to calibration/results/world_autos.csv, a few worlds of each
subset in turn; what the file holds already is not done again, and after so many seconds
none is begun. `calibration.world_round_trip` makes tables of it.
"""

import sys
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from calibration.world_answers import Answer, go_on
from calibration.world_fits import Solved, least_at, solutions, worlds
from calibration.world_subsets import PARTS, SUBSETS, sharpness
from jblast.inference.importance import (
    importance,
    laplace_holds,
    largest_log_sd,
    largest_quantile_error,
)
from jblast.inference.mcmc.ensemble import ensemble
from jblast.scene.reader.scene import world_from_document
from jblast.world import scene_of_one_blast

WORLDS = 200
AT_ONCE = 5
DRAWS = 8000
KEPT = Path(__file__).parent / "results" / "world_autos.csv"


def answer(subset: str, solved: Solved) -> Answer:
    """Answer one world as `auto` does."""
    seed, posterior, found, identified, normal, truth = solved
    if len(identified.null):
        raise ValueError(f"{subset}, world {seed}: expected all to be identified")
    weighted = importance(posterior, normal, seed=seed)
    if laplace_holds(
        weighted.k_hat,
        largest_log_sd(posterior, normal),
        largest_quantile_error(weighted, normal),
    ):
        method, reached = "laplace", normal.converged
        z = normal.draws(DRAWS, np.random.default_rng(seed))
    else:
        walk = ensemble(posterior, normal, identified, found, seed=seed, sampler="scan")
        method, reached, z = "walk", walk.converged, walk.draws(DRAWS)
    alike = np.full(len(z), 1 / len(z))
    sd, least = sharpness(
        posterior.parameters, z, alike, truth, least_at(posterior, truth)
    )
    rank = tuple(float(x) for x in np.mean(z < truth, axis=0))
    return Answer(subset, seed, method, reached, weighted.k_hat, sd, least, rank)


def answers(subset: str, seeds: Sequence[int]) -> list[Answer]:
    """Draw worlds, read them, and answer them by a subset."""
    document = next(document for document, subsets in PARTS if subset in subsets)
    uncertain, spec = world_from_document(document, "world_round_trip")
    one = scene_of_one_blast(uncertain, spec)
    told = worlds(uncertain, spec, tuple(one.beliefs), seeds)
    solved = solutions(told, one, SUBSETS[subset])
    return [answer(subset, world) for world in solved]


def main(seconds: int = 540, count: int = WORLDS, processes: int = 1) -> None:
    """Answer world after world until the time is up."""
    go_on(KEPT, tuple(SUBSETS), count, AT_ONCE, answers, seconds, processes)


if __name__ == "__main__":
    main(*map(int, sys.argv[1:]))
