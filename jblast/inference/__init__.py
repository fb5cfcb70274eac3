"""What we conclude: one posterior, its optima, and how sure they are."""

from jblast.inference.fit import fit as fit
from jblast.inference.fit_result import Band as Band
from jblast.inference.fit_result import Fit as Fit
from jblast.inference.posterior import Posterior as Posterior
from jblast.inference.posterior import posterior_of as posterior_of
