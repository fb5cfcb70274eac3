"""Failure modes of MCMC: ridges and separate modes.

Two modes: emcee's stretch move misses the second mode, or gives it a wrong weight. The
first case has a known truth: two round normals in three dimensions, one of which has
twice the weight of the other. The second is a charge next to a line of sensors, and its
mirror image, with half the weight each. Ridges are flat, endless or curved.
"""

import functools
from typing import NamedTuple

import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from jblast.errors import InputError
from jblast.inference import Ensemble, Solution, ensemble
from jblast.inference.fitting.uncertainty import uncertainty
from jblast.inference.importance import (
    MAX_QUANTILE_ERROR,
    IntervalsOff,
    check_intervals,
)
from jblast.inference.mcmc.convergence import Convergence, convergence
from jblast.inference.mcmc.engines import Mixture, mixture_of
from jblast.inference.mcmc.ensemble import LongRidge
from jblast.inference.mcmc.run import Sampled, Start, sample
from jblast.inference.posterior.parameters import Estimate
from jblast.inference.whitening import (
    Density,
    Whitened,
    densities,
    root_of,
    whitened_density,
)
from jblast.verification.stability.failure import (
    FailureMode,
    boundary_at,
    crossing,
    verified,
)
from jblast.verification.stability.fits import (
    MIRRORED,
    circle,
    line,
    solved_log,
    wu_hao_told,
)

FREE = 3
STEPS = 1000
MIRROR_STEPS = 2500
LESSER = 1 / 3
"""What the second mode holds."""
SEPARATED_SD = 12.0
"""Modes so many standard deviations apart are told of."""
MODE_SEPARATIONS = (6.0, 8.0, 10.0, SEPARATED_SD)
SHORT, LONG = 500, 4000
"""Steps."""
ENDLESS_STEPS = 1500
CIRCLE_RADIUS = 10.0
"""Radius of the circle of sensors that a ridge without end is told of [m]."""
CLOSE = 6.0
"""Of the one that a bent ridge is told of [m]."""
WALKERS = 64


def two_normals(apart: float) -> Mixture:
    """Return two unit normals so far apart, the second with a third of all."""
    center = np.zeros((2, FREE))
    center[1, 0] = apart
    return mixture_of(center, np.tile(np.eye(FREE), (2, 1, 1)), np.array([2.0, 1.0]))


