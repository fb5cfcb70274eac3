"""A simulated log: a scene sampled from its priors, recorded, with errors.

All scatter of laws is normal, in ln except for angles: exp of a Student-t has no mean.
Errors of instruments are Student-t with 4 degrees of freedom, or normal. A declared
number is the standard deviation of a normal error and the scale of a Student-t one,
whose standard deviation is 1.41 times larger.

Student's t is drawn in polar form, without rejection. `jax.random.t` divides by a gamma
variate, which is drawn by rejection: in a batch all elements wait for the slowest one,
at twenty times the cost.
"""

import math
import os
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Literal, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, ArrayLike, Float, Int, PRNGKeyArray

from jblast.errors import InputError
from jblast.observations import Observations, observed
from jblast.quantities import ADDITIVE, BY_CAMERA, CIRCULAR
from jblast.scene import Scene, UncertainScene, draw_scene, scene_of
from jblast.scene.uncertain import value_of
from jblast.sensors.forward_model import Recording, record
from jblast.sensors.law_choice import height_notes, law_names, resolve_laws
from jblast.sensors.layout import (
    Layout,
    check_scene,
    joined,
    opaque_constant,
    picked,
    planned_layout,
)
from jblast.sensors.path_scatter import MAX_PATHS, TYPICAL, split

Noise = Literal["student", "gaussian"]
STUDENT_FREEDOM = 4.0
"""Degrees of freedom of the independent errors: 4 has finite variance and tails heavy
enough for occasional wild readings (beyond 5 sd in 0.2 % of rows; normal: 6e-5 %)."""


def simulate(
    uncertain: UncertainScene | Scene | str | os.PathLike[str],
    seed: int = 0,
    *,
    noise: Noise = "student",
) -> Observations:
    """Return the simulated log of a scene's sensors; its comments contain the truth.

    Args:
        uncertain: The scene, or its file; numbers with a prior are drawn from it.
        seed: Seed of all draws.
        noise: Distribution of the independent errors.

    Returns:
        A log for `jblast.observations.write` and `jblast.fit`.

    Raises:
        InputError: A free number cannot be drawn, a number is an array, or no sensor
            records anything.

    Example:
        `observations = jblast.simulate("scene.toml", seed=1)`
    """
    uncertain = scene_of(uncertain)
    scene_key, noise_key = jax.random.split(jax.random.key(seed))
    scene = draw_scene(scene_key, uncertain)
    log = readings(noise_key, scene, noise=noise)
    source = f"{uncertain.source or 'a scene'}, seed {seed}"
    first = f"SIMULATED, not measured: {source}"
    return replace(
        log, comments=(first, *log.comments, *drawn_values(uncertain, scene))
    )


def drawn_values(uncertain: UncertainScene, scene: Scene) -> list[str]:
    """Return a comment on each number of a scene that was drawn from a prior."""
    return [
        f"truth: {name} = {float(np.asarray(value_of(scene, name)))!r}"
        for name in uncertain.beliefs
    ]


def check_readings(observations: Observations, source: str, seed: int) -> None:
    """Check that a log may contain the readings; a sampled mass may be negative.

    Raises:
        InputError: A value or a sigma is not finite, or not positive.
    """
    log = observations
    is_size = np.isin(log.quantity, ADDITIVE) | (log.value > 0)
    holds = is_size & np.isfinite(log.value) & np.isfinite(log.sigma) & (log.sigma > 0)
    if holds.all():
        return
    row = int(np.argmin(holds))
    # the sampled truth is in the comments of the log, and explains a bad value
    drawn = ", ".join(c for c in log.comments if "truth:" in c)
    got = f"{log.quantity[row]} {log.value[row]:g} with sigma {log.sigma[row]:g}"
    raise InputError(
        f"{source}: sensor {log.sensor[row]!r}: seed {seed}: expected priors and "
        "sigmas that give a valid reading (a lognormal prior keeps a mass positive), "
        f"got {got}{drawn and f' ({drawn})'}"
    )


