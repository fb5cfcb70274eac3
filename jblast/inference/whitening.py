r"""Coordinates in which a posterior is nearly a unit normal, or a ridge is straight.

Whitened coordinates: the normal approximation is a unit normal in $w$, with
$z = z_0 + A w$ and $A A^T$ its covariance. Samplers move in $w$, and densities are
evaluated there for many points at once.

A curved ridge is straight in coordinates that follow the readings,
$w(z) = A^T J^T (y(z) - y(z_0))$: $y$ are the data in standard deviations, $J$ their
sensitivity at the optimum $z_0$, and $A A^T = (J^T J)^{-1}$. Near the optimum
$z = z_0 + A w$, as in the normal approximation; where the data curve, $z$ follows them.
Draws of $w$ mapped to $z$ are those of randomize-then-optimize (Bardsley, Solonen,
Haario & Laine 2014, SIAM J. Sci. Comput. 36:A1895), with the density
$q(w(z)) |\det dw/dz|$. A draw is unusable where Newton's method finds no such $z$.
"""

from functools import partial
from typing import NamedTuple, Protocol, runtime_checkable

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax import lax
from jaxtyping import Array, Float, PRNGKeyArray

from jblast.errors import InputError
from jblast.inference.identifiability import Identifiability
from jblast.inference.mode.laplace import Laplace
from jblast.inference.mode.search import Optima
from jblast.inference.mode.starts import starts
from jblast.inference.posterior.fisher_information import (
    whitened_jacobian,
    whitened_rows,
)
from jblast.inference.posterior.posterior import Posterior
from jblast.kept_programs import kept
from jblast.observations import Observations

BLOCK = 20
"""Places whose densities are computed together. A block takes as long as its slowest
place, so large blocks waste time; small ones lose vectorisation."""
STEPS = 8
"""Steps of Newton's method: 999 of 1000 draws up to 6 sd along a ridge converge."""
NEWTON_TOLERANCE = 1e-4
"""Newton's method has converged if coordinates agree to this many standard deviations:
it is quadratic, so a draw that comes this near would be exact in one more step."""


@runtime_checkable
class Density(Protocol):
    """Density for a sampler: a PyTree of arrays with a log-density."""

    def log_density(self, w: Float[Array, " free"]) -> Float[Array, ""]:
        """Return ln of the density at a place, up to a constant."""
        ...


class Whitened(eqx.Module):
    """A posterior in whitened coordinates.

    Attributes:
        posterior: The posterior.
        center: Fitted coordinates at $w = 0$.
        root: One standard deviation along each axis, one column each.
    """

    posterior: Posterior
    center: Float[Array, " free"]
    root: Float[Array, "free free"]

    def log_density(self, w: Float[Array, " free"]) -> Float[Array, ""]:
        """Return ln of the posterior density, up to a constant."""
        return self.posterior.log_density(self.center + self.root @ w)


@kept
def densities(density: Density, w: Float[Array, "place free"]):
    """Return the log-density of many places; -inf where it is NaN."""
    value = jax.vmap(density.log_density)(w)
    return jnp.where(jnp.isfinite(value), value, -jnp.inf)


def densities_of_draws(
    density: Density, w: Float[np.ndarray, "place free"]
) -> Float[np.ndarray, " place"]:
    """Return `densities` of draws, some of which lie far out.

    Shared effects take more steps to converge there, and a block waits for its last
    place. So blocks contain places of similar distance.
    """
    order = np.argsort(np.sum(np.square(w), axis=1))
    order = np.pad(order, (0, -len(order) % BLOCK), mode="edge")
    blocks = w[order].reshape(-1, BLOCK, w.shape[1])
    value = np.empty(len(w))
    # padding repeats the last place, whose entry is then written several times alike
    value[order] = np.asarray(_by_blocks(density, jax.device_put(blocks))).ravel()
    return value


@kept
def _by_blocks(density: Density, blocks: Float[Array, "block place free"]):
    return lax.map(partial(densities, density), blocks)


