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
    from jblast.sensors.camera.rendering.appearance import Appearance
    from jblast.sensors.camera.rendering.view_set import ViewSet

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
    from jblast.cli.arguments.flights.carried_camera import (
        camera_path,
        landscape_asked,
        still_landscape,
    )
    from jblast.cli.arguments.views import views_named
    from jblast.scene import draw_scene, read_scene
    from jblast.sensors.camera.files.backgrounds import MovingBackground
    from jblast.sensors.camera.files.depth import read_depth
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
    views = views_named(asked.views, scene, camera) if asked.views else None
    times = _times(scene, float(camera.frames_hz), views, asked, most)
    film = Film(
        scene,
        camera,
        times,
        views=views,
        supersample=asked.supersample,
        depth=None if asked.depth is None else read_depth(asked.depth, camera),
        appearance=_appearance(asked, camera),
        bloom=asked.bloom,
    )
    path = camera_path(asked, uncertain, camera, times)
    ground = landscape_asked(asked, carried=path is not None)
    if ground is not None:
        light = ground if path is not None else still_landscape(ground, camera)
        film = replace(film, background=light, gain=_gain(asked, camera))
    elif asked.background is not None:
        light = background_named(asked.background, camera, times)
        film = replace(film, background=light)
    if path is not None:
        _refuse_still(film, asked)
        return replace(film, path=path)
    # a background that moves is to be seen itself
    if not isinstance(film.background, MovingBackground):
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


def _daylight(asked: argparse.Namespace, camera: "Camera") -> float | None:
    """Return the light of sky and sun [lx]; None: full sun."""
    if asked.daylight is None and camera.daylight is not None:
        return float(camera.daylight)
    return asked.daylight


def _gain(asked: argparse.Namespace, camera: "Camera") -> float:
    """Return the gain of pictures of ground and sky: less light is shown darker."""
    from jblast.sensors.camera.image.tone import picture_gain

    daylight = _daylight(asked, camera)
    return 1.0 if daylight is None else picture_gain(daylight)


def _appearance(asked: argparse.Namespace, camera: "Camera") -> "Appearance":
    """Return how bright day and fire are; the picture is exposed for the day."""
    from jblast.sensors.camera.rendering.appearance import Appearance

    flash = asked.flash == "on"
    daylight = _daylight(asked, camera)
    if daylight is None:
        return Appearance(flash=flash)
    return Appearance(white=daylight / math.pi, flash=flash)


def _times(
    scene: "Scene",
    hz: float,
    views: "ViewSet | None",
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


def lifted(film: "Film") -> float | None:
    """Return how far above the ground a set stands that shows a burst on it [m].

    None where it stands on it, or there is no such set.
    """
    from jblast.sensors.camera.rendering.baked.explosion_views import ExplosionViews
    from jblast.sensors.camera.rendering.baked.plane import foot_height

    if not isinstance(film.views, ExplosionViews):
        return None
    highest = max(float(foot_height(charge)) for charge in film.scene.charges)
    return highest if highest > 0 else None


def _refuse_still(film: "Film", asked: argparse.Namespace) -> None:
    """Refuse a picture behind a camera that moves, if it is always the same."""
    if asked.depth is not None:
        raise InputError(
            "--depth: expected a camera that stands still, got one that moves, before "
            "which nothing stays where it is"
        )
    if isinstance(film.background, np.ndarray) and film.background.ndim > 1:
        raise InputError(
            f"--background: expected sky, light, a folder with a frame for each or a "
            f"video, behind a camera that moves, got a picture, {asked.background!r}"
        )


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
