"""Two modes: emcee's stretch move does not find the other, or does not weigh it.

First where the truth is known: two round normals in three dimensions, one of which
holds twice as much as the other. Then a charge beside a line of sensors, and its mirror
image, which hold one half each.
"""

import functools
from typing import NamedTuple

import numpy as np

from jblast.inference import Ensemble, ensemble
from jblast.inference.importance.whitening import whitened_density
from jblast.inference.mcmc.independence_move import Mixture, mixture_of
from jblast.inference.mcmc.run import Sampled, Start, sample
from jblast.verification.stability.failure import FailureMode, verified
from jblast.verification.stability.inference.arrival_logs import line, solved_log
from jblast.verification.stability.inference.plain_emcee import (
    WALKERS,
    BareWalk,
    bare_walk,
    unit_normals,
)
from jblast.verification.stability.inference.unidentifiable import MIRRORED

FREE = 3
STEPS = 1000
MIRROR_STEPS = 2500
LESSER = 1 / 3
"""What the second mode holds."""
FAR = 12.0
"""Modes so many standard deviations apart are told of."""
APART = (6.0, 8.0, 10.0, FAR)


def two_normals(apart: float) -> Mixture:
    """Return two unit normals so far apart, the second with a third of all."""
    center = np.zeros((2, FREE))
    center[1, 0] = apart
    return mixture_of(center, np.tile(np.eye(FREE), (2, 1, 1)), np.array([2.0, 1.0]))


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
    shares = [share_beyond(from_one(apart).kept(), apart) for apart in APART]
    missed = 1 - np.array(shares) / LESSER
    # the walks are random: what is missed is taken not to shrink with the distance
    boundary = float(np.interp(0.5, np.maximum.accumulate(missed), APART))
    walk = by_jblast(FAR)
    share = share_beyond(walk.chain[walk.convergence.warm_up :], FAR)
    return FailureMode(
        area="walks",
        method="emcee, stretch move",
        failure="from one mode, half of the other is missed",
        boundary=boundary,
        unit="sd between the modes",
        beyond=f"a mode of {LESSER:.0%} of all that is {FAR:g} sd away gets "
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
    walk = from_both(FAR)
    share = share_beyond(walk.kept(), FAR)
    tau = walk.judged.tau.max()
    return FailureMode(
        area="walks",
        method="emcee, own autocorrelation time",
        failure="from both modes, the shares stay as started",
        boundary=STEPS / walk.own_tau,
        unit=f"autocorrelation times claimed in {STEPS} steps",
        beyond=f"{FAR:g} sd apart, a mode of {LESSER:.0%} keeps {share:.0%}; emcee's "
        f"autocorrelation time is {walk.own_tau:.0f} steps, its limit of 50 of them "
        "met",
        response=verified(
            "marks", not walk.judged.reached(1.0) and tau > STEPS / 50, "shares"
        ),
        message=f"deviations from the mean of all walkers: {tau:.0f} steps, so the "
        "same walk counts as not converged",
    )
