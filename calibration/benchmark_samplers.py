"""Effective samples a second of each sampler, and the error of its 90 % interval.

Five microphones, four unknowns (mass, place in the plane, time), Student-t errors, laws
exact, as in `coverage`; 256 walkers. Effective samples are those of the worst unknown,
by its autocorrelation time, and the seconds those of sampling alone, compiled before,
the best of `REPEATS` runs.
The error is that of the interval's ends, the worst of all unknowns, in posterior
standard deviations, beside a run of the compiled sampler of `REFERENCE` steps; for a
sampler it is that of the whole run timed.
"""

import os
import time

import emcee
import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from calibration.coverage import LAWS, RECORDS, TRUTH, scene_with
from jblast.inference import Posterior, ensemble_emcee, ensemble_scan
from jblast.inference.convergence import convergence
from jblast.inference.identifiability import identifiability
from jblast.inference.importance import importance
from jblast.inference.laplace import laplace
from jblast.inference.mixture import Mixture, mixture_of
from jblast.inference.optimum import optima
from jblast.inference.parameters import parameters_of
from jblast.inference.walk import State, Stretch
from jblast.inference.weighted import weighted_quantiles
from jblast.inference.whitening import densities, whitened
from jblast.scene import UncertainScene, freed
from jblast.sensors import observe, planned_layout
from jblast.sensors.record import comparable

WALKERS = 256
STEPS = 2000
REFERENCE = 40_000
REPEATS = 3
SHARES = (0.05, 0.95)


class Free(eqx.Module):
    """A density that costs nothing: what is left is the sampler."""

    def log_density(self, w):
        """Return ln of a unit normal."""
        return -0.5 * w @ w


def posterior() -> Posterior:
    """Return the posterior of one simulated log."""
    scene = scene_with(scatter=False)
    layout, sigma, _ = planned_layout(scene)
    read = observe(jax.random.key(11), scene, layout, LAWS, sigma)
    parameters = parameters_of(freed(UncertainScene(scene), list(TRUTH)))
    measured = comparable(read, layout.quantity)
    return Posterior(parameters, layout, measured, sigma, tuple(LAWS.items()))


def samplers_text() -> str:
    """Measure and return the table."""
    with jax.enable_x64(True):
        return _text()