class BareWalk(NamedTuple):
    """A walk by the stretch move alone.

    Attributes:
        chain: Every step.
        own_tau: emcee's autocorrelation time of the first coordinate [steps]: each
            walker beside its own mean.
        judged: How jblast judges it: all walkers beside one mean.
    """

    chain: Float[np.ndarray, "step walker free"]
    own_tau: float
    judged: Convergence

    def kept(self) -> Float[np.ndarray, "step walker free"]:
        """Return the steps after the first quarter."""
        return self.chain[len(self.chain) // 4 :]


@functools.cache
def from_one(apart: float) -> BareWalk:
    """Walk by the stretch move alone, all walkers in the greater mode."""
    return bare_walk(two_normals(apart), unit_normals(FREE), STEPS)


@functools.cache
def from_both(apart: float) -> BareWalk:
    """Walk by the stretch move alone, half of the walkers in each mode."""
    start = unit_normals(FREE)
    start[::2, 0] += apart
    return bare_walk(two_normals(apart), start, STEPS)


@functools.cache
def by_jblast(apart: float) -> Sampled:
    """Walk as jblast does, half of the walkers in each mode."""
    center = np.asarray(two_normals(apart).center)
    starts = [Start(at, np.eye(FREE), 0.5) for at in center]
    return sample(two_normals(apart), starts, np.eye(FREE), sampler="scan")


def share_beyond(chain: np.ndarray, apart: float) -> float:
    """Return the share of places that belong to the second mode."""
    return float(np.mean(chain[..., 0] > apart / 2))


def found_failure() -> FailureMode:
    """Measure from how far apart the other mode is not found from the first."""
    shares = [share_beyond(from_one(apart).kept(), apart) for apart in MODE_SEPARATIONS]
    missed = 1 - np.array(shares) / LESSER
    # the walks are random: what is missed is taken not to shrink with the distance
    missed = np.maximum.accumulate(missed)
    boundary = boundary_at(
        0.5, missed, np.array(MODE_SEPARATIONS), "stretch move from one mode"
    )
    walk = by_jblast(SEPARATED_SD)
    share = share_beyond(walk.chain[walk.convergence.warm_up :], SEPARATED_SD)
    return FailureMode(
        area="walks",
        method="emcee, stretch move",
        failure="from one mode, half of the other is missed",
        boundary=boundary,
        unit="sd between the modes",
        beyond=f"a mode of {LESSER:.0%} of all that is {SEPARATED_SD:g} sd away gets "
        f"{shares[-1]:.1%} in {STEPS} steps",
        response=verified(
            "holds", walk.reached and abs(share - LESSER) < 0.05, "modes"
        ),
        message="walkers start at every optimum the search found and go anew to the "
        f"normals about them: {share:.0%} there, {len(walk.chain)} steps, "
        f"autocorrelation time {walk.convergence.tau.max():.0f}",
    )


class Mirror(NamedTuple):
    """Walks over a charge beside a line of sensors.

    Attributes:
        bare: By the stretch move alone, from the best optimum.
        beyond: How many of its walkers ever stand at the mirror image.
        ours: jblast's.
    """

    bare: BareWalk
    beyond: int
    ours: Ensemble


@functools.cache
def mirror() -> Mirror:
    """Walk about a charge that has a mirror image."""
    found = solved_log(line(), *MIRRORED).solution
    posterior, normal = found.posterior, found.laplace
    density = whitened_density(posterior, normal, found.identifiability)
    walk = bare_walk(density, unit_normals(FREE), MIRROR_STEPS)
    north = normal.z[2] + walk.chain @ np.asarray(density.root)[2]
    there = (np.sign(north) != np.sign(normal.z[2])).any(axis=0)
    ours = ensemble(posterior, normal, found.identifiability, found.optima)
    return Mirror(walk, int(there.sum()), ours)


def mirror_failure() -> FailureMode:
    """Measure how many walkers reach the mirror image of a charge."""
    by = mirror()
    shares = [mode.share for mode in by.ours.modes]
    return FailureMode(
        area="walks",
        method="emcee, stretch move",
        failure="walkers that never see the mirror image",
        boundary=float(WALKERS - by.beyond),
        unit=f"of {WALKERS}",
        beyond=f"{MIRROR_STEPS} steps from the best optimum: {by.beyond} of {WALKERS} "
        f"walkers ever stand there, and the chain cannot tell: R-hat "
        f"{by.bare.judged.r_hat.max():.3f}, {MIRROR_STEPS / by.bare.own_tau:.0f} "
        "autocorrelation times",
        response=verified(
            "marks", len(shares) == 2 and by.ours.converged, "a mirror image"
        ),
        message=f"both modes are named with their shares, {shares[0]:.0%} and "
        f"{shares[1]:.0%}; autocorrelation time "
        f"{by.ours.convergence.tau.max():.0f}",
    )


def weighed_failure() -> FailureMode:
    """Measure how far off the share of a mode stays where walkers start in both."""
    walk = from_both(SEPARATED_SD)
    share = share_beyond(walk.kept(), SEPARATED_SD)
    tau = walk.judged.tau.max()
    return FailureMode(
        area="walks",
        method="emcee, own autocorrelation time",
        failure="from both modes, the shares stay as started",
        boundary=STEPS / walk.own_tau,
        unit=f"autocorrelation times claimed in {STEPS} steps",
        beyond=f"{SEPARATED_SD:g} sd apart, a mode of {LESSER:.0%} keeps {share:.0%}; "
        f"emcee's autocorrelation time is {walk.own_tau:.0f} steps, its limit of 50 "
        "of them met",
        response=verified(
            "marks", not walk.judged.reached(1.0) and tau > STEPS / 50, "shares"
        ),
        message=f"deviations from the mean of all walkers: {tau:.0f} steps, so the "
        "same walk counts as not converged",
    )


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
    found = solved_log(circle(CIRCLE_RADIUS), 30.0, 300.0, 0.0).solution
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


def bare_walk(
    density: Density,
    start: Float[np.ndarray, "walker free"],
    steps: int,
    seed: int = 0,
) -> BareWalk:
    """Walk from given places.

    Args:
        density: Where to walk.
        start: Where the walkers stand.
        steps: How many steps.
        seed: Of the moves.
    """
    import emcee

    walkers, free = start.shape
    sampler = emcee.EnsembleSampler(
        walkers,
        free,
        lambda w: np.asarray(densities(density, jnp.asarray(w)), float),
        vectorize=True,
    )
    random = np.random.RandomState(seed).get_state()
    sampler.run_mcmc(emcee.State(start, random_state=random), steps)
    chain = np.asarray(sampler.get_chain())
    own = emcee.autocorr.integrated_time(chain[..., :1], quiet=True, tol=0)
    return BareWalk(chain, float(own[0]), convergence(chain))


def unit_normals(free: int, seed: int = 0) -> Float[np.ndarray, "walker free"]:
    """Draw walkers from a unit normal."""
    return np.random.default_rng(seed).standard_normal((WALKERS, free))
