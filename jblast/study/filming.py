"""Film of a scene's camera, with all checks before the first frame.

Camera, frame times, background (also ground and sky), pictures of an explosion, and the
path of a camera that is mounted on a vehicle: read from a file, or flown through the
blasts of the scene.
"""

import math
import os
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Literal

import numpy as np

from jblast.errors import InputError, argument, require
from jblast.scene import Camera, draw_scene, quaternion_matrix
from jblast.sensors.camera.files.backgrounds import background_named, read_camera_path
from jblast.sensors.camera.files.images import read_colours, read_depth
from jblast.sensors.camera.files.recordings import ImageSequence

if TYPE_CHECKING:
    from jblast.scene import Scene, UncertainScene
    from jblast.sensors.camera.explosion import ExplosionViews
    from jblast.sensors.camera.film import Film
    from jblast.sensors.camera.geometry import CameraPath
    from jblast.sensors.camera.surroundings import Landscape

MAX_FRAMES = 1_000_000
"""Largest number of frames, a quarter of an hour at 1 kHz: more are probably a mistake
in a time."""
Mode = Literal["rgb", "events", "both"]
SHIPPED_SET = "explosion"
"""Name of the set of explosion images that is part of jblast."""
SKY = "sky"
"""Name of the background of ground and sky."""


@dataclass(frozen=True)
class FilmOptions:
    """Options of a film.

    Attributes:
        seed: Seed of the priors and of the camera's noise.
        mode: Output: frames, events or both.
        times: Times of the first frame and of the end [s]; default: from the first
            explosion until no fireball glows, at most `most_frames`.
        seconds: Duration from the first explosion [s].
        fps: Frame rate [Hz]; default: the camera's.
        background: Linear light, R,G,B, an image, a folder, a video, or "sky"
            (`sensors.camera.files.backgrounds`); default: a grey of 0.18, sky for a
            moving camera.
        views: "explosion", or the folder of another set of images; default: a smooth
            fireball.
        ground: Texture of the ground and its scale, FILE.png:METRES_PER_PIXEL.
        flight: File of the path of the vehicle that carries the camera; default: the
            simulated flight of the scene's vehicle.
        depth: File of the depths of the background.
        daylight: Illuminance of the ground by sky and sun [lx]; default: the camera's,
            or full sun.
        flash: Whether the fire lights the ground.
        threshold: Thresholds of events, brighter and darker; default: the camera's.
        most_frames: Largest number of frames without times or seconds.
    """

    seed: int = 0
    mode: Mode = "both"
    times: tuple[float, float] | None = None
    seconds: float | None = None
    fps: float | None = None
    background: str | None = None
    views: str | None = None
    ground: str | None = None
    flight: str | None = None
    depth: str | None = None
    daylight: float | None = None
    flash: bool = True
    threshold: tuple[float, float] | None = None
    most_frames: int = 1000


def film_of(
    scene_file: str | os.PathLike[str], options: FilmOptions | None = None
) -> "Film":
    """Return the film of a scene's camera.

    Args:
        scene_file: Scene file.
        options: Options of the film; default: those of `jblast render`.

    Raises:
        InputError: An option or a key of the scene is invalid; the message names it.

    Example:
        `film_of("scene.toml", FilmOptions(seconds=0.1)).frames()`
    """
    import jax

    from jblast.sensors.camera.files.views import views_of
    from jblast.sensors.camera.film import Film
    from jblast.sensors.camera.fireball import Appearance
    from jblast.sensors.camera.image import picture_gain
    from jblast.study.flights import scene_to_run

    source, options = os.fspath(scene_file), options or FilmOptions()
    uncertain = scene_to_run(source, seed=options.seed)
    if uncertain.scene.camera is None:
        raise InputError(f"{source}: expected a [camera], got none")
    scene = draw_scene(jax.random.key(options.seed), uncertain)
    happens = not all(charge.never for charge in scene.charges)
    require(happens, f"{source}: [charge]", "a blast to film", "none")
    placed = all(charge.range_m is None for charge in scene.charges)
    words = "position_m, which a camera needs"
    require(placed, f"{source}: [charge] range_m", words, "a range")
    camera = _camera(uncertain.scene.camera, options)
    views = None
    if options.views:
        views = views_of(scene, camera, folder_named(options.views))
    times = _times(scene, float(camera.frames_hz), views, options)
    daylight = camera.daylight if options.daylight is None else options.daylight
    appearance, gain = Appearance(flash=options.flash), 1.0
    if daylight is not None:  # a film that is exposed for less than full sun
        white, gain = float(daylight) / math.pi, picture_gain(float(daylight))
        appearance = Appearance(white=white, flash=options.flash)
    film = Film(
        scene,
        camera,
        times,
        views=views,
        depth=None if options.depth is None else read_depth(options.depth, camera),
        appearance=appearance,
    )
    path = _path(source, options, uncertain, camera, times)
    ground = landscape_of(options, carried=path is not None)
    if ground is not None:
        light = ground if path is not None else still_landscape(ground, camera)
        film = replace(film, background=light, gain=gain)
    elif options.background is not None:
        light = background_named(options.background, camera, times)
        film = replace(film, background=light)
    if path is not None:
        _check_moving_camera(film, options)
        return replace(film, path=path)
    # a moving background may be filmed for itself, without a blast
    if not isinstance(film.background, ImageSequence):
        _check_blast_in_view(film, source)
    return film


