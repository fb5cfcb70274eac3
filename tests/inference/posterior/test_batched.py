"""What computes goes under jit and vmap: a batch is a loop, done at once."""

import dataclasses
import inspect

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

import jblast.inference
from jblast.inference.mode.search import optima
from jblast.inference.posterior.fisher_information import information
from tests.catalogue import AROUND, BOTH
from tests.inference.shots import five_solved, shot


def nudged(posterior, by):
    """The same log, every reading changed by so much."""
    return dataclasses.replace(posterior, measured=posterior.measured + by)


NUDGES = jnp.array([0.0, 1e-3, -2e-3])


@pytest.mark.slow
def test_densities_effects_and_information_of_many_logs_are_those_of_each():
    posterior, normal, *_ = five_solved()
    z = jnp.asarray(normal.z)
    places = z[None, :] + 1e-3 * jnp.arange(3.0)[:, None]

    def of_one(by, z):
        log = nudged(posterior, by)
        slope = jax.grad(log.log_density)(z)
        return log.log_density(z), slope, log.effects(z), information(log, z)

    together = eqx.filter_jit(jax.vmap(of_one))(NUDGES, places)
    for k, (by, place) in enumerate(zip(NUDGES, places, strict=True)):
        for many, one in zip(together, of_one(by, place), strict=True):
            # the order of sums differs; slopes are 1e4 per second
            np.testing.assert_allclose(many[k], one, rtol=1e-9, atol=1e-6)


@pytest.mark.slow
def test_the_search_of_many_logs_ends_where_that_of_each_does():
    posterior = shot(AROUND, BOTH, free=("charge_mass_kg", "origin_time_s"))
    key = jax.random.key(0)
    together = eqx.filter_jit(
        jax.vmap(lambda by: optima(key, nudged(posterior, by)).z[0])
    )(NUDGES)
    for by, z in zip(NUDGES, together, strict=True):
        log = nudged(posterior, by)
        alone = optima(key, log).z[0]
        sds = jnp.sqrt(jnp.diagonal(jnp.linalg.inv(information(log, alone))))
        # both climb until a step gains 1e-10 of the density
        np.testing.assert_array_less(np.abs((z - alone) / sds), 1e-3)


def test_every_way_to_an_answer_is_imported_from_one_place():
    names = ("fit", "solve", "ensemble", "fit_many", "batch_of", "fit_each", "bound")
    for name in names:
        assert inspect.isfunction(getattr(jblast.inference, name)), name
