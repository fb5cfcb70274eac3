"""Sixteen logs of five sensors, simulated, and their laws."""

import dataclasses
import functools

import jax
import jax.numpy as jnp
import numpy as np

from jblast.scene import Scene, Sensor, UncertainScene, freed, with_values
from jblast.sensors import observe, planned_layout

FREE = ["charge_mass_kg", "charge_east_m", "charge_north_m", "origin_time_s"]
TRUTH = {
    "charge_mass_kg": 30.0,
    "charge_east_m": 10.0,
    "charge_north_m": -5.0,
    "origin_time_s": 1.5,
}
LAWS = {"air_arrival_s": "wu_hao", "ground_arrival_s": "wu_hao"}
COMMON = tuple(LAWS.items())
RECORDS = (("air_arrival_s", 1e-4), ("ground_arrival_s", 1e-4))
PLACES = ((60, 0), (-70, 30), (0, 90), (20, -80), (120, 100), (-90, -60))


def problem(count, **how):
    """A scene and the first of 16 logs of it."""
    uncertain, layout, values, sigma, names = problem_of_16(**how)
    return uncertain, layout, values[:count].copy(), sigma, names


@functools.cache
def problem_of_16(scatter=False, records=RECORDS, laws=COMMON):
    sensors = tuple(
        Sensor(f"s{i}", jnp.array([*place, 0.0]), records=records)
        for i, place in enumerate(PLACES)
    )
    scene = dataclasses.replace(Scene(), scatter=scatter, sensors=sensors, law=laws)
    scene = with_values(scene, TRUTH)
    layout, sigma, names = planned_layout(scene)
    keys = jax.random.split(jax.random.key(3), 16)
    draw = jax.jit(
        jax.vmap(
            lambda k: observe(k, scene, layout, dict(laws), sigma, noise="gaussian")
        )
    )
    uncertain = freed(UncertainScene(scene), FREE)
    return uncertain, layout, np.asarray(draw(keys)), np.asarray(sigma), names
