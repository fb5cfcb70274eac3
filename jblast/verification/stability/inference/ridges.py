"""Ridges: a flat one, one without end, and one that bends away from its normal."""

import functools

import jax.numpy as jnp
import numpy as np

from jblast.errors import InputError
from jblast.inference import Ensemble, Solution, ensemble
from jblast.inference.fitting.uncertainty import uncertainty
from jblast.inference.importance.findings import IntervalsOff
from jblast.inference.importance.interval_check import check_intervals
from jblast.inference.importance.psis import MAX_QUANTILE_ERROR
from jblast.inference.importance.whitening import Whitened, root_of, whitened_density
from jblast.inference.mcmc.findings import LongRidge
from jblast.inference.posterior.estimate import Estimate
from jblast.verification.stability.failure import FailureMode, verified
from jblast.verification.stability.inference.arrival_logs import circle, solved_log
from jblast.verification.stability.inference.plain_emcee import (
    WALKERS,
    BareWalk,
    bare_walk,
)
from jblast.verification.stability.inference.unidentifiable import wu_hao_told
from jblast.verification.stability.threshold import crossing

SHORT, LONG = 500, 4000
"""Steps."""
ENDLESS_STEPS = 1500
NEAR = 10.0
"""Radius of the circle of sensors that a ridge without end is told of [m]."""
CLOSE = 6.0
"""Of the one that a bent ridge is told of [m]."""


@functools.cache
def along_the_null(steps: int) -> BareWalk:
    """Walk over mass and both speeds by Wu-Hao's laws, from about the optimum."""
    found = wu_hao_told()
    rng = np.random.default_rng(0)
    z = jnp.asarray(found.laplace.z)
    about = Whitened(found.posterior, z, jnp.eye(z.size))
    return bare_walk(about, 0.1 * rng.standard_normal((WALKERS, z.size)), steps)


def null_failure() -> FailureMode:
    """Measure how a walk over a null direction fills it, and looks converged."""
    walk = along_the_null(LONG)
    found = wu_hao_told()
    mass = found.laplace.z[0] + walk.kept()[..., 0]
    try:
        ensemble(found.posterior, found.laplace, found.identifiability)
        refused = False
    except InputError as error:
        refused = "improper along charge_mass_kg" in str(error)
    return FailureMode(
        area="walks",
        method="emcee, Wu-Hao, mass and both speeds",
        failure="a null direction without a prior has no width",
        boundary=float(LONG / walk.judged.tau.max()),
        unit=f"autocorrelation times in {LONG} steps",
        beyond=f"ln mass fills {mass.min():.0f} to {mass.max():.0f}, as far as float64 "
        f"goes; autocorrelation time {walk.judged.tau.max():.0f}, R-hat "
        f"{walk.judged.r_hat.max():.3f}: it looks converged",
        response=verified("refuses", refused, "a null direction"),
        message="nothing is walked: improper along charge_mass_kg and the speeds; "
        "expected a prior, or a fixed value",
    )


@functools.cache
def endless() -> tuple[Solution, Ensemble]:
    """Walk over the mass of a charge 300 m from a circle of sensors of 10 m."""
    found = solved_log(circle(NEAR), 30.0, 300.0, 0.0).solution
    walk = ensemble(
        found.posterior,
        found.laplace,
        found.identifiability,
        found.optima,
        most_steps=ENDLESS_STEPS,
    )
    return found, walk


def endless_failure() -> FailureMode:
    """Measure how a walk runs down a ridge that does not end."""
    found, ours = endless()
    density = whitened_density(found.posterior, found.laplace, found.identifiability)
    start = np.random.default_rng(0).standard_normal((WALKERS, found.laplace.z.size))
    walks = [bare_walk(density, start, steps) for steps in (SHORT, LONG)]
    low = [np.quantile(_masses(found, walk), 0.05) for walk in walks]
    tau = float(walks[-1].judged.tau.max())
    improper = any(isinstance(f, LongRidge) and f.is_endless for f in ours.findings)
    return FailureMode(
        area="walks",
        method="emcee, arrivals from afar",
        failure="a ridge without end: ever smaller masses arrive with sound",
        boundary=LONG / tau,
        unit=f"autocorrelation times in {LONG} steps",
        beyond=f"the 5 % quantile of the mass is {low[0]:.2g} kg after {SHORT} steps, "
        f"{low[1]:.2g} kg after {LONG}: the walk's length, not the log's word",
        response=verified("marks", improper and not ours.converged, "an endless ridge"),
        message="not converged (exit code 4): the ridge, its ends, and that the "
        "posterior is improper are named",
    )


def _masses(found: Solution, walk: BareWalk) -> np.ndarray:
    z = found.laplace.z[0] + walk.kept() @ root_of(found.laplace)[0]
    return np.exp(z)


def off_at(radius: float) -> float:
    """Return by how many sds an end of a 90 % interval is off for a circle of sensors.

    Args:
        radius: Of the circle [m]; the charge is 60 m from its middle.
    """
    found = _beside(radius)
    return check_intervals(found.posterior, found.laplace).off


def _beside(radius: float) -> Solution:
    return solved_log(circle(radius), 30.0, 60.0, 0.0).solution


def bent_failure() -> FailureMode:
    """Measure from which aperture on the normal approximation does not do."""
    boundary = crossing(lambda r: off_at(r) - MAX_QUANTILE_ERROR, CLOSE, 40.0, to=0.01)
    found = _beside(CLOSE)
    name = found.posterior.parameters.names[0]
    asked, sure = uncertainty(found, "laplace"), uncertainty(found, "auto")
    normal, walked = asked.marginals[name], sure.marginals[name]
    told_of = any(
        isinstance(f, IntervalsOff) and f.parameter == name and not np.isnan(f.off)
        for f in asked.findings
    )
    return FailureMode(
        area="walks",
        method="normal approximation (Laplace)",
        failure="a ridge of mass and range that bends",
        boundary=boundary,
        unit="m radius of eight sensors 60 m away",
        beyond=f"ends of 90 % intervals are off by more than {MAX_QUANTILE_ERROR:g} "
        f"sd; at {CLOSE:g} m by {off_at(CLOSE):.1f}: the mass is "
        f"{_interval(normal)} instead of {_interval(walked)}",
        response=verified(
            "marks",
            told_of and sure.method == "emcee" and sure.converged,
            "a bent ridge",
        ),
        message="a warning names the end that is off by most; --posterior auto walks",
    )


def _interval(marginal: Estimate) -> str:
    return f"{marginal.q05:.3g} to {marginal.q95:.3g} kg"
