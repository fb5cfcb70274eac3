"""Inference: one posterior, weighted draws of it, and what they identify.

Functions that compute can be put under `jit` and `vmap`: `Fit.log_density`,
`Posterior.misfit` and `information_of_layout`. `fit`, `solve`, `bound` and `ensemble`
take decisions in Python between such programs, so they take one log. For several logs
there are `fit_many`, which compiles its own program, and `fit_each`.
"""

from typing import TYPE_CHECKING

from jblast.lazy import lazy_face

if TYPE_CHECKING:
    from jblast.inference.design.cramer_rao import Bound as Bound, bound as bound
    from jblast.inference.design.sensor_map import (
        BoundMap as BoundMap,
        bound_map as bound_map,
    )
    from jblast.inference.fitting.fit import (
        Band as Band,
        Fit as Fit,
        fit as fit,
        fit_each as fit_each,
    )
    from jblast.inference.fitting.solution import Solution as Solution, solve as solve
    from jblast.inference.many.fit_many import (
        Batch as Batch,
        batch_of as batch_of,
        fit_many as fit_many,
    )
    from jblast.inference.many.lanes import ManyFits as ManyFits
    from jblast.inference.mcmc import Ensemble as Ensemble, ensemble as ensemble
    from jblast.inference.posterior.fisher_information import (
        information_of_layout as information_of_layout,
    )
    from jblast.inference.posterior.posterior import (
        Posterior as Posterior,
        posterior_of as posterior_of,
    )
    from jblast.inference.tuning.tune_recording import tune as tune

__getattr__, __dir__ = lazy_face(__name__)
