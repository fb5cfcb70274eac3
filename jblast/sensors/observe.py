"""Readings with errors: what sensors would write down of a scene.

The error model is that of the fit: effects shared by the shot and by a path are normal,
what is left of each row is Student-t with 4 degrees of freedom (or normal) whose scale
is the row's sigma and the law's record scatter in quadrature.
"""

import math
from collections.abc import Mapping
from typing import Literal

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, PRNGKeyArray

from jblast.quantities import ADDITIVE, CIRCULAR
from jblast.scene import Scene
from jblast.sensors.even_rows import opaque_constant
from jblast.sensors.layout import Layout
from jblast.sensors.record import Recording, record

Noise = Literal["student", "gaussian"]

STUDENT_FREEDOM = 4.0
"""Degrees of freedom of the independent errors: heavy enough for a wild reading."""


def loadings(recording: Recording, layout: Layout) -> Float[Array, "row effect"]:
    """Return what one standard deviation of each shared effect adds to each row.

    There is one effect for the shot and one for each path, for each quantity whose law
    scatters so.
    """
    group = opaque_constant(np.array(layout.group))
    groups = dict.fromkeys(layout.group)
    columns = list(recording.shot_loading.values())
    for of_path in recording.path_loading.values():
        columns += [jnp.where(group == g, of_path, 0.0) for g in groups]
    if not columns:
        return jnp.zeros((len(layout.quantity), 0))
    return jnp.stack(columns, axis=1)


def observe(
    key: PRNGKeyArray,
    scene: Scene,
    layout: Layout,
    laws: Mapping[str, str],
    sigma: Float[Array, " row"],
    *,
    noise: Noise = "student",
    shared_error: Float[Array, "row effect"] | None = None,
    own: Float[Array, " row"] | None = None,
) -> Float[Array, " row"]:
    """Draw what each row of a layout reads, errors included.

    Args:
        key: Random key.
        scene: What is there.
        layout: Rows of a log.
        laws: Name of the law for each of `layout.quantities()`.
        sigma: Instrument error of each row: in its unit for `ADDITIVE`, else relative.
        noise: Distribution of the independent errors.
        shared_error: What one standard deviation of each error that readings share adds
            to each, beside `sigma`; None if all are independent.
        own: The independent errors, in their scale, in place of drawn ones: a batch
            draws them by `student_errors`, a log by its seed as it always has.
    """
    recording = record(scene, layout, laws)
    shared_key, own_key = jax.random.split(key)
    loading = loadings(recording, layout)
    if shared_error is not None:
        loading = jnp.concatenate([loading, shared_error], axis=1)
    shared = loading @ jax.random.normal(shared_key, (loading.shape[1],))
    if own is not None:
        pass
    elif noise == "student":
        own = jax.random.t(own_key, STUDENT_FREEDOM, sigma.shape)
    else:
        own = jax.random.normal(own_key, sigma.shape)
    error = shared + own * jnp.hypot(sigma, recording.record_sd)
    moved, grown = recording.value + error, recording.value * jnp.exp(error)
    read = jnp.where(np.isin(layout.quantity, ADDITIVE), moved, grown)
    circular = np.isin(layout.quantity, CIRCULAR)
    return jnp.where(circular, jnp.mod(read, 2 * math.pi), read)
