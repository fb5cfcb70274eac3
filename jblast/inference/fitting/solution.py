"""What inference found, before it is put in words."""

from collections.abc import Mapping
from typing import NamedTuple

from jblast.inference.identifiability.null_space import Identifiability
from jblast.inference.mode.laplace import Laplace
from jblast.inference.mode.search import Optima
from jblast.inference.posterior.posterior import Posterior


class Solution(NamedTuple):
    """What inference found.

    Attributes:
        posterior: What was climbed.
        laws: Name and reason of the law for each quantity.
        laws_settled: Whether the automatic choice of law at the answer is that used.
        optima: The ends of the searches, the best first.
        identifiability: What the data tell of the parameters.
        laplace: The posterior about the best optimum.
        bursts_settled: Whether the curve sets that heights leave at the answer are
            those used.
    """

    posterior: Posterior
    laws: Mapping[str, tuple[str, str]]
    laws_settled: bool
    optima: Optima
    identifiability: Identifiability
    laplace: Laplace
    bursts_settled: bool = True
