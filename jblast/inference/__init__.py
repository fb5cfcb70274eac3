"""What we conclude: one posterior, its optima, and how sure they are."""

from jblast.inference.fit import fit as fit
from jblast.inference.fit_result import Band as Band, Fit as Fit
from jblast.inference.posterior import (
    Posterior as Posterior,
    posterior_of as posterior_of,
)
