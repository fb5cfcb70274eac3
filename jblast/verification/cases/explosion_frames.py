"""An explosion in frames: close up from a side that a set has not, and in a film.

`explosion_left_out` holds eight views of the explosion that comes with jblast, from
directions drawn at random and not among those of the set, at ten of its phases. A
close-up shows such a picture as it was rendered, texel by pixel.
"""

import time
from pathlib import Path
from typing import NamedTuple

import jax
import numpy as np
from jaxtyping import Array, Bool, Float

from jblast.scene import Camera, Charge, Scene, look_at
from jblast.sensors.camera import (
    ExplosionViews,
    ViewSet,
    linear_to_srgb,
    luminance,
    render,
)
from jblast.sensors.camera.fireball import Appearance
from jblast.waves.fireball import fireball, fireball_duration

LEFT_OUT = Path(__file__).parent / "explosion_left_out"
MASS = 15.0
FAR = 30.0
"""Of a close-up's camera, in radii of the fireball."""
BEHIND = 0.18
"""Grey behind the fire, linear."""
REPEATS = 3
"""Of which the quickest counts."""
MIN_OPACITY = 0.02
"""Opacity from which a pixel is the fire's."""


class CloseUp(NamedTuple):
    """A picture of the fire alone.

    Attributes:
        grey: Luminance before an even grey, as it is looked at (sRGB), 0 to 1.
        fire: Which pixels are the fire's.
    """

    grey: Float[np.ndarray, "height width"]
    fire: Bool[np.ndarray, "height width"]


def close_up(
    views: ExplosionViews, shown: ExplosionViews, view: int, frame: int
) -> CloseUp:
    """Return what a set shows from a view's side, as large as the view's picture.

    Args:
        views: The set that is looked at.
        shown: The set that has the view.
        view: Its number.
        frame: Of the set that has the view.
    """
    time = float(shown.phase[frame]) * float(fireball_duration(MASS))
    radius = float(fireball(MASS, time).radius)
    place = FAR * radius * np.asarray(shown.direction[view])
    size = shown.frames.shape[2]
    # the outline of a ball is seen a little larger than the ball
    focal = float(shown.radius[view, frame]) * np.sqrt(FAR**2 - 1.0)
    camera = Camera(
        position=place,
        quaternion=look_at(place, np.zeros(3)),
        focal=np.full(2, focal),
        center=np.asarray(shown.anchor[view]),
        width=size,
        height=size,
    )
    scene = Scene(charge=Charge(mass_kg=MASS))
    (layer,) = np.asarray(
        render(scene, camera, np.array([time]), views=views, ground=False, alpha=True)
    )
    alpha = layer[..., 3:]
    light = np.clip(alpha * layer[..., :3] + (1.0 - alpha) * BEHIND, 0.0, 1.0)
    return CloseUp(
        luminance(np.asarray(linear_to_srgb(light))), alpha[..., 0] > MIN_OPACITY
    )


class Filmed(NamedTuple):
    """A film of one charge.

    Attributes:
        scene: 15 kg on the ground.
        camera: 40 m from it.
        times: From the burst until the fire is out [s].
        appearance: The fire lights the ground, or not.
    """

    scene: Scene
    camera: Camera
    times: Float[np.ndarray, " frame"]
    appearance: Appearance


def filmed(
    frames: int, *, width: int = 640, height: int = 480, flash: bool = True
) -> Filmed:
    """Return a film of an explosion whose fireball is 0.4 of the image's height wide.

    Args:
        frames: How many.
        width: Of the image [px].
        height: Likewise.
        flash: Whether the fire lights the ground.
    """
    place, life = np.array([0.0, -40.0, 2.0]), float(fireball_duration(MASS))
    camera = Camera(
        position=place,
        quaternion=look_at(place, np.array([0.0, 0.0, 4.0])),
        focal=np.full(2, 1.8 * height),
        center=0.5 * np.array([width - 1.0, height - 1.0]),
        width=width,
        height=height,
    )
    times = life * (np.arange(frames) + 0.5) / frames
    scene = Scene(charge=Charge(mass_kg=MASS))
    return Filmed(scene, camera, times, Appearance(flash=flash))


def processor_seconds(views: ViewSet | None, film: Filmed) -> float:
    """Return the time of processors that a frame of a film takes, all with it [s].

    Not of the clock: others may use the machine.

    Args:
        views: The set; None for the smooth ball.
        film: What is rendered.
    """

    def run() -> Array:
        return render(
            film.scene,
            film.camera,
            film.times,
            views=views,
            appearance=film.appearance,
        )

    jax.block_until_ready(run())
    best = np.inf
    for _ in range(REPEATS):
        start = time.process_time()
        jax.block_until_ready(run())
        best = min(best, time.process_time() - start)
    return best / len(film.times)
