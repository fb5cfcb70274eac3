"""The film of a scene's camera, checked before the first frame.

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

from jblast.errors import InputError, argument
from jblast.scene import Camera, draw_scene, quaternion_matrix, read_scene
from jblast.sensors.camera.files.backgrounds import background_named
from jblast.sensors.camera.files.images import read_colours, read_depth
from jblast.sensors.camera.files.recordings import (
    MovingBackground,
    read_camera_path,
)

if TYPE_CHECKING:
    from jblast.scene import Scene, UncertainScene
    from jblast.sensors.camera.billboards import Views, ViewSet
    from jblast.sensors.camera.film import Film
    from jblast.sensors.camera.fireball import Appearance
    from jblast.sensors.camera.geometry import CameraPath
    from jblast.sensors.camera.surroundings import Landscape

TOO_MANY = 1_000_000
"""Frames: a quarter of an hour at 1 kHz; more are probably a slip of the pen."""
Mode = Literal["rgb", "events", "both"]
SHIPPED_SET = "explosion"
SKY = "sky"
"""Name of the background of ground and sky."""


@dataclass(frozen=True)
class FilmOptions:
    """Options of a film.

    Attributes:
        seed: Of the priors, and of the camera's noise.
        mode: Whether frames, events or both are made of it.
        times: Times of the first frame and of the end [s]; default: from the first
            explosion until no fireball glows, at most `most_frames`.
        seconds: Duration from the first explosion [s].
        fps: Frames a second; default: the camera's.
        background: Linear light, R,G,B, a picture, a folder, a video, or "sky"
            (`sensors.camera.files.backgrounds`); default: a grey of 0.18, sky behind a
            camera that moves.
        views: "explosion", or the folder of another set of pictures; default: a smooth
            fireball.
        ground: Texture of the ground and its scale, FILE.png:METRES_PER_PIXEL.
        sun: Azimuth and elevation of the sun [degree].
        flight: File of the path of the vehicle that carries the camera; default: the
            scene's vehicle is flown.
        depth: File of the distances of the background.
        daylight: Light of sky and sun on the ground [lx]; default: the camera's, or
            full sun.
        flash: Whether the fire lights the ground.
        bloom: Share of the light that the lens spreads.
        supersample: Rays along each side of a pixel.
        threshold: Thresholds of events, brighter and darker; default: the camera's.
        most_frames: Most frames where neither times nor seconds are given.
    """

    seed: int = 0
    mode: Mode = "both"
    times: tuple[float, float] | None = None
    seconds: float | None = None
    fps: float | None = None
    background: str | None = None
    views: str | None = None
    ground: str | None = None
    sun: tuple[float, float] | None = None
    flight: str | None = None
    depth: str | None = None
    daylight: float | None = None
    flash: bool = True
    bloom: float = 0.0
    supersample: int = 1
    threshold: tuple[float, float] | None = None
    most_frames: int = 1000


def film_of(
    scene_file: str | os.PathLike[str], options: FilmOptions | None = None
) -> "Film":
    """Return the film of a scene's camera.

    Args:
        scene_file: The scene.
        options: What is filmed, and how; default: as `jblast render`.

    Raises:
        InputError: Something cannot be filmed; the message names the argument or the
            key of the scene.

    Example:
        `film_of("scene.toml", FilmOptions(seconds=0.1)).frames()`
    """
    import jax

    from jblast.sensors.camera.film import Film

    source, options = os.fspath(scene_file), options or FilmOptions()
    uncertain = read_scene(source)
    if uncertain.scene.camera is None:
        raise InputError(f"{source}: expected a [camera] to look through, got none")
    scene = draw_scene(jax.random.key(options.seed), uncertain)
    for charge in scene.charges:
        if charge.range_m is not None:
            raise InputError(
                f"{source}: [charge] range_m: expected position_m, which a camera "
                "needs to see it; got a range"
            )
    camera = _camera(uncertain.scene.camera, options)
    if options.supersample < 1:
        raise InputError(
            f"{argument('supersample')}: expected at least 1, got {options.supersample}"
        )
    views = views_named(options.views, scene, camera) if options.views else None
    times = _times(scene, float(camera.frames_hz), views, options)
    film = Film(
        scene,
        camera,
        times,
        views=views,
        supersample=options.supersample,
        depth=None if options.depth is None else read_depth(options.depth, camera),
        appearance=_appearance(options, camera),
        bloom=options.bloom,
    )
    path = camera_path(source, options, uncertain, camera, times)
    ground = landscape_of(options, carried=path is not None)
    if ground is not None:
        light = ground if path is not None else still_landscape(ground, camera)
        film = replace(film, background=light, gain=_gain(options, camera))
    elif options.background is not None:
        light = background_named(options.background, camera, times)
        film = replace(film, background=light)
    if path is not None:
        _refuse_still(film, options)
        return replace(film, path=path)
    # a background that moves is to be seen itself
    if not isinstance(film.background, MovingBackground):
        _refuse_looking_away(film, source)
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


def _daylight(options: FilmOptions, camera: "Camera") -> float | None:
    """Return the light of sky and sun [lx]; None: full sun."""
    if options.daylight is None and camera.daylight is not None:
        return float(camera.daylight)
    return options.daylight


def _gain(options: FilmOptions, camera: "Camera") -> float:
    """Return the gain of pictures of ground and sky: less light is shown darker."""
    from jblast.sensors.camera.image import picture_gain

    daylight = _daylight(options, camera)
    return 1.0 if daylight is None else picture_gain(daylight)


def _appearance(options: FilmOptions, camera: "Camera") -> "Appearance":
    """Return how bright day and fire are; the picture is exposed for the day."""
    from jblast.sensors.camera.fireball import Appearance

    flash = options.flash
    daylight = _daylight(options, camera)
    if daylight is None:
        return Appearance(flash=flash)
    return Appearance(white=daylight / math.pi, flash=flash)


def _times(
    scene: "Scene",
    hz: float,
    views: "ViewSet | None",
    options: FilmOptions,
) -> np.ndarray:
    """Return when the frames begin."""
    from jblast.waves.fireball import fireball_duration

    bursts = [float(charge.time_s) for charge in scene.charges]
    if options.times is not None and options.seconds is not None:
        both = argument("times"), argument("seconds")
        raise InputError(f"{both[0]}: expected either {both[0]} or {both[1]}, got both")
    start, bound = min(bursts), math.inf
    if options.times is not None:
        start, stop = options.times
        seconds = stop - start
    elif options.seconds is not None:
        seconds = options.seconds
    else:
        bound = options.most_frames
        if views is None:
            masses = [c.tnt_mass("fireball_radius_m") for c in scene.charges]
            lives = [float(fireball_duration(mass)) for mass in masses]
        else:
            lives = [float(views.duration(charge)) for charge in scene.charges]
        ends = [burst + life for burst, life in zip(bursts, lives, strict=True)]
        seconds = max(ends) - start
    # a whole number of frames is not lost to rounding
    count = min(math.ceil(seconds * hz - 1e-6), bound)
    fewest = 1 if options.mode == "rgb" else 2
    if not fewest <= count <= TOO_MANY:
        raise InputError(
            f"{argument('times' if options.times else 'seconds')}: expected {fewest} "
            f"to {TOO_MANY:,} frames, got {max(count, 0):,.0f} of {hz:g} Hz in "
            f"{seconds:g} s"
        )
    return start + np.arange(int(count)) / hz


def lifted(film: "Film") -> float | None:
    """Return how far above the ground a set stands that shows a burst on it [m].

    None where it stands on it, or there is no such set.
    """
    from jblast.sensors.camera.baked_explosion import ExplosionViews, foot_height

    if not isinstance(film.views, ExplosionViews):
        return None
    highest = max(float(foot_height(charge)) for charge in film.scene.charges)
    return highest if highest > 0 else None


def _refuse_still(film: "Film", options: FilmOptions) -> None:
    """Refuse a picture behind a camera that moves, if it is always the same."""
    if options.depth is not None:
        raise InputError(
            f"{argument('depth')}: expected a camera that stands still, got one that "
            "moves, before which nothing stays where it is"
        )
    if isinstance(film.background, np.ndarray) and film.background.ndim > 1:
        raise InputError(
            f"{argument('background')}: expected sky, light, a folder with a frame for "
            "each or a video, behind a camera that moves, got a picture, "
            f"{options.background!r}"
        )


def _refuse_looking_away(film: "Film", source: str) -> None:
    """Refuse a camera that would never see the blast, before frames without it."""
    from jblast.sensors.camera.rendering import in_view, off_axis

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


def views_named(word: str, scene: "Scene", camera: "Camera") -> "ViewSet":
    """Return the pictures that the option names.

    Of an explosion set a camera that stands still has only those views read that it is
    shown.

    Args:
        word: "explosion", which is the set that comes with jblast even where there is a
            folder of this name (that is ./explosion); else a folder.
        scene: Where the charges are.
        camera: Who looks.

    Raises:
        InputError: They cannot be read, or all were taken from below the burst and the
            camera looks on from above it; the message names the file.
    """
    from jblast.sensors.camera.files.views import (
        explosion_views,
        is_explosion_set,
        read_views,
    )

    shipped = word == SHIPPED_SET
    if not shipped and not is_explosion_set(word):
        return _from_a_side_of_the_camera(read_views(word), word, scene, camera)
    folder = None if shipped else word
    if camera.mount:
        return explosion_views(folder)  # it goes where it is taken
    eye = np.asarray(camera.position, float)
    places = np.array([[float(x) for x in c.position_m] for c in scene.charges])
    return explosion_views(folder, towards=eye - places)


def _from_a_side_of_the_camera(
    views: "Views", word: str, scene: "Scene", camera: "Camera"
) -> "Views":
    """Return the pictures, if one shows what a camera above the burst would see."""
    from jblast.sensors.camera.files.views import INDEX

    if camera.mount or (views.direction[:, 2] >= 0.0).any():
        return views
    height = float(np.asarray(camera.position)[2])
    if any(height > float(charge.position_m[2]) for charge in scene.charges):
        raise InputError(
            f"{Path(word) / INDEX}: elevation_deg: expected views from above the "
            f"burst, where the camera is, got {len(views.direction)} from below alone"
        )
    return views


def folder_named(word: str | None) -> str | None:
    """Return the folder of another set of pictures; None for the one of jblast."""
    return None if word == SHIPPED_SET else word


def camera_path(
    scene: str,
    options: FilmOptions,
    uncertain: "UncertainScene",
    camera: "Camera",
    times: np.ndarray,
) -> "CameraPath | None":
    """Return the path of what carries a camera; None if it stands still.

    It is read from a file, or the scene's vehicle flies through its blasts.

    Raises:
        InputError: It is told and not needed, cannot be read or flown, or ends before
            the film does.
    """
    if not camera.mount:
        if options.flight is not None:
            raise InputError(
                f'{argument("flight")}: expected a camera with mount = "vehicle" in '
                f"{scene}, got one that stands still"
            )
        return None
    end = float(times[-1]) + float(camera.exposure_s)
    if options.flight is None:
        path, source = _flown(uncertain, end, options.seed), scene
    else:
        path, source = read_camera_path(options.flight), options.flight
    first, last = float(path.time[0]), float(path.time[-1])
    if not first <= times[0] <= end <= last:
        raise InputError(
            f"{source}: expected a flight as long as the film, {times[0]:g} to "
            f"{end:g} s, got one from {first:g} to {last:g} s"
        )
    return path


def _flown(uncertain: "UncertainScene", end: float, seed: int) -> "CameraPath":
    """Fly the scene's vehicle, and return where it was."""
    from jblast.sensors.camera.geometry import CameraPath
    from jblast.study.flight_results import Options, trajectory_of
    from jblast.study.flights import checked_scene, drawn_scenes, flight_seconds, fly

    vehicle = checked_scene(uncertain, 1, False)
    scene = drawn_scenes(uncertain, 1, seed)
    usual = flight_seconds(scene, vehicle, uncertain.source, Options())
    seconds = max(usual, math.ceil(10 * end) / 10)
    flights = fly(uncertain, Options(seconds=seconds), seed=seed)
    trajectory = trajectory_of(flights, next(iter(flights.holds)))
    kept = np.isfinite(np.asarray(trajectory.position_m)).all(axis=-1)
    return CameraPath(
        trajectory.time_s[kept],
        trajectory.position_m[kept],
        trajectory.quaternion[kept],
    )