def _text() -> str:
    what = posterior()
    z = np.asarray(optima(jax.random.key(0), what).z[0])
    told = identifiability(what, z)
    normal = laplace(what, z, told.told)
    density = whitened(what, normal, told)
    axes = np.asarray(density.root)
    long, _ = _walk(ensemble_scan.walk, ensemble_scan, density, REFERENCE, 1, 1)
    true = _ends(long[REFERENCE // 10 :] @ axes.T)
    sd = (long[REFERENCE // 10 :] @ axes.T).reshape(-1, len(z)).std(axis=0)

    lines = [
        f"Samplers: {jax.devices()[0].platform}, {os.cpu_count()} cores, emcee "
        f"{emcee.__version__}, jax {jax.__version__}, {len(RECORDS)} readings at each "
        f"of five microphones, {len(z)} unknowns, {WALKERS} walkers",
        "",
        f"{'':38}{'ESS/s':>10}{'density/s':>12}{'tau':>8}{'error of ends':>16}",
    ]

    def row(name, rate=None, called=None, tau=None, ends=None):
        error = "" if ends is None else f"{np.max(np.abs(ends - true) / sd):.3f}"
        told = [
            f"{rate:,.0f}" if rate else "",
            f"{called:,.0f}" if called else "",
            f"{tau:.1f}" if tau else "",
        ]
        lines.append(
            f"{name:38}{told[0]:>10}{told[1]:>12}{told[2]:>8}{error:>16}".rstrip()
        )

    rates = {}
    free = Free()
    for name, walk, engine, of in (
        ("emcee", ensemble_emcee.walk, ensemble_emcee, density),
        ("emcee, stretch move alone", _stretch_alone, ensemble_emcee, density),
        (
            "emcee, density free",
            _numpy_free(ensemble_emcee.moves(_normal(len(z)))),
            ensemble_emcee,
            free,
        ),
        (
            "emcee, stretch alone, density free",
            _numpy_free(emcee.moves.StretchMove()),
            ensemble_emcee,
            free,
        ),
        ("one lax.scan", ensemble_scan.walk, ensemble_scan, density),
        ("one lax.scan, density free", ensemble_scan.walk, ensemble_scan, free),
    ):
        chain, seconds = _walk(walk, engine, of, STEPS)
        kept = chain[STEPS // 10 :] @ (axes.T if of is density else np.eye(len(z)))
        tau = float(np.max(convergence(kept).tau))
        rates[name] = WALKERS * STEPS / tau / seconds
        ends = _ends(kept) if of is density else None
        row(name, rates[name], WALKERS * STEPS / seconds, tau, ends)
    weighted, seconds = importance(what, normal), np.inf
    for _ in range(REPEATS):
        start = time.perf_counter()
        weighted = importance(what, normal)
        seconds = min(seconds, time.perf_counter() - start)
    ends = np.array(
        [
            weighted_quantiles(x, weighted.weights, SHARES)
            for x in (weighted.z - normal.z).T
        ]
    ).T
    count = len(weighted.z)
    row("importance sampling", weighted.ess / seconds, count / seconds, None, ends)
    sds = np.sqrt(np.diag(normal.covariance))
    row("Laplace", ends=np.outer([-1.6449, 1.6449], sds))
    ceiling = rates["emcee"] / rates["emcee, density free"]
    lines += [
        "",
        f"emcee over its ceiling (the same moves, density free): {100 * ceiling:.0f} %",
        f"one lax.scan over emcee: {rates['one lax.scan'] / rates['emcee']:.1f}",
        f"k-hat {weighted.k_hat:.2f}; importance sampling draws {count} in all",
    ]
    return "\n".join(lines)


def _ends(chain):
    """Return the ends of the 90 % interval of each unknown, from the optimum."""
    return np.quantile(chain.reshape(-1, chain.shape[-1]), SHARES, axis=0)


def _normal(free: int) -> Mixture:
    """Return the unit normal: the posterior's approximation where it is round."""
    return mixture_of(np.zeros((1, free)), np.eye(free)[None], np.ones(1))


def _walk(walk, engine, density, steps, seed=0, repeats=REPEATS):
    """Walk, and return the chain and the seconds it took at best, once compiled."""
    free = 4 if isinstance(density, Free) else len(density.center)
    w = np.random.default_rng(seed).standard_normal((WALKERS, free))
    value = np.array(densities(density, jnp.asarray(w)))
    state = State(w, value, engine.first_random(seed))
    about = _normal(free)
    state = walk(density, about, state, ensemble_scan.BLOCK, lambda: None).end
    chain, best = state.walkers[None], np.inf
    for _ in range(repeats):  # each the same walk
        start = time.perf_counter()
        chain = walk(density, about, state, steps, lambda: None).chain
        best = min(best, time.perf_counter() - start)
    return chain, best


def _numpy_free(moves):
    """Return a walk by emcee whose density is a line of NumPy."""
    return _emcee(lambda _: lambda w: -0.5 * np.einsum("ij,ij->i", w, w), moves)


def _stretch_alone(density, mixture, state, steps, tick):
    return _emcee(
        lambda density: lambda w: np.asarray(densities(density, w)),
        emcee.moves.StretchMove(),
    )(density, mixture, state, steps, tick)


def _emcee(function_of, moves):
    def walk(density, mixture, state, steps, tick):
        count, free = state.walkers.shape
        sampler = emcee.EnsembleSampler(
            count, free, function_of(density), moves=moves, vectorize=True
        )
        start = emcee.State(
            state.walkers,
            log_prob=state.log_density,
            random_state=ensemble_emcee.of_emcee(state.random),
        )
        sampler.run_mcmc(start, steps)
        chain, value = sampler.get_chain(), sampler.get_log_prob()
        return Stretch(np.asarray(chain), np.asarray(value), state.random)

    return walk
