"""A simulated log: a scene sampled from its priors, recorded, with errors.

The error model is that of the fit. Effects shared by a shot and by a path are normal.
The remaining error of each row is Student-t with 4 degrees of freedom (or normal); its
scale is the row's sigma and the law's record scatter in quadrature.

Student's t is drawn as a length and a direction, so that no draw is rejected.
`jax.random.t` divides by a gamma variate, which is drawn by rejection: in a batch all
elements wait for the slowest, at twenty times the cost.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Literal, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Int, PRNGKeyArray

from jblast.observations import Observations, observed
from jblast.quantities import ADDITIVE, BY_CAMERA, CIRCULAR
from jblast.scene import Scene, UncertainScene, draw_scene
from jblast.scene.uncertain import value_of
from jblast.sensors.law_choice import height_notes, law_names, resolve_laws, settled
from jblast.sensors.layout import (
    Layout,
    check_scene,
    joined,
    opaque_constant,
    picked,
    planned_layout,
)
from jblast.sensors.path_scatter import MAX_PATHS, TYPICAL, split
from jblast.sensors.record import Recording, record

Noise = Literal["student", "gaussian"]
STUDENT_FREEDOM = 4.0
"""Degrees of freedom of the independent errors: heavy enough for a wild reading."""


def simulate(
    uncertain: UncertainScene, seed: int = 0, *, noise: Noise = "student"
) -> Observations:
    """Return what a scene's sensors would write down; comments hold the truth.

    Args:
        uncertain: The scene; numbers with a prior are drawn from it.
        seed: Of all draws.
        noise: Distribution of the independent errors.

    Returns:
        A log, as `jblast.observations.write` writes it and `jblast.fit` takes it.

    Raises:
        InputError: A number is free and cannot be drawn, or is an array of numbers, or
            no sensor records anything.

    Example:
        `observations = jblast.simulate(jblast.read_scene("scene.toml"), seed=1)`
    """
    scene_key, noise_key = jax.random.split(jax.random.key(seed))
    scene = draw_scene(scene_key, uncertain)
    log = readings(noise_key, scene, noise=noise)
    truth = [
        f"truth: {name} = {float(np.asarray(value_of(scene, name)))!r}"
        for name in uncertain.beliefs
    ]
    source = f"{uncertain.source or 'a scene'}, seed {seed}"
    first = f"SIMULATED, not measured: {source}"
    return replace(log, comments=(first, *log.comments, *truth))


def readings(
    key: PRNGKeyArray, scene: Scene, *, noise: Noise = "student"
) -> Observations:
    """Return what the sensors of a scene without priors would write down.

    Args:
        key: Of all errors.
        scene: Charges, air, ground and sensors.
        noise: Distribution of the independent errors.

    Returns:
        A log; its comments state the laws and curves.

    Raises:
        InputError: A number of the scene is an array of numbers, or no sensor records
            anything.
    """
    check_scene(scene)
    layout, sigma, sensors = planned_layout(scene)
    scene, layout = settled(scene, layout)
    laws = law_names(resolve_laws(scene, layout, np.asarray(sigma)))
    value = np.asarray(_observe(key, scene, layout, laws, sigma, noise))
    notes = [
        note
        for shot in range(len(scene.charges))
        for note in height_notes(scene, layout, shot)
    ]
    used = ", ".join(f"{quantity} by {law}" for quantity, law in laws.items())
    comments = (
        f"laws: {used}; independent errors: {noise}",
        *(f"note: {note}" for note in notes),
    )
    log = written(scene, layout, value, np.asarray(sigma), sensors)
    return replace(log, comments=comments)


def written(
    scene: Scene,
    layout: Layout,
    value: Float[np.ndarray, " row"],
    sigma: Float[np.ndarray, " row"],
    sensors: Sequence[str],
) -> Observations:
    """Return readings of a planned layout as a log.

    Args:
        scene: Charges, air, ground and sensors.
        layout: Rows planned, see `planned_layout`.
        value: Their readings.
        sigma: Error of each: in its unit for `ADDITIVE`, relative otherwise.
        sensors: Name of each row's sensor.
    """
    placed = {s.name for s in scene.sensors if np.isfinite(s.position_m).all()}
    is_placed = np.isin(sensors, list(placed))
    is_placed |= np.isin(layout.quantity, BY_CAMERA)  # at the camera
    additive = np.isin(layout.quantity, ADDITIVE)
    return observed(
        sensors,
        layout.quantity,
        value,
        np.where(additive, sigma, sigma * np.abs(value)),
        position=np.where(is_placed[:, None], np.asarray(layout.position), np.nan),
        time=np.asarray(layout.time),
        shot=tuple(scene.charges[shot].name for shot in layout.shot),
    )


@eqx.filter_jit
def _observe(key, scene, layout, laws, sigma, noise):
    return observe(key, scene, layout, laws, sigma, noise=noise)


class ErrorModel(NamedTuple):
    """Scatter of the laws in the rows of a log.

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
        if weights is None or not 2 <= first.size <= MAX_PATHS:
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
        scene: Charges, air, ground and sensors.
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
    if own is None and noise == "student":
        own = jax.random.t(own_key, STUDENT_FREEDOM, sigma.shape)
    elif own is None:
        own = jax.random.normal(own_key, sigma.shape)
    error = shared + own * jnp.hypot(sigma, of_laws.record_sd)
    moved, grown = recording.value + error, recording.value * jnp.exp(error)
    read = jnp.where(np.isin(layout.quantity, ADDITIVE), moved, grown)
    circular = np.isin(layout.quantity, CIRCULAR)
    return jnp.where(circular, jnp.mod(read, 2 * math.pi), read)


def student_errors(
    key: PRNGKeyArray, freedom: float, count: int
) -> Float[Array, " row"]:
    r"""Draw independent errors of Student's distribution.

    $$t = \sqrt{\nu (U^{-2/\nu} - 1)} \cos 2 \pi V$$

    with $U$ and $V$ uniform, exactly.

    Args:
        key: Random key.
        freedom: Degrees of freedom $\nu$, positive.
        count: How many.

    References:
        Bailey (1994), Polar generation of random variates with the t-distribution,
        Math. Comp. 62, 779-781, the theorem of section 2; from memory.
    """
    least = jnp.finfo(jnp.zeros(()).dtype).tiny
    u, v = jax.random.uniform(key, (2, count), minval=least)
    # u^(-2/nu) - 1 by expm1: it cancels for u near 1
    length = jnp.sqrt(freedom * jnp.expm1(-2.0 / freedom * jnp.log(u)))
    return length * jnp.cos(2.0 * math.pi * v)
