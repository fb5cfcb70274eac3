"""The solution of one log: draws of its posterior, and what they identify."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import jax
import numpy as np
from jaxtyping import Float

from jblast.errors import InputError, argument
from jblast.inference.answer import Answer
from jblast.inference.density import Density, density_of
from jblast.inference.identify import Identified, identified
from jblast.inference.sample import Draws, solve as drawn
from jblast.observations import Observations
from jblast.observations.clocks import refuse_unsolvable_clocks
from jblast.scene import UncertainScene
from jblast.sensors.simulated_readings import Noise
from jblast.waves.choice import TakenLaw


@dataclass(frozen=True)
class Solution:
    """Result of the inference for one log.

    Attributes:
        density: The posterior density.
        draws: Weighted draws of it.
        identified: What they identify.
        laws: The law of each quantity, with the reason for its choice.
        other_laws: Automatic choice at the answer, of quantities for which it is not
            the law of the fit.
    """

    density: Density
    draws: Draws
    identified: Identified
    laws: Mapping[str, TakenLaw]
    other_laws: Mapping[str, str]

    @property
    def answer(self) -> Answer:
        """The log at the most probable numbers."""
        return self.identified.answer

    @property
    def converged(self) -> bool:
        """True if the best mode was found more than once."""
        return self.draws.modes.met > 1

    @property
    def is_answer(self) -> bool:
        """True if it converged, its weights can be believed, and it is identified."""
        found = self.identified
        return self.converged and found.is_reliable and found.is_identifiable


def solve(
    observations: Observations,
    uncertain: UncertainScene,
    *,
    noise: Noise = "student",
    seed: int = 0,
    begin: Callable[[str], None] = lambda _: None,
) -> Solution:
    """Draw from the posterior of a log, and find what the draws identify.

    Args:
        observations: The log.
        uncertain: The scene and its uncertain parameters.
        noise: Distribution of the independent errors.
        seed: Seed of all random numbers.
        begin: Function that is called with the name of each stage.
    """
    if not uncertain.beliefs:
        raise InputError(
            "nothing to fit: every number of the scene is fixed; expected at least one "
            'that is "free", has a prior, or is named by ' + argument("freed")
        )
    refuse_unsolvable_clocks(observations, uncertain)
    # milliseconds of clocks of days, and differences of laws, need float64
    with jax.enable_x64(True):
        begin("choosing laws")
        density = density_of(observations, uncertain, noise)
        begin("searching")
        density, draws = drawn(density, seed)
        return solution_of(density, draws)


def solution_of(density: Density, draws: Draws) -> Solution:
    """Return the solution by given draws."""
    best = density.best(_mode_of(density, draws))
    there = density.choices_at(best)
    return Solution(
        density=density,
        draws=draws,
        identified=identified(density, draws, best),
        laws={
            quantity: TakenLaw(name, there[quantity].choice)
            for quantity, name in density.laws.items()
        },
        other_laws={
            quantity: law.name
            for quantity, law in there.items()
            if density.laws[quantity] != law.name
        },
    )


def _mode_of(density: Density, draws: Draws) -> Float[np.ndarray, " free"]:
    """Return the highest mode of the most probable region."""
    modes = draws.modes
    if len(modes.u) == 1:
        return modes.u[0]
    first = Answer(density, density.best(modes.u[0]), np.ones(draws.values.shape[1]))
    inside = Identified(first, draws).chosen
    top = draws.u[inside][draws.log_density[inside].argmax()]
    away = np.linalg.solve(modes.root, (top - modes.u)[..., None])
    return modes.u[int(np.argmin((away**2).sum((1, 2))))]
