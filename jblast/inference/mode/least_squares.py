"""Least squares of a posterior: what each row, shared effect and prior costs."""

import equinox as eqx
import jax
import jax.numpy as jnp

from jblast.inference.posterior.error_density import log_survival
from jblast.inference.posterior.posterior import Posterior

LEAST_COST = 1e-12
"""Of a lower bound that is passed by far, so that its square root has a slope."""
NORMAL = 1e8
"""So many degrees of freedom make a Student-t normal."""


def residuals(posterior: Posterior, scale, y, freedom):
    """Residuals of least squares, whose unknowns include the shared effects.

    Half the square of each is minus the Student-t log-density of that many degrees of
    freedom, up to a constant; of a lower bound, minus ln of its probability.
    """
    z, effects = y[: scale.size] * scale, y[scale.size :]
    cost = _costs(posterior, freedom, z, effects)
    return cost, effects, z * posterior.parameters.has_prior()


@eqx.filter_custom_jvp
def _costs(posterior: Posterior, freedom, z, effects):
    """Residuals of the rows, see `residuals`."""
    return _costs_of(posterior, freedom, _missed(posterior, z, effects)[0])


@_costs.def_jvp
def _costs_moved(primals, tangents):
    """Slopes to z alone go through the laws: effects, often many more, are linear."""
    posterior, freedom, z, effects = primals
    *_, z_moved, effects_moved = tangents

    def missed(z):
        u, load = _missed(posterior, z, effects)
        return u, (u, load)

    slopes, (u, load) = jax.jacfwd(missed, has_aux=True)(z)
    costs, steepness = jax.jvp(
        lambda u: _costs_of(posterior, freedom, u), (u,), (jnp.ones_like(u),)
    )
    moved = jnp.zeros_like(u) if z_moved is None else slopes @ z_moved
    if effects_moved is not None:
        moved = moved - load @ effects_moved
    return costs, steepness * moved


def _missed(posterior: Posterior, z, effects):
    """Return what is missed, and what effects add to it, in standard deviations."""
    misfit = posterior.misfit(z)
    load = misfit.loading / misfit.sd[:, None]
    return misfit.residual / misfit.sd - load @ effects, load


def _costs_of(posterior: Posterior, freedom, u):
    """Return the residuals of rows missed by u standard deviations."""
    away = jnp.abs(u) > 1e-6
    tail = (freedom + 1) * jnp.log1p(jnp.square(jnp.where(away, u, 1.0)) / freedom)
    near = u * jnp.sqrt((freedom + 1) / freedom)
    cost = jnp.where(away, jnp.sign(u) * jnp.sqrt(tail), near)
    if posterior.lower_bound is None:
        return cost
    survival = jnp.where(
        freedom == NORMAL, log_survival(u, "gaussian"), log_survival(u, "student")
    )
    bound = jnp.sqrt(LEAST_COST - 2 * survival)
    return jnp.where(posterior.lower_bound, bound, cost)