def _camera(camera: "Camera", options: FilmOptions) -> "Camera":
    """Return the scene's camera, with the frame rate and thresholds of the options."""
    if options.threshold is not None:
        camera = replace(camera, threshold=np.array(options.threshold))
    if options.fps is not None:
        hz, exposure = options.fps, float(camera.exposure_s)
        if exposure * hz > 1.0:
            raise InputError(
                f"{argument('fps')}: expected at most {1 / exposure:g} Hz, as the "
                f"camera's exposure_s is {exposure:g} s; got '{hz:g}'"
            )
        camera = replace(camera, frames_hz=hz)
    return camera


def _times(
    scene: "Scene",
    hz: float,
    views: "ExplosionViews | None",
    options: FilmOptions,
) -> np.ndarray:
    """Return the start times of the frames [s]."""
    from jblast.sensors.camera.explosion import shown_for_s

    # each charge has its own time: the film covers all fireballs
    bursts = [float(charge.time_s) for charge in scene.charges]
    words = f"either {argument('times')} or {argument('seconds')}"
    one = options.times is None or options.seconds is None
    require(one, argument("times"), words, "both")
    start, bound = min(bursts), math.inf
    if options.times is not None:
        start, stop = options.times
        seconds = stop - start
    elif options.seconds is not None:
        seconds = options.seconds
    else:
        bound = options.most_frames
        lives = [shown_for_s(charge, views) for charge in scene.charges]
        stops = [burst + life for burst, life in zip(bursts, lives, strict=True)]
        seconds = max(stops) - start
    # rounding must not add a frame to a whole number of frame intervals
    count = min(math.ceil(seconds * hz - 1e-6), bound)
    # events are changes between two frames at least
    fewest = 1 if options.mode == "rgb" else 2
    where = argument("times" if options.times else "seconds")
    got = f"{max(count, 0):,.0f} of {hz:g} Hz in {seconds:g} s"
    words = f"{fewest} to {MAX_FRAMES:,} frames"
    require(fewest <= count <= MAX_FRAMES, where, words, got)
    return start + np.arange(int(count)) / hz


def lifted(film: "Film") -> float | None:
    """Return the height of a set of explosion images above the ground [m].

    None if the set shows the burst on the ground, or if there is no set.
    """
    from jblast.sensors.camera.explosion import foot_height

    if film.views is None or not film.views.hot:
        return None
    highest = max(float(foot_height(charge)) for charge in film.scene.charges)
    return highest if highest > 0 else None


def _check_moving_camera(film: "Film", options: FilmOptions) -> None:
    """Check that a moving camera has no fixed background.

    Raises:
        InputError: A depth or a single image is given.
    """
    got = "a moving one, whose background moves"
    require(options.depth is None, argument("depth"), "a fixed camera", got)
    image = isinstance(film.background, np.ndarray) and film.background.ndim > 1
    words = (
        "sky, light, a folder with an image for each frame or a video, for a moving "
        "camera"
    )
    got = f"the image {options.background!r}"
    require(not image, argument("background"), words, got)