def readings(
    key: PRNGKeyArray, scene: Scene, *, noise: Noise = "student"
) -> Observations:
    """Return the simulated log of a scene without priors.

    Args:
        key: Random key of all errors.
        scene: Charges, air, ground and sensors.
        noise: Distribution of the independent errors.

    Returns:
        A log; its comments state the laws and curves.

    Raises:
        InputError: A number of the scene is an array, or no sensor records anything.
    """
    check_scene(scene)
    layout, sigma, sensors = planned_layout(scene)
    laws = law_names(resolve_laws(scene, layout, np.asarray(sigma)))
    value = np.asarray(_observe(key, scene, layout, laws, sigma, noise=noise))
    shots = range(len(scene.charges))
    notes = [note for shot in shots for note in height_notes(scene, layout, shot)]
    used = ", ".join(f"{quantity} by {law}" for quantity, law in laws.items())
    first = f"laws: {used}; independent errors: {noise}"
    log = written(scene, layout, value, np.asarray(sigma), sensors)
    return replace(log, comments=(first, *(f"note: {note}" for note in notes)))


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
        layout: Rows from `planned_layout`.
        value: Readings of the rows.
        sigma: Standard error of each: in its unit for `ADDITIVE`, else relative.
        sensors: Name of each row's sensor.
    """
    # a sensor without a position has none in the log either
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


class ErrorModel(NamedTuple):
    """Scatter of the laws in the rows of a log.

    Attributes:
        record_sd: Part of each row's independent error that is due to the law; seconds
            for times, else ln.
        loading: Contribution of one standard deviation of each shared effect to each
            row: effects of shot and path for each quantity whose law has them, then
            those of neighbouring paths.
        common: Number of leading columns that do not belong to neighbouring paths.
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
        recording: Recording of the layout.
        layout: Rows of a log.
        weights: Weights of the correlation functions of neighbouring paths; None
            treats all paths as independent.
    """
    n = len(layout.quantity)
    variance = jnp.square(recording.record_sd)
    of_paths, of_neighbours = dict(recording.path_loading), []
    for name, quantity, shot in recording.fields:
        rows, first, path = paths_of(layout, quantity, shot)
        # a single path has no neighbour; too many would multiply the columns
        if weights is None or not 2 <= first.size <= MAX_PATHS:
            continue
        parts = split(
            picked(recording.place, rows[first]),
            picked(recording.placed, rows[first]),
            jnp.asarray(weights),
        )
        # several rows of one path share its values
        own, shared = (picked(part, path) for part in parts)
        if name in recording.arrival_sd:
            sd = picked(recording.arrival_sd[name], rows)
            # the shared part of the variance moves from the row to the columns
            variance += joined([(rows, jnp.square(sd) * (own - 1))], n)
            of_neighbours.append(joined([(rows, sd[:, None] * shared)], n))
        if name in of_paths:
            sd = picked(of_paths[name], rows)
            of_paths[name] = joined([(rows, sd * jnp.sqrt(own))], n)
            of_neighbours.append(joined([(rows, sd[:, None] * shared)], n))
    group = opaque_constant(np.array(layout.group))
    columns = list(recording.shot_loading.values())
    for of_path in of_paths.values():
        columns += [
            jnp.where(group == g, of_path, 0.0) for g in dict.fromkeys(layout.group)
        ]
    common = jnp.stack(columns, axis=1) if columns else jnp.zeros((n, 0))
    some = ~(variance <= 0)  # negated: NaN stays NaN
    sd = jnp.where(some, jnp.sqrt(jnp.where(some, variance, 1.0)), 0.0)
    loading = jnp.concatenate([common, *of_neighbours], axis=1)
    return ErrorModel(sd, loading, len(columns))


def paths_of(
    layout: Layout, quantity: str, shot: int
) -> tuple[Int[np.ndarray, " row"], Int[np.ndarray, " path"], Int[np.ndarray, " row"]]:
    """Return the rows of a quantity and charge, and their paths.

    Returns:
        The rows; index of the first row of each path; index of the path of each row.
    """
    rows, _ = layout.rows(quantity, shot)
    group = np.array(layout.group)[rows]
    _, first, path = np.unique(group, return_index=True, return_inverse=True)
    return rows, first, path


def loadings(recording: Recording, layout: Layout) -> Float[Array, "row effect"]:
    """Return the contribution of each effect of shot or path to each row.

    Each column is for one standard deviation; neighbouring paths are independent.
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
    own: Float[Array, " row"] | None = None,
) -> Float[Array, " row"]:
    """Return random readings of each row of a layout, errors included.

    Args:
        key: Random key.
        scene: Charges, air, ground and sensors.
        layout: Rows of a log.
        laws: Name of the law for each of `layout.quantities()`.
        sigma: Instrument error of each row: in its unit for `ADDITIVE`, else relative.
        noise: Distribution of the independent errors of instruments.
        own: Student-t errors of the instruments, of scale 1, instead of drawn ones.
            Batches draw them by `student_errors`; a log keeps `jax.random.t`, so that
            seeds reproduce.
    """
    recording = record(scene, layout, laws)
    shared_key, own_key = jax.random.split(key)
    # each log has one of the kernels, which the fit treats as unknown
    kernel = jax.random.randint(jax.random.fold_in(shared_key, 2), (), 0, len(TYPICAL))
    of_laws = error_model(recording, layout, jnp.eye(len(TYPICAL))[kernel])
    loading, neighbours = jnp.split(of_laws.loading, [of_laws.common], axis=1)
    shared = loading @ jax.random.normal(shared_key, (loading.shape[1],))
    if neighbours.shape[1]:
        # a separate key: the draws of all other effects do not depend on this one
        fields_key = jax.random.fold_in(shared_key, 1)
        shared += neighbours @ jax.random.normal(fields_key, (neighbours.shape[1],))
    if noise == "gaussian":  # one draw for the sum of two normal errors
        both = independent_scale(sigma, of_laws.record_sd)
        error = shared + both * jax.random.normal(own_key, sigma.shape)
    else:
        if own is None:
            own = jax.random.t(own_key, STUDENT_FREEDOM, sigma.shape)
        law_key = jax.random.fold_in(shared_key, 3)
        of_record = jax.random.normal(law_key, sigma.shape)
        error = shared + of_laws.record_sd * of_record + sigma * own
    # additive quantities add their error, the others multiply: it is in ln
    moved, grown = recording.value + error, recording.value * jnp.exp(error)
    read = jnp.where(np.isin(layout.quantity, ADDITIVE), moved, grown)
    circular = np.isin(layout.quantity, CIRCULAR)
    return jnp.where(circular, jnp.mod(read, 2 * math.pi), read)


