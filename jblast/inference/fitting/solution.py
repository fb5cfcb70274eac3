"""What inference found, before it is put in words."""

from collections.abc import Callable, Mapping
from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from jblast.fidelity import TakenLaw
from jblast.inference.identifiability.null_space import Identifiability
from jblast.inference.mode.laplace import Laplace
from jblast.inference.mode.search import Optima
from jblast.inference.posterior.posterior import Posterior
from jblast.inference.posterior.record_likelihood import SampledRecords
from jblast.observations import Observations
from jblast.observations.records.formats import Scaling
from jblast.observations.table import SAMPLES
from jblast.scene import Scene
from jblast.sensors import Layout, resolve_laws
from jblast.sensors.bursts import settled, with_bursts
from jblast.sensors.law_choice import law_names


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
    """

    posterior: Posterior
    laws: Mapping[str, TakenLaw]
    laws_settled: bool
    optima: Optima
    identifiability: Identifiability
    laplace: Laplace
    bursts_settled: bool = True
    samples_known: float | None = None


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


def settle_laws(
    choices: Choices,
    search: Callable[[Choices], tuple[Posterior, Optima, Choices]],
) -> tuple[tuple[Posterior, Optima, Choices], Choices]:
    """Search with what was chosen, and once more where the answer would choose else.

    Returns:
        What the last search found, and the choices it was made with.
    """
    *_, there = found = search(choices)
    if not (choices.has_laws_of(there) and choices.has_bursts_of(there)):
        choices = choices.as_for(there)
        found = search(choices)
    return found, choices


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
