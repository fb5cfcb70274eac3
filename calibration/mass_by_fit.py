r"""The mass of one shot as `jblast fit` finds it: by Laplace's method, and by emcee.

One search for the optimum serves both. With $f$ the log-density that both go by, up to
a constant, emcee's density of $\ln W$ is

$$\ln p(\ln W) = f(\ln W) - \ln \int e^f \, d \ln W,$$

the integral by the trapezoid rule over the places where walkers stood: of one unknown
they lie so close that no smoothing of draws is needed, which has a bias of its own
(0.08 at HTP-7 by a Gaussian kernel).
"""

import tempfile
from pathlib import Path
from typing import NamedTuple

import jax.numpy as jnp
import numpy as np
from scipy.stats import norm

from calibration import ford_logs
from calibration.mass_posterior import MassEstimate
from jblast.inference.fitting.fit import solve
from jblast.inference.fitting.solution import Solution
from jblast.inference.fitting.uncertainty import Uncertainty, uncertainty
from jblast.observations import Observations, read, resolve_positions
from jblast.registry import Law
from jblast.scene import UncertainScene, read_scene, with_laws


class Weighed(NamedTuple):
    """What `jblast fit` says of the mass of a shot.

    Attributes:
        laplace: By the normal approximation; its mean is the most probable ln W.
        emcee: By walkers.
        valid: Whether the answer is marked valid.
    """

    laplace: MassEstimate
    emcee: MassEstimate
    valid: bool


def log_and_scene(shot: str, laws: list[Law]) -> tuple[Observations, UncertainScene]:
    """Read the log and the scene that a user would have, with laws named."""
    with tempfile.TemporaryDirectory() as folder:
        log, scene = Path(folder, "log.csv"), Path(folder, "scene.toml")
        log.write_text(ford_logs.log(shot), encoding="utf-8")
        scene.write_text(ford_logs.scene(shot), encoding="utf-8")
        by_quantity = {law.quantity: law.name for law in laws}
        return read(log), with_laws(read_scene(scene), by_quantity)


def weigh(shot: str, laws: list[Law]) -> Weighed:
    """Fit the log of a shot as a user would, by laws that are registered."""
    log, uncertain = log_and_scene(shot, laws)
    log = resolve_positions(log, uncertain.scene, uncertain.beliefs)
    solution = solve(log, uncertain)
    mode = float(solution.laplace.z[0])
    truth = float(np.log(float(ford_logs.rows_of(shot)[0]["yield_kg"])))

    sd, q05, q95 = _told(shot, solution, uncertainty(solution, "laplace"))
    score = float(norm.logpdf(truth, mode, sd))
    by_laplace = MassEstimate(mode, sd, q05, q95, score)

    walked = uncertainty(solution, "emcee")
    walk = walked.ensemble
    if walk is None:
        raise RuntimeError(f"the mass of {shot} was not walked")
    score = float(solution.posterior.log_density(jnp.array([truth])))
    score -= log_integral(walk.z, walk.log_density)
    mean = float(np.mean(walk.z))
    by_emcee = MassEstimate(mean, *_told(shot, solution, walked), score)

    misfit = solution.posterior.misfit(jnp.asarray(solution.laplace.z))
    return Weighed(by_laplace, by_emcee, bool(misfit.valid.all()))


def _told(
    shot: str, solution: Solution, sure: Uncertainty
) -> tuple[float, float, float]:
    """Return the sd and the 90 % interval of ln W."""
    if not (solution.laplace.converged and sure.converged):
        raise RuntimeError(f"the fit of {shot} by {sure.method} did not converge")
    mass = sure.marginals["charge_mass_kg"]
    return mass.log_sd, float(np.log(mass.q05)), float(np.log(mass.q95))


def log_integral(z: np.ndarray, log_density: np.ndarray) -> float:
    """Return ln of the integral of a density of one unknown, from draws in any order.

    Args:
        z: Where walkers stood, some of them again and again.
        log_density: ln of the density there, up to a constant.
    """
    z, first = np.unique(z, return_index=True)
    log_density = log_density.ravel()[first]
    top = log_density.max()
    return float(top + np.log(np.trapezoid(np.exp(log_density - top), z)))
