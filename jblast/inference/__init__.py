"""What we conclude: one posterior, its optima, and how sure they are."""

from jblast.inference.bound import Bound as Bound, bound as bound
from jblast.inference.bound_map import BoundMap as BoundMap, bound_map as bound_map
from jblast.inference.bound_spread import (
    information_of_layout as information_of_layout,
)
from jblast.inference.fit import fit as fit
from jblast.inference.fit_each import fit_each as fit_each
from jblast.inference.fit_result import Band as Band, Fit as Fit
from jblast.inference.many import ManyFits as ManyFits, fit_many as fit_many
from jblast.inference.posterior import (
    Posterior as Posterior,
    posterior_of as posterior_of,
)
