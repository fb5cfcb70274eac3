"""Lanes of short episodes, a blast in each: one program for all who step them."""

from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp

from jblast.environments import (
    EnvironmentParams,
    Randomisation,
    environment_params,
    reset,
    reset_lanes,
    step,
    step_lanes,
)
from jblast.scene import ByCount, Ring, Uniform, WorldSpec

RESET, STEP = eqx.filter_jit(reset), eqx.filter_jit(step)
RESET_LANES, STEP_LANES = eqx.filter_jit(reset_lanes), eqx.filter_jit(step_lanes)
EPISODE_S = 0.3


def params_of(task: str = "Hover", **options) -> EnvironmentParams:
    """Params of episodes in which a near blast comes within 0.1 s or so."""
    given: dict[str, Any] = {
        "command": "hold",
        "episode_s": EPISODE_S,
        "spread_m": 0.0,
        "world": WorldSpec(
            occurrence=ByCount(1),
            region=Ring(12.0, 20.0),
            about="vehicle",
            mass=Uniform(5.0, 15.0),
            time=Uniform(0.0, 0.15),
        ),
        "randomisation": Randomisation(wind_east_m_s=Uniform(-2.0, 2.0)),
    }
    return environment_params(task, **given | options)


PARAMS = params_of()


def keys(seed: int, lanes: int):
    """Keys of lanes, as documented."""
    fold = jax.vmap(jax.random.fold_in, (None, 0))
    return fold(jax.random.key(seed), jnp.arange(lanes))
