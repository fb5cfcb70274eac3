"""What we conclude: one posterior, its optima, and how sure they are.

Under `jit` and `vmap` go what computes: every method of `Posterior` (over places, and
over the readings of logs of one layout), `information_of_layout`, and the search
`optimum.optima`. `fit`, `solve`, `bound` and `ensemble` decide things in Python between
such programs, so they take one log; many go through `fit_many`, which compiles its own,
or `fit_each`.
"""

from jblast.inference.design.covariance import (
    information_of_layout as information_of_layout,
)
from jblast.inference.design.cramer_rao import Bound as Bound, bound as bound
from jblast.inference.design.sensor_map import (
    BoundMap as BoundMap,
    bound_map as bound_map,
)
from jblast.inference.fitting.fit import fit as fit, solve as solve
from jblast.inference.fitting.fit_each import fit_each as fit_each
from jblast.inference.fitting.result import Band as Band, Fit as Fit
from jblast.inference.fitting.solution import Solution as Solution
from jblast.inference.many.batch import Batch as Batch, batch_of as batch_of
from jblast.inference.many.fit_many import fit_many as fit_many
from jblast.inference.many.many_fits import ManyFits as ManyFits
from jblast.inference.mcmc.ensemble import Ensemble as Ensemble, ensemble as ensemble
from jblast.inference.posterior.posterior import (
    Posterior as Posterior,
    posterior_of as posterior_of,
)
