"""What `jblast render` is asked to film: every word checked before the first frame."""

import argparse
import math
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from jblast.errors import InputError

if TYPE_CHECKING:
    from jblast.scene import Camera, Scene
    from jblast.sensors.camera.film import Film
    from jblast.sensors.camera.rendering.billboards import Views

TOO_MANY = 1_000_000
"""Frames: a quarter of an hour at 1 kHz; more are probably a slip of the pen."""


def film_asked(asked: argparse.Namespace, most: int) -> "Film":
    """Return the film a command line asks for.

    Args:
        asked: The options.
        most: Frames where nothing is said of how many.

    Raises:
        InputError: Something in it cannot be; the message names the option or the key.
    """
    import jax

    from jblast.cli.arguments.background import background_named
    from jblast.scene import draw_scene, read_scene
    from jblast.sensors.camera.files.views import read_views
    from jblast.sensors.camera.film import Film

    uncertain = read_scene(asked.scene)
    if uncertain.scene.camera is None:
        raise InputError(
            f"{asked.scene}: expected a [camera] to look through, got none"
        )
    scene = draw_scene(jax.random.key(asked.seed), uncertain)
    for charge in scene.charges:
        if charge.range_m is not None:
            raise InputError(
                f"{asked.scene}: [charge] range_m: expected position_m, which a camera "
                "needs to see it; got a range"
            )
    camera = _camera(uncertain.scene.camera, asked)
    if asked.supersample < 1:
        raise InputError(f"--supersample: expected at least 1, got {asked.supersample}")
    views = read_views(asked.views) if asked.views else None
    times = _times(scene, float(camera.frames_hz), views, asked, most)
    film = Film(scene, camera, times, views=views, supersample=asked.supersample)
    if asked.background is not None:
        light = background_named(asked.background, camera, len(times))
        film = replace(film, background=light)
    if not isinstance(film.background, tuple):  # one that moves is to be seen itself
        _refuse_looking_away(film, asked.scene)
    return film


def _camera(camera: "Camera", asked: argparse.Namespace) -> "Camera":
    """Return the scene's camera, with the frame rate and thresholds of the options."""
    if asked.threshold is not None:
        camera = replace(camera, threshold=np.array(asked.threshold))
    if asked.fps is not None:
        hz, exposure = asked.fps, float(camera.exposure_s)
        if exposure * hz > 1.0:
            raise InputError(
                f"--fps: expected at most {1 / exposure:g} Hz, as the camera's "
                f"exposure_s is {exposure:g} s; got '{hz:g}'"
            )
        camera = replace(camera, frames_hz=hz)
    return camera


def _times(
    scene: "Scene",
    hz: float,
    views: "Views | None",
    asked: argparse.Namespace,
    most: int,
) -> np.ndarray:
    """Return when the frames begin."""
    from jblast.waves.fireball import fireball_duration

    bursts = [float(charge.time_s) for charge in scene.charges]
    if asked.times is not None and asked.seconds is not None:
        raise InputError("--times: expected either --times or --seconds, got both")
    start, bound = min(bursts), math.inf
    if asked.times is not None:
        start, stop = asked.times
        seconds = stop - start
    elif asked.seconds is not None:
        seconds = asked.seconds
    else:
        bound = most
        if views is None:
            masses = [c.tnt_mass("fireball_radius_m") for c in scene.charges]
            lives = [float(fireball_duration(mass)) for mass in masses]
        else:
            lives = [float(views.duration(charge)) for charge in scene.charges]
        ends = [burst + life for burst, life in zip(bursts, lives, strict=True)]
        seconds = max(ends) - start
    # a whole number of frames is not lost to rounding
    count = min(math.ceil(seconds * hz - 1e-6), bound)
    fewest = 1 if asked.mode == "rgb" else 2
    if not fewest <= count <= TOO_MANY:
        raise InputError(
            f"--{'times' if asked.times else 'seconds'}: expected {fewest} to "
            f"{TOO_MANY:,} frames, got {max(count, 0):,.0f} of {hz:g} Hz in "
            f"{seconds:g} s"
        )
    return start + np.arange(int(count)) / hz


def _refuse_looking_away(film: "Film", source: str) -> None:
    """Refuse a camera that would never see the blast, before frames without it."""
    from jblast.scene import quaternion_matrix
    from jblast.sensors.camera.rendering.visibility import in_view, off_axis

    if in_view(film.scene, film.camera, film.views):
        return
    charge = film.scene.charge
    place = np.array(charge.position_m)
    sight = place - np.asarray(film.camera.position)
    axis = np.asarray(quaternion_matrix(film.camera.quaternion))[:, 2]
    angle = math.degrees(float(off_axis(film.scene, film.camera)))
    raise InputError(
        f"{source}: [camera]: expected a camera that sees some of the blast, got one "
        f"that looks towards {_way(axis)}; the blast is towards {_way(sight)}, "
        f"{angle:.0f} degrees from its axis, and only the background would be seen"
    )


def _way(vector: np.ndarray) -> str:
    """Return a direction in words."""
    east, north, up = (float(part) for part in vector)
    bearing = math.degrees(math.atan2(east, north)) % 360
    above = math.degrees(math.atan2(up, math.hypot(east, north)))
    return f"{bearing:.0f} degrees from north, {above:.0f} degrees up"
