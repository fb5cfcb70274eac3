r"""Is the normal approximation good enough: importance sampling and its k-hat.

Draws from the normal are weighted by posterior over normal. The largest weights are
smoothed by a generalised Pareto distribution, whose shape $\hat k$ says how far the
weights may be believed (Vehtari, Simpson, Gelman, Yao & Gabry 2024, JMLR 25(72); the
fit is that of Zhang & Stephens 2009, Technometrics 51:316).
"""

from dataclasses import dataclass

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from jblast.inference.importance.marginals import weighted_quantiles
from jblast.inference.importance.whitening import Whitened, densities, root_of
from jblast.inference.mode.laplace import NORMAL_Q95, Laplace
from jblast.inference.posterior.posterior import Posterior
from jblast.scene import parameter_named

DRAWS = 4000
FEWEST = 500
"""Draws for a long log: k-hat is then told by a tail of 67."""
HELD = 40_000_000
"""Numbers (8 bytes) that the densities of some draws at a time may need."""
WORK = 4_000_000_000
"""Numbers that all draws may need before there are fewer of them."""
GOOD_SHAPE = 0.5
"""Below this k-hat the normal is close enough to be taken for the posterior."""
NARROW = 0.1
"""Below this sd in ln a posterior has little room to be other than normal."""
MAX_QUANTILE_ERROR = 0.3
"""Ends of 90 % intervals that are off by less, in standard deviations, will do: of 327
simulated logs that passed, 89 % of the intervals held the truth, and of 394 logs judged
by the other two limits alone 86 % (`calibration/scenes/pressure.toml`)."""


@dataclass(frozen=True)
class Importance:
    """Weighted draws of a posterior.

    Attributes:
        z: Draws from the normal approximation.
        weights: What each counts, largest smoothed; they add to 1.
        k_hat: Shape of the tail of the weights.
        ess: Effective sample size.
    """

    z: Float[np.ndarray, "draw free"]
    weights: Float[np.ndarray, " draw"]
    k_hat: float
    ess: float