def whitened_density(
    posterior: Posterior, normal: Laplace, identifiability: Identifiability
) -> Whitened:
    """Return a posterior in whitened coordinates.

    Raises:
        InputError: The posterior is improper along a direction that neither the log nor
            a prior constrains.
    """
    if len(identifiability.null):
        along = [
            ", ".join(
                name if weight == 1 else f"{name} times {weight:.3g}"
                for name, weight in zip(
                    posterior.parameters.names, direction, strict=True
                )
                if weight != 0
            )
            for direction in identifiability.null
        ]
        raise InputError(
            f"the posterior is improper along {' and along '.join(along)}: the log "
            "does not constrain this combination, so it cannot be sampled; expected a "
            "prior, or a fixed value, for one of these parameters"
        )
    return Whitened(posterior, jnp.asarray(normal.z), jnp.asarray(root_of(normal)))


def root_of(normal: Laplace) -> Float[np.ndarray, "free free"]:
    """Return a square root of the covariance."""
    # of the correlations: eigenvalues in metres and seconds would differ by 1e10
    sds = np.sqrt(np.diag(normal.covariance))
    values, vectors = np.linalg.eigh(normal.covariance / sds / sds[:, None])
    floor = len(sds) * np.finfo(values.dtype).eps
    return sds[:, None] * vectors * np.sqrt(np.maximum(values, floor))


def non_finite_rows(posterior: Posterior, z: Float[np.ndarray, " free"]) -> list[int]:
    """Return the rows whose misfit is not finite at a place."""
    misfit = posterior.misfit(jnp.asarray(z))
    u = np.asarray(misfit.residual) / np.asarray(misfit.sd)
    finite = np.isfinite(u) & np.isfinite(np.asarray(misfit.loading)).all(axis=1)
    return [int(row) for row in np.flatnonzero(~finite)]


def refuse_without_density(
    key: PRNGKeyArray, posterior: Posterior, found: Optima, observations: Observations
) -> None:
    """Reject a log without a finite density, and name its rows.

    Raises:
        InputError: The density is not finite at the best optimum.
    """
    if np.isfinite(np.asarray(found.log_density)[0]):
        return
    # at the first start, since the optimum itself may be NaN
    start = np.asarray(starts(key, posterior, 1)[0])
    where = [observations.where(row) for row in non_finite_rows(posterior, start)]
    more = f" and {len(where) - 5} more" if len(where) > 5 else ""
    raise InputError(
        f"{observations.source or 'observations'}: no value of "
        f"{', '.join(posterior.parameters.names)} gives the log a probability; "
        "expected readings, sigmas and a scene that one charge could explain"
        + (f", got NaN for {', '.join(where[:5])}{more}" if where else "")
    )


class RtoDraws(NamedTuple):
    r"""Draws by randomize-then-optimize.

    Attributes:
        z: Draws. A draw without a solution has the optimum in its place.
        log_ratio: ln of the posterior density over $|\det dw/dz|$; -inf for draws
            without a solution.
    """

    z: Float[Array, "place free"]
    log_ratio: Float[Array, " place"]


@kept
def rto_proposal(
    posterior: Posterior,
    center: Float[Array, " free"],
    root: Float[Array, "free free"],
    w: Float[Array, "place free"],
) -> RtoDraws:
    """Solve for the places with given ridge coordinates.

    Args:
        posterior: The posterior.
        center: Its optimum $z_0$.
        root: One standard deviation along each axis $A$, one column each.
        w: Ridge coordinates of the draws.
    """
    here, has_prior = posterior.misfit(center), posterior.parameters.has_prior()
    slopes = whitened_jacobian(posterior, center)

    def coordinates(z):
        moved = (here.residual - posterior.misfit(z).residual)[:, None]
        data = whitened_rows(posterior, here, moved)[:, 0]
        return root.T @ (slopes.T @ jnp.concatenate([data, has_prior * (z - center)]))

    jacobian = jax.jacfwd(coordinates)

    def place(w):
        def nearer(z, _):
            return z - jnp.linalg.solve(jacobian(z), coordinates(z) - w), None

        # a fixed number of steps: under vmap a while loop would run to the slowest
        # draw, which often diverges
        z = jax.lax.scan(nearer, center + root @ w, length=STEPS)[0]
        missed = jnp.max(jnp.abs(coordinates(z) - w))
        ratio = posterior.log_density(z) - jnp.linalg.slogdet(jacobian(z))[1]
        met = (missed < NEWTON_TOLERANCE) & jnp.isfinite(ratio)
        return RtoDraws(jnp.where(met, z, center), jnp.where(met, ratio, -jnp.inf))

    return jax.vmap(place)(w)
