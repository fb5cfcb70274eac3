"""What inference found, before it is put in words."""

from collections.abc import Callable, Mapping
from typing import NamedTuple

import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from jblast.fidelity import TakenLaw
from jblast.inference.identifiability.null_space import Identifiability
from jblast.inference.mode.laplace import Laplace
from jblast.inference.mode.range_profile import RangeProfile
from jblast.inference.mode.search import Optima
from jblast.inference.posterior.posterior import Posterior
from jblast.inference.posterior.record_likelihood import SampledRecords
from jblast.observations import Observations
from jblast.observations.records.formats import Scaling
from jblast.observations.table import SAMPLES
from jblast.scene import Scene
from jblast.sensors import Layout, resolve_laws
from jblast.sensors.law_choice import law_names, settled, with_bursts


class Solution(NamedTuple):
    """What inference found.

    Attributes:
        posterior: What was climbed.
        laws: The law of each quantity, and what it was taken by.
        laws_settled: Whether the automatic choice of law at the answer is that used.
        optima: The ends of the searches, the best first.
        identifiability: What the data tell of the parameters.
        laplace: The posterior about the best optimum.
        bursts_settled: Whether the curve sets that heights leave at the answer are
            those used.
        samples_known: To how much in ln the density of samples is known between the
            places where it was computed; None where no samples count.
        sight: The range of a charge beside a small array followed inwards and outwards;
            None where the array is not small, or the place not free.
    """

    posterior: Posterior
    laws: Mapping[str, TakenLaw]
    laws_settled: bool
    optima: Optima
    identifiability: Identifiability
    laplace: Laplace
    bursts_settled: bool = True
    samples_known: float | None = None
    sight: RangeProfile | None = None


class Choices(NamedTuple):
    """What is left to us before a search, and depends on where the answer lies.

    Attributes:
        scene: Its charges have the curve sets that their heights leave.
        layout: Says it row by row where a charge has both.
        laws: The law of each quantity, and what it was taken by.
    """

    scene: Scene
    layout: Layout
    laws: Mapping[str, TakenLaw]

    def as_for(self, there: "Choices") -> "Choices":
        """Return what another scene leaves, for the numbers of this one."""
        return there._replace(scene=with_bursts(self.scene, there.scene))

    def has_laws_of(self, there: "Choices") -> bool:
        """Return whether the laws are the same."""
        return law_names(self.laws) == law_names(there.laws)

    def agrees_with(self, there: "Choices") -> bool:
        """Return whether laws and curve sets are the same."""
        return self.has_laws_of(there) and self.has_bursts_of(there)

    def has_bursts_of(self, there: "Choices") -> bool:
        """Return whether the curve sets are the same."""
        mine, others = (
            [charge.burst for charge in of.scene.charges] for of in (self, there)
        )
        return mine == others and self.layout.free_air == there.layout.free_air


def choices_for(
    scene: Scene, rows: Layout, sigma: Float[np.ndarray, " row"]
) -> Choices:
    """Choose laws and curve sets for a scene, and the rows and errors of a log."""
    scene, layout = settled(scene, rows)
    return Choices(scene, layout, resolve_laws(scene, layout, sigma))


ROUNDS = 3
"""So often laws are chosen again at an answer. A choice that has not settled by then
goes to and fro between two laws near the border of their ranges."""


def settle_laws(
    choices: Choices,
    search: Callable[[Choices], tuple[Posterior, Optima, Choices]],
) -> tuple[tuple[Posterior, Optima, Choices], Choices]:
    """Search with what was chosen, and choose again at the answer until it settles.

    Where it does not settle, the answer is taken that lies within its own laws for the
    most rows; of several, the most probable one.

    Returns:
        Result of one of the searches, and the choices it was made with.
    """
    tried: list[tuple[tuple[Posterior, Optima, Choices], Choices]] = []
    for _ in range(1 + ROUNDS):
        *_, there = found = search(choices)
        tried.append((found, choices))
        if choices.agrees_with(there):
            return tried[-1]
        choices = choices.as_for(there)
        if any(choices.agrees_with(before) for _, before in tried):
            break
    return max(tried, key=lambda one: _standing(*one[0][:2]))


def _standing(posterior, found: Optima) -> tuple[int, float]:
    """Return how many rows lie within their laws at an answer, and its log density."""
    valid = posterior.misfit(jnp.asarray(np.asarray(found.z)[0])).valid
    return int(np.sum(np.asarray(valid))), float(found.log_density[0])


def with_samples(
    log: Observations, scaling: Scaling | None, high_pass_hz: float | None
) -> tuple[Observations, SampledRecords | None]:
    """Return a log of readings, and the samples that count in place of some of them."""
    if SAMPLES not in log.quantity:
        return log, None
    # picks are a second of imports, which other logs do without
    from jblast.inference.records.picked_log import picked_log
    from jblast.inference.records.sampled import sampled_records

    readings, picks = picked_log(log, scaling, high_pass_hz=high_pass_hz)
    return readings, sampled_records(readings, picks)
