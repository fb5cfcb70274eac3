"""Readings with errors: what sensors would write down of a scene.

The error model is that of the fit: effects shared by the shot and by a path are normal,
what is left of each row is Student-t with 4 degrees of freedom (or normal) whose scale
is the row's sigma and the law's record scatter in quadrature.
"""

import math
from collections.abc import Mapping
from typing import Literal, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Int, PRNGKeyArray

from jblast.quantities import ADDITIVE, CIRCULAR
from jblast.scene import Scene
from jblast.sensors.even_rows import joined, opaque_constant, picked
from jblast.sensors.layout import Layout
from jblast.sensors.path_scatter import MOST, TYPICAL, split
from jblast.sensors.record import Recording, record

Noise = Literal["student", "gaussian"]

STUDENT_FREEDOM = 4.0
"""Degrees of freedom of the independent errors: heavy enough for a wild reading."""


class ErrorModel(NamedTuple):
    """How the laws' scatter enters the rows of a log.

    Attributes:
        record_sd: Of the independent error of each row, what is of the law; seconds for
            times, else ln.
        loading: What one standard deviation of each shared effect adds to each row: of
            the shot and of each path, for each quantity whose law scatters so, then of
            neighbouring paths.
        common: How many of the first columns are not of neighbouring paths.
    """

    record_sd: Float[Array, " row"]
    loading: Float[Array, "row effect"]
    common: int


def error_model(
    recording: Recording,
    layout: Layout,
    weights: Float[Array, " kernel"] | Float[np.ndarray, " kernel"] | None = TYPICAL,
) -> ErrorModel:
    """Return independent and shared errors of the laws.

    Args:
        recording: Of the layout.
        layout: Rows of a log.
        weights: Of the correlation functions of neighbouring paths; None takes all
            paths as independent.
    """
    group, n = np.array(layout.group), len(layout.quantity)
    columns = list(recording.shot_loading.values())
    of_paths, of_neighbours = dict(recording.path_loading), []
    variance = jnp.square(recording.record_sd)
    for name, quantity, shot in recording.fields:
        rows, first, path = paths_of(layout, quantity, shot)
        if weights is None or not 2 <= first.size <= MOST:
            continue
        own, shared = split(
            picked(recording.place, rows[first]),
            picked(recording.placed, rows[first]),
            jnp.asarray(weights),
        )
        if first.size < rows.size:
            own, shared = own[opaque_constant(path)], shared[opaque_constant(path)]
        if name in recording.arrival_sd:
            sd = picked(recording.arrival_sd[name], rows)
            variance += joined([(rows, jnp.square(sd) * (own - 1))], n)
            of_neighbours.append((rows, sd[:, None] * shared))
        if name in of_paths:
            sd = picked(of_paths[name], rows)
            of_paths[name] = joined([(rows, sd * jnp.sqrt(own))], n)
            of_neighbours.append((rows, sd[:, None] * shared))
    hidden = opaque_constant(group)
    groups = dict.fromkeys(layout.group)
    for of_path in of_paths.values():
        columns += [jnp.where(hidden == g, of_path, 0.0) for g in groups]
    common = len(columns)
    parts = [jnp.stack(columns, axis=1)] if columns else [jnp.zeros((n, 0))]
    for rows, shared in of_neighbours:
        blank = jnp.zeros((n, shared.shape[1]), shared.dtype)
        parts.append(
            blank.at[opaque_constant(rows)].set(shared) if rows.size < n else shared
        )
    sd = recording.record_sd
    if of_neighbours:
        some = variance > 0
        sd = jnp.where(some, jnp.sqrt(jnp.where(some, variance, 1.0)), 0.0)
    return ErrorModel(sd, jnp.concatenate(parts, axis=1), common)


def paths_of(
    layout: Layout, quantity: str, shot: int
) -> tuple[Int[np.ndarray, " row"], Int[np.ndarray, " path"], Int[np.ndarray, " row"]]:
    """Return the rows a quantity of a charge takes part in, and their paths.

    Returns:
        The rows; of each path the place of its first among them; and the path of each.
    """
    rows, _ = layout.rows(quantity, shot)
    group = np.array(layout.group)[rows]
    _, first, path = np.unique(group, return_index=True, return_inverse=True)
    return rows, first, path


def loadings(recording: Recording, layout: Layout) -> Float[Array, "row effect"]:
    """Return what one standard deviation of each effect of shot or path adds to rows.

    Neighbouring paths are taken as independent.
    """
    return error_model(recording, layout, None).loading


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
    kernel = jax.random.randint(jax.random.fold_in(shared_key, 2), (), 0, len(TYPICAL))
    of_laws = error_model(recording, layout, jnp.eye(len(TYPICAL))[kernel])
    loading, neighbours = jnp.split(of_laws.loading, [of_laws.common], axis=1)
    if shared_error is not None:
        loading = jnp.concatenate([loading, shared_error], axis=1)
    shared = loading @ jax.random.normal(shared_key, (loading.shape[1],))
    if neighbours.shape[1]:
        # with a key of its own: the draws of all other effects do not depend on them
        fields_key = jax.random.fold_in(shared_key, 1)
        shared += neighbours @ jax.random.normal(fields_key, (neighbours.shape[1],))
    if own is not None:
        pass
    elif noise == "student":
        own = jax.random.t(own_key, STUDENT_FREEDOM, sigma.shape)
    else:
        own = jax.random.normal(own_key, sigma.shape)
    error = shared + own * jnp.hypot(sigma, of_laws.record_sd)
    moved, grown = recording.value + error, recording.value * jnp.exp(error)
    read = jnp.where(np.isin(layout.quantity, ADDITIVE), moved, grown)
    circular = np.isin(layout.quantity, CIRCULAR)
    return jnp.where(circular, jnp.mod(read, 2 * math.pi), read)