def landscape_of(options: FilmOptions, *, carried: bool) -> "Landscape | None":
    """Return ground and sky, where they are requested or the camera moves.

    Raises:
        InputError: The ground is no image and scale, or another background is named.
    """
    from jblast.sensors.camera.surroundings import landscape, sun_at

    sun = None if options.sun is None else sun_at(*options.sun)
    sky = carried or options.background == SKY or options.ground is not None
    if sun is not None and (options.background not in (None, SKY) or not sky):
        raise InputError(
            f"{argument('sun')}: expected {argument('background')} {SKY} or "
            f"{argument('ground')} with it, got "
            f"{'neither' if options.background is None else repr(options.background)}"
        )
    if options.background not in (None, SKY):
        if options.ground is not None:
            raise InputError(
                f"{argument('ground')}: expected no {argument('background')} but {SKY} "
                f"with it, got {options.background!r}"
            )
        return None
    if options.ground is None:
        return landscape(sun=sun) if sky else None
    name, colon, scale = options.ground.rpartition(":")
    try:
        metres = float(scale)
    except ValueError:
        metres = math.nan
    if not (colon and name and 0.0 < metres < math.inf):
        raise InputError(
            f"{argument('ground')}: expected IMAGE.png:METRES_PER_PIXEL, as "
            f"field.png:0.05, got {options.ground!r}"
        )
    return landscape(read_colours(Path(name)), metres, sun=sun)


def still_landscape(ground: "Landscape", camera: "Camera") -> np.ndarray:
    """Return what a camera that stands still sees of ground and sky."""
    import jax.numpy as jnp

    from jblast.sensors.camera.geometry import pixel_rays

    light = ground.light(pixel_rays(camera), 1.0 / jnp.max(camera.focal))
    return np.moveaxis(np.asarray(light), 0, -1)
