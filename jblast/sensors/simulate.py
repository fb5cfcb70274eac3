"""A whole simulated log: a scene drawn from its priors, recorded with errors."""

from collections.abc import Sequence
from dataclasses import replace

import equinox as eqx
import jax
import numpy as np
from jaxtyping import Float, PRNGKeyArray

from jblast.observations import Observations, observed
from jblast.quantities import ADDITIVE, BY_CAMERA
from jblast.scene import Scene, UncertainScene, draw_scene
from jblast.scene.uncertain import value_of
from jblast.sensors.bursts import height_notes, settled
from jblast.sensors.law_choice import law_names, resolve_laws
from jblast.sensors.layout import Layout, planned_layout
from jblast.sensors.observe import Noise, observe
from jblast.sensors.shapes import check_scene


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
        scene: What is there.
        noise: Distribution of the independent errors.

    Returns:
        A log; its comments say by which laws and curves.

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
        scene: What is there.
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
