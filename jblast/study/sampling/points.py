"""Where draws lie in the unit cube, for designs that are not random draws by key.

Sobol' points are scrambled by the seed, so that they are unbiased, and made from any
place on; a Latin hypercube has as many rows as the study has draws, and a grid is the
middles of equal parts along each number, the first number the fastest.
"""

from collections.abc import Callable

import numpy as np
from jaxtyping import Float
from scipy.special import ndtri
from scipy.stats import qmc

from jblast.errors import InputError
from jblast.study.file.study import Design

MOST_LATIN = 20_000_000
"""Draws of a Latin hypercube, which is made whole."""
MOST_SOBOL = 21_201
"""Dimensions that SciPy has direction numbers for."""

BITS = 32
"""Of a Sobol point: of more SciPy passes over none. There are 2^32 points."""

Points = Callable[[int, int], Float[np.ndarray, "draw dimension"]]
"""From the first draw and how many, to standard normal coordinates."""


def points_of(
    design: Design, dimensions: int, draws: int, seed: int, source: str
) -> Points | None:
    """Return what gives the points of a design; None where keys draw them.

    Args:
        design: How draws fill what the priors allow.
        dimensions: How many numbers are drawn.
        draws: How many draws there are.
        seed: Of the design.
        source: The study's file, for messages.

    Raises:
        InputError: The design cannot be made for so many numbers, or draws.
    """
    if design == "random" or dimensions == 0:
        return None
    if design == "sobol":
        return _sobol(dimensions, seed)
    if design == "latin":
        if draws > MOST_LATIN:
            raise InputError(
                f"{source}: samples: expected at most {MOST_LATIN:,} of a Latin "
                f'hypercube, got {draws:,}; design = "sobol" has no such limit'
            )
        made: list[np.ndarray] = []

        def latin(begin: int, count: int) -> np.ndarray:
            if not made:
                made.append(qmc.LatinHypercube(dimensions, rng=seed).random(draws))
            rows = np.minimum(np.arange(begin, begin + count), draws - 1)
            return _scores(made[0][rows])

        return latin
    return _grid(dimensions, draws, source)


def _sobol(dimensions: int, seed: int) -> Points:
    def sobol(begin: int, count: int) -> np.ndarray:
        engine = qmc.Sobol(dimensions, scramble=True, bits=BITS, rng=seed)
        if begin:  # SciPy takes no step of nothing
            engine.fast_forward(begin)
        with np.errstate(all="ignore"):
            return _scores(engine.random(count))

    return sobol


def _grid(dimensions: int, draws: int, source: str) -> Points:
    """Return the points of a grid of as many parts along each number."""
    each = round(draws ** (1 / dimensions))
    if each**dimensions != draws:
        near = [max(1, each - 1) ** dimensions, each**dimensions]
        near.append((each + 1) ** dimensions)
        raise InputError(
            f"{source}: samples: expected a number of points of a grid over "
            f"{dimensions} drawn numbers, as {' or '.join(map(str, near))}, got {draws}"
        )

    def grid(begin: int, count: int) -> np.ndarray:
        at = np.minimum(np.arange(begin, begin + count), draws - 1)
        parts = at[:, None] // each ** np.arange(dimensions) % each
        return _scores((parts + 0.5) / each)

    return grid


def _scores(unit: np.ndarray) -> np.ndarray:
    """Return standard normal coordinates, the corners of the cube left out."""
    tiny = 2.0**-53
    return ndtri(np.clip(unit, tiny, 1 - tiny))
