"""A small film of a fireball, from which events are made and numbers found again."""

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Int

from jblast.scene import Camera, Charge, Scene
from jblast.scene.camera import look_at
from jblast.sensors.camera.events.ideal import ideal_events, log_intensity
from jblast.sensors.camera.fireball import Appearance
from jblast.sensors.camera.image import luminance
from jblast.sensors.camera.rendering import render
from jblast.study.event_inversion.fit_events import event_counts

MASS, START = 100.0, 0.12
"""Charge [kg] and when it goes off [s]."""
TIMES = np.arange(76) * 4e-3
"""Of the frames [s]; the fireball grows by 1/e in 4.6 ms."""
THRESHOLDS = (0.2, 0.2)
HEIGHT, WIDTH = 18, 24


def film_camera() -> Camera:
    """Return a camera 80 m south of the charge."""
    position = jnp.array([0.0, -80.0, 3.0])
    return Camera(
        position=position,
        quaternion=look_at(position, jnp.array([0.0, 0.0, 4.0])),
        focal=jnp.array([100.0, 100.0]),
        center=jnp.array([(WIDTH - 1) / 2, (HEIGHT - 1) / 2]),
        width=WIDTH,
        height=HEIGHT,
    )


def coordinates(mass: float, start: float) -> Float[np.ndarray, "2"]:
    """Return numbers of the order of one: ln of kilograms, tenths of seconds."""
    return np.array([np.log(mass), 10.0 * start])


def log_frames(
    values: Float[Array, "2"], times: Float[Array, " frame"]
) -> Float[Array, "frame height width"]:
    """Return the logarithm of the light for some `coordinates`."""
    mass, start = jnp.exp(values[0]), 0.1 * values[1]
    charge = dataclasses.replace(
        Charge(position_m=(0.0, 0.0, 1.5)), mass_kg=mass, time_s=start
    )
    # what the fire does to the ground is left out: the fireball itself is looked for
    look = Appearance(flash=False)
    scene, camera = Scene(charge=charge), film_camera()
    frames = render(scene, camera, times, exposures=1, appearance=look)
    return log_intensity(luminance(frames))


@jax.jit
def true_frames(times: Float[Array, " frame"]) -> Float[Array, "frame height width"]:
    """Return the film itself."""
    return log_frames(jnp.asarray(coordinates(MASS, START)), times)


def true_counts() -> Int[np.ndarray, "interval height width"]:
    """Return the film's events between frames, brighter less darker."""
    times = jnp.asarray(TIMES)
    events = ideal_events(true_frames(times), times, THRESHOLDS, capacity=1 << 14)
    return event_counts(events, TIMES, (HEIGHT, WIDTH))
