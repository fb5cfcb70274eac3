"""Sensors in one line, of which the charge lies off by as much on either side."""

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jblast.inference import fit_many
from jblast.scene import Normal, Scene, Sensor, UncertainScene, freed, with_values
from jblast.sensors import observe, planned_layout
from tests.inference.many.five_sensors import COMMON, LAWS, RECORDS

OFF_M = 5.0


def logs(count):
    """Logs of charges off a line by what the prior says, and what is known of them."""
    sensors = tuple(
        Sensor(f"s{i}", jnp.array([20.0 * (i + 1), 0.0, 0.0]), records=RECORDS)
        for i in range(5)
    )
    scene = dataclasses.replace(Scene(), scatter=False, sensors=sensors, law=COMMON)
    layout, sigma, _ = planned_layout(scene)

    def one(key):
        north = OFF_M * jax.random.normal(jax.random.fold_in(key, 1))
        true = with_values(scene, {"charge_mass_kg": 10.0, "charge_north_m": north})
        return observe(key, true, layout, LAWS, sigma, noise="gaussian")

    keys = jax.random.split(jax.random.key(0), count)
    uncertain = freed(UncertainScene(scene), ["charge_mass_kg"])
    beliefs = {**uncertain.beliefs, "charge_north_m": Normal(0.0, OFF_M)}
    uncertain = dataclasses.replace(uncertain, beliefs=beliefs)
    return (
        uncertain,
        layout,
        np.asarray(jax.jit(jax.vmap(one))(keys)),
        np.asarray(sigma),
    )


@pytest.mark.slow
def test_fits_end_though_gauss_newton_steps_across_the_line_for_ever():
    found = fit_many(*logs(128), LAWS, noise="gaussian", devices=1)
    assert found.converged.all()