def _check_blast_in_view(film: "Film", source: str) -> None:
    """Check that the blast is in the field of view.

    Raises:
        InputError: The camera would film the background only.
    """
    from jblast.sensors.camera.rendering import in_view, off_axis

    if in_view(film.scene, film.camera, film.views):
        return
    charge = film.scene.charge
    place = np.array(charge.position_m)
    sight = place - np.asarray(film.camera.position)
    axis = np.asarray(quaternion_matrix(film.camera.quaternion))[:, 2]
    angle = math.degrees(float(off_axis(film.scene, film.camera)))
    raise InputError(
        f"{source}: [camera]: expected the blast in the field of view, got a camera "
        f"that looks towards {_direction(axis)}; the blast is towards "
        f"{_direction(sight)}, {angle:.0f} degrees from its axis"
    )


def _direction(vector: np.ndarray) -> str:
    """Return the bearing and elevation of a vector as text."""
    east, north, up = (float(part) for part in vector)
    bearing = math.degrees(math.atan2(east, north)) % 360
    above = math.degrees(math.atan2(up, math.hypot(east, north)))
    return f"{bearing:.0f} degrees from north, {above:.0f} degrees up"


def folder_named(word: str | None) -> str | None:
    """Return the folder of a set of images; None for the one of jblast.

    "explosion" is that one, also if a folder has this name (which is ./explosion).
    """
    return None if word == SHIPPED_SET else word


def _path(
    scene: str,
    options: FilmOptions,
    uncertain: "UncertainScene",
    camera: "Camera",
    times: np.ndarray,
) -> "CameraPath | None":
    """Return the path of a mounted camera; None for a fixed one.

    The path is read from a file, or simulated for the scene's vehicle.

    Raises:
        InputError: A path is given for a fixed camera, it cannot be read or flown, or
            it is shorter than the film.
    """
    from jblast.study.flights import fly
    from jblast.world.perceived import camera_path

    if not camera.mount:
        words = f'a camera with mount = "vehicle" in {scene}'
        require(options.flight is None, argument("flight"), words, "a fixed one")
        return None
    end = float(times[-1]) + float(camera.exposure_s)
    if options.flight is None:
        # the film may continue after the default end of the flight
        flown = fly(uncertain, least_s=end, seed=options.seed)
        path, source = camera_path(flown.trajectory), scene
    else:
        path, source = read_camera_path(options.flight), options.flight
    first, last = float(path.time[0]), float(path.time[-1])
    words = f"a flight as long as the film, {times[0]:g} to {end:g} s"
    got = f"one from {first:g} to {last:g} s"
    require(first <= times[0] <= end <= last, source, words, got)
    return path


def landscape_of(options: FilmOptions, *, carried: bool) -> "Landscape | None":
    """Return ground and sky if they are requested or the camera moves; else None.

    Raises:
        InputError: The ground has another form than image and scale, or there is
            another background.
    """
    from jblast.sensors.camera.surroundings import landscape

    sky = carried or options.background == SKY or options.ground is not None
    if options.background not in (None, SKY):
        words = f"no {argument('background')} but {SKY} with it"
        got = repr(options.background)
        require(options.ground is None, argument("ground"), words, got)
        return None
    if options.ground is None:
        return landscape() if sky else None
    name, colon, scale = options.ground.rpartition(":")
    try:
        metres = float(scale)
    except ValueError:
        metres = math.nan
    right = colon and name and 0.0 < metres < math.inf
    words = "IMAGE.png:METRES_PER_PIXEL, as field.png:0.05"
    require(right, argument("ground"), words, repr(options.ground))
    return landscape(read_colours(Path(name)), metres)


def still_landscape(ground: "Landscape", camera: "Camera") -> np.ndarray:
    """Return the image of ground and sky of a fixed camera."""
    import jax.numpy as jnp

    from jblast.sensors.camera.geometry import pixel_rays

    light = ground.light(pixel_rays(camera), 1.0 / jnp.max(camera.focal))
    return np.moveaxis(np.asarray(light), 0, -1)
