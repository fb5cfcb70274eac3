"""What inference found, before it is put in words."""

from collections.abc import Mapping
from typing import NamedTuple

from jblast.inference.identifiability import Identifiability
from jblast.inference.laplace import Laplace
from jblast.inference.optimum import Optima
from jblast.inference.posterior import Posterior


class Solution(NamedTuple):
    """What inference found.

    Attributes:
        posterior: What was climbed.
        laws: Name and reason of the law for each quantity.
        laws_settled: Whether the automatic choice at the answer is the one used.
        optima: The ends of the searches, the best first.
        identifiability: What the data tell of the parameters.
        laplace: The posterior about the best optimum.
    """

    posterior: Posterior
    laws: Mapping[str, tuple[str, str]]
    laws_settled: bool
    optima: Optima
    identifiability: Identifiability
    laplace: Laplace
