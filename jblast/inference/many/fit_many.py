"""The same fit for thousands to millions of independent logs of one layout."""

from collections.abc import Mapping

import numpy as np
from jaxtyping import Array, Float

from jblast.inference.many.lanes import COST_Z_MAX
from jblast.inference.many.many_fits import ManyFits
from jblast.scene import UncertainScene
from jblast.sensors import Layout
from jblast.sensors.simulate import Noise


def fit_many(
    uncertain: UncertainScene,
    layout: Layout,
    values: Float[Array, "log row"] | Float[np.ndarray, "log row"],
    relative_sigma: Float[Array, "..."] | Float[np.ndarray, "..."],
    laws: Mapping[str, str],
    *,
    noise: Noise = "student",
    starts: Float[Array, "..."] | Float[np.ndarray, "..."] | None = None,
    tries: int = 4,
    seed: int = 0,
    devices: int | None = None,
    again_z: float = COST_Z_MAX,
) -> ManyFits:
    r"""Fit many logs of one layout.

    What is minimised for each log is minus ln of the joint density of its readings, the
    shared effects among the unknowns (`fit` integrates them out: where laws scatter,
    its optimum differs by what ln det of their curvature varies). Levenberg-Marquardt
    (`LaneLevenbergMarquardt`).

    Where `burst` is left to the height, the curve sets are settled once, at the scene's
    own numbers, the same for all logs; nothing marks a log whose answer would change
    them.

    Args:
        uncertain: The scene and what is not known of it, the same for all logs.
        layout: Who recorded what.
        values: The readings.
        relative_sigma: Their instrument errors, of each row or of each row of each log:
            shares of the reading; of what errs in its own unit (`ADDITIVE`: times and
            directions), seconds and radians. A log's own `sigma`, in the unit of the
            reading, is refused with what to divide by.
        laws: Name of the law for each of `layout.quantities()`.
        noise: Distribution of the independent errors.
        starts: Fitted coordinates to start from, (log, free) or (try, log, free);
            without them in closed form (`many.starts.multilateration`), or where that
            does not apply, and for tries after the first, the nearest of draws of the
            prior, by the readings (`many.starts.nearest_prior_draw`).
        tries: How often a log may start again whose end is no optimum, or has a cost
            that readings would hardly have; the lowest cost counts.
        seed: Of the reference set.
        devices: 1: on the default device alone; None: on all there are.
        again_z: By how many standard deviations a cost is above its mean where a log
            starts again: less finds more of those that ended in another optimum.

    Returns:
        Estimates and standard deviations of each log, whether it converged, and what
        is wrong with those that did not.

    Raises:
        InputError: The batch as a whole cannot be fitted: a shape is another, which is
            named, or an error is no share. A bad log does not raise: its
            lane alone fails, and `faults` says why.

    Example:
        `jblast.fit_many(uncertain, *jblast.inference.batch_of(logs, uncertain))`
    """
    # imports optimistix, which a fit of one log does without where it has been kept
    from jblast.inference.many.engine import engine_for

    engine = engine_for(uncertain, layout, laws, noise, devices)
    return engine.fit(
        values,
        relative_sigma,
        starts=starts,
        tries=tries,
        seed=seed,
        again_z=again_z,
    )