def independent_scale(
    sigma: Float[ArrayLike, "..."], record_sd: Float[ArrayLike, "..."]
) -> Float[Array, "..."]:
    """Return the scale of the independent error of rows in a fit.

    The standard deviation of a normal error, the scale of a Student-t one. With scales,
    90 % intervals from normal errors contain the truth in 94 % of logs of many rows;
    a Student-t of the same standard deviation would have 80 %.

    Args:
        sigma: Instrument error of each row.
        record_sd: Scatter of the law from record to record.
    """
    return jnp.hypot(sigma, record_sd)


def student_errors(
    key: PRNGKeyArray, freedom: float, count: int
) -> Float[Array, " row"]:
    r"""Return independent errors of Student's distribution.

    $$t = \sqrt{\nu (U^{-2/\nu} - 1)} \cos 2 \pi V$$

    with $U$ and $V$ uniform, exactly.

    Args:
        key: Random key.
        freedom: Degrees of freedom $\nu$, positive.
        count: Number of errors.

    References:
        Bailey (1994), Polar generation of random variates with the t-distribution,
        Math. Comp. 62, 779-781, the theorem of section 2; from memory.
    """
    # the smallest normal number, not 0: ln u has to stay finite

    least = jnp.finfo(jnp.zeros(()).dtype).tiny
    u, v = jax.random.uniform(key, (2, count), minval=least)
    # u^(-2/nu) - 1 by expm1: it cancels for u near 1
    length = jnp.sqrt(freedom * jnp.expm1(-2.0 / freedom * jnp.log(u)))
    return length * jnp.cos(2.0 * math.pi * v)


_observe = eqx.filter_jit(observe)