def importance(
    posterior: Posterior, normal: Laplace, *, seed: int = 0, draws: int = DRAWS
) -> Importance:
    """Weight draws from the normal approximation so that they follow the posterior.

    Along null directions, of which the normal says nothing, nothing is drawn: the
    posterior has to be proper for its weights to mean anything.
    """
    root = root_of(normal)
    misfit = jax.eval_shape(posterior.misfit, jnp.asarray(normal.z))
    of_one = misfit.loading.size + 8 * misfit.residual.size
    draws = min(draws, max(WORK // of_one, FEWEST))
    w = np.random.default_rng(seed).standard_normal((draws, normal.z.size))
    density = Whitened(posterior, jnp.asarray(normal.z), jnp.asarray(root))
    parts = np.array_split(w, -(-draws * of_one // HELD))
    value = np.concatenate(
        [np.asarray(densities(density, jnp.asarray(part))) for part in parts]
    )
    log_ratio = value + 0.5 * np.sum(w**2, axis=1)
    log_weights, k_hat = pareto_smoothed(log_ratio)
    weights = np.exp(log_weights)
    return Importance(
        z=normal.z + w @ root.T,
        weights=weights,
        k_hat=k_hat,
        ess=float(1 / np.sum(weights**2)),
    )


def laplace_holds(k_hat: float, log_sd: float, off: float) -> bool:
    """Whether the normal approximation may be taken for the posterior.

    Args:
        k_hat: Shape of the tail of the importance weights.
        log_sd: The largest sd in ln of any number (see `largest_log_sd`).
        off: By how much its intervals are off (see `largest_quantile_error`).
    """
    return k_hat < GOOD_SHAPE and log_sd < NARROW and off < MAX_QUANTILE_ERROR


def largest_quantile_error(found: Importance, normal: Laplace) -> float:
    """Return by how much an end of a 90 % interval is off at most, in sds.

    The ends of the normal approximation, beside those of its weighted draws.
    """
    sd = np.sqrt(np.diag(normal.covariance))
    ends = [weighted_quantiles(z, found.weights, (0.05, 0.95)) for z in found.z.T]
    off = (np.array(ends).T - normal.z) / sd - np.array([[-NORMAL_Q95], [NORMAL_Q95]])
    return float(np.max(np.abs(off)))


def largest_log_sd(posterior: Posterior, normal: Laplace) -> float:
    """Return the largest sd in ln: of a place, its sd over the nearest range.

    A number that is neither positive nor a place, like a clock's, has none.
    """
    parameters = posterior.parameters
    sds = np.sqrt(np.diag(normal.covariance))
    values = parameters.values(jnp.asarray(normal.z))
    slopes = parameters.values_of_each(
        jnp.asarray(normal.z + np.array([[-0.5], [0.5]]) * sds)
    )
    nearest = float(np.min(posterior.misfit(jnp.asarray(normal.z)).slant_range))
    largest = 0.0
    for name in parameters.names:
        moved = float(np.abs(np.diff(np.asarray(slopes[name]))[0]))
        if parameter_named(name).positive:
            largest = max(largest, moved / max(abs(float(values[name])), 1e-300))
        elif name.startswith(("charge_east", "charge_north", "charge_up")):
            largest = max(largest, moved / max(nearest, 1e-300))
    return largest


def pareto_smoothed(
    log_ratio: Float[np.ndarray, " draw"],
) -> tuple[Float[np.ndarray, " draw"], float]:
    """Smooth the largest importance ratios.

    Returns:
        ln of the weights, which add to 1, and k-hat: 0 if all ratios are equal, inf if
        too few draws have any weight to tell.
    """
    count = len(log_ratio)
    tail = int(np.ceil(min(0.2 * count, 3 * np.sqrt(count))))
    top = np.max(log_ratio)
    if not np.isfinite(top) or tail < 5:
        return np.full(count, -np.log(count)), np.inf
    log_weights = np.where(np.isfinite(log_ratio), log_ratio - top, -np.inf)
    order = np.argsort(log_weights)[count - tail :]
    cut = max(log_weights[np.argsort(log_weights)[count - tail - 1]], -700.0)
    order = order[log_weights[order] > cut]
    if len(order) < 5:  # the ratios are all alike, or one is all
        flat = np.ptp(log_weights) < 1e-10
        return _normalised(log_weights), 0.0 if flat else np.inf
    excess = np.exp(log_weights[order]) - np.exp(cut)
    k_hat, scale = generalised_pareto(excess)
    if np.isfinite(k_hat):
        shares = (np.arange(len(order)) + 0.5) / len(order)
        smooth = np.expm1(-k_hat * np.log1p(-shares)) * scale / k_hat + np.exp(cut)
        log_weights[order] = np.log(smooth)
        log_weights = np.minimum(log_weights, 0.0)
    return _normalised(log_weights), float(k_hat)


def _normalised(log_weights):
    return log_weights - np.logaddexp.reduce(log_weights)


def generalised_pareto(x: Float[np.ndarray, " excess"]) -> tuple[float, float]:
    """Fit a generalised Pareto distribution to positive numbers in rising order.

    Returns:
        Its shape, drawn towards 0.5 by ten observations' worth, and its scale.
    """
    count = len(x)
    grid = 30 + int(np.sqrt(count))
    quartile = x[int(count / 4 + 0.5) - 1]
    steps = np.sqrt(grid / (np.arange(1, grid + 1) - 0.5))
    theta = (1 - steps) / (3 * quartile) + 1 / x[-1]
    shape = np.mean(np.log1p(-theta[:, None] * x[None, :]), axis=1)
    profile = count * (np.log(-theta / shape) - shape - 1)
    weight = np.exp(profile - np.logaddexp.reduce(profile))
    mean = float(np.sum(theta * weight))
    k = float(np.mean(np.log1p(-mean * x)))
    return (k * count + 5) / (count + 10), -k / mean
