r"""The mass of one shot from its impulses and durations, by plain quadrature.

The prior is flat in $\ln W$; range, height and air are known. Given the mass and what
the shot adds (a unit normal $z$), the paths are independent; each path's own effect is
integrated over its records' Student-t errors. Both integrals and the mass are sums over
even grids, so nothing here is approximate but the grid, and nothing is shared with
`jblast.inference`, which it checks.
"""

from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax.scipy.special import logsumexp

from calibration.ford_records import Records
from calibration.random_effects import log_student_t
from jblast.registry import Law, call
from jblast.waves.paths import Path

HALF_WIDTH = 5.0
"""The grid reaches so far to each side of the true ln W."""
STEP = 0.05
NORMAL_GRID = np.linspace(-6.0, 6.0, 49)
NU = 4.0


class MassEstimate(NamedTuple):
    """The posterior of ln W."""

    mean: float
    sd: float
    q05: float
    q95: float
    log_density_at_truth: float


def log_likelihood(
    residual: jax.Array, scatter: tuple[jax.Array, ...], of_path: jax.Array
) -> jax.Array:
    """Return the log-likelihood of one quantity at each mass.

    Args:
        residual: ln of measured over predicted, mass by record.
        scatter: Standard deviations of shot, path and record, each mass by record.
        of_path: 1 where a record belongs to a path, path by record.
    """
    shot_sd, path_sd, record_sd = scatter
    weight = -0.5 * NORMAL_GRID**2
    weight = jnp.asarray(weight - logsumexp(weight))

    def at(z: jax.Array) -> jax.Array:
        def along(u: jax.Array) -> jax.Array:
            left = residual - z * shot_sd - u * path_sd
            return log_student_t(left, record_sd, NU) @ of_path.T

        paths = jax.vmap(along)(jnp.asarray(NORMAL_GRID))
        return jnp.sum(logsumexp(paths + weight[:, None, None], axis=0), axis=-1)

    shots = jax.lax.map(at, jnp.asarray(NORMAL_GRID))
    return logsumexp(shots + weight[:, None], axis=0)


def mass_grid(charge_mass: float) -> np.ndarray:
    """Return the values of ln W of the quadrature, about the true one."""
    truth = np.log(charge_mass)
    return truth + np.arange(-HALF_WIDTH, HALF_WIDTH + STEP / 2, STEP)


def log_density_of(log: Records, laws: list[Law], grid: np.ndarray) -> np.ndarray:
    """Return the log-likelihood of one shot's records at each ln W of a grid.

    Args:
        log: The records of one shot; its mass is not used.
        laws: One law for each quantity that is used.
        grid: Values of ln W.
    """
    nothing = jnp.zeros(())
    path = Path(
        slant_range=jnp.asarray(log.slant_range)[None, :],
        ground_range=jnp.asarray(log.slant_range)[None, :],
        charge_mass=jnp.exp(jnp.asarray(grid))[:, None],
        height_of_burst=jnp.asarray(log.height_of_burst)[None, :],
        ambient_pressure=jnp.asarray(log.ambient_pressure)[None, :],
        sound_speed=jnp.asarray(log.sound_speed)[None, :],
        air_density=nothing,
        p_speed=nothing,
        sedov_gamma=nothing,
        time_since_detonation=nothing,
        sensor_height=nothing,
        temperature=nothing,
        relative_humidity=nothing,
    )
    of_path = jnp.asarray(np.unique(log.path)[:, None] == log.path[None, :], float)
    total = np.zeros(len(grid))
    for law in laws:
        predicted = call(law.function, path)
        residual = jnp.log(log.value[law.quantity])[None, :] - jnp.log(predicted)
        scatter = tuple(
            jnp.broadcast_to(sd, residual.shape) for sd in call(law.scatter, path)
        )
        total += np.asarray(jax.jit(log_likelihood)(residual, scatter, of_path))
    return total


def estimate(log: Records, laws: list[Law]) -> MassEstimate:
    """Return what the records of one shot say about its mass.

    Args:
        log: The records of one shot; its true mass only places the grid.
        laws: One law for each quantity that is used.
    """
    grid = mass_grid(log.charge_mass[0])
    return summarised(grid, log_density_of(log, laws, grid))


def summarised(grid: np.ndarray, total: np.ndarray) -> MassEstimate:
    """Return mean, sd and 90 % interval of ln W by a log-likelihood and a flat prior.

    Args:
        grid: Of `mass_grid`; the true ln W is its centre.
        total: Log-likelihood on it.

    Raises:
        ValueError: The posterior does not end within the grid.
    """
    truth = float(grid[len(grid) // 2])
    log_density = total - total.max()
    log_density -= np.log(np.sum(np.exp(log_density)) * STEP)
    density = np.exp(log_density)
    if max(density[0], density[-1]) > 1e-4:
        raise ValueError("the posterior of ln W runs off its grid")
    mean = float(np.sum(grid * density) * STEP)
    # The cumulative sum belongs to the upper edge of each cell.
    q05, q95 = np.interp((0.05, 0.95), np.cumsum(density) * STEP, grid + STEP / 2)
    return MassEstimate(
        mean=mean,
        sd=float(np.sqrt(np.sum((grid - mean) ** 2 * density) * STEP)),
        q05=float(q05),
        q95=float(q95),
        log_density_at_truth=float(np.interp(truth, grid, log_density)),
    )
