"""The film that `jblast render` requests, checked before the first frame.

Camera, frame times, background (`--background`, `--ground`, `--sun`), pictures of an
explosion (`--views`), and the path of a camera that is mounted on a vehicle: read from
`--flight`, or flown through the blasts of the scene.
"""

import argparse
import math
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from jaxtyping import Float

from jblast.errors import InputError
from jblast.scene import Camera, draw_scene, quaternion_matrix, read_scene
from jblast.sensors.camera.files.images import (
    frame_files,
    read_colours,
    read_depth,
)
from jblast.sensors.camera.files.recordings import (
    MovingBackground,
    background_frames,
    background_image,
    background_video,
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
Background = float | Float[np.ndarray, "..."] | MovingBackground
SHIPPED_SET = "explosion"
SKY = "sky"
"""Word for `--background`: ground and sky."""


def film_asked(asked: argparse.Namespace, most: int) -> "Film":
    """Return the film a command line asks for.

    Args:
        asked: The options.
        most: Frames where nothing is said of how many.

    Raises:
        InputError: Something in it cannot be; the message names the option or the key.
    """
    import jax

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
    from jblast.sensors.camera.image import picture_gain

    daylight = _daylight(asked, camera)
    return 1.0 if daylight is None else picture_gain(daylight)


def _appearance(asked: argparse.Namespace, camera: "Camera") -> "Appearance":
    """Return how bright day and fire are; the picture is exposed for the day."""
    from jblast.sensors.camera.fireball import Appearance

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
    from jblast.sensors.camera.baked_explosion import ExplosionViews, foot_height

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


def background_named(
    text: str, camera: Camera, times: Float[np.ndarray, " frame"]
) -> Background:
    """Return the background a word names.

    Args:
        text: A grey of linear light, 0 to 1; red, green and blue with commas between; a
            PNG file; a directory of them, one for each frame; or a video, whose first
            frame stands behind the first frame. PNG files are sRGB.
        camera: Whose image size a file must have.
        times: Of the frames there are to be [s].

    Raises:
        InputError: It is none of these, or there are too few pictures.
    """
    try:
        numbers = [float(word) for word in text.split(",")]
    except ValueError:
        return _read(text, camera, times - times[0])
    light = np.array(numbers)
    if len(numbers) not in (1, 3) or not ((light >= 0) & (light <= 1)).all():
        raise InputError(
            f"--background: expected one or three numbers from 0 to 1, got {text!r}"
        )
    return numbers[0] if len(numbers) == 1 else light


def _read(
    text: str, camera: Camera, times: Float[np.ndarray, " frame"]
) -> Float[np.ndarray, "..."] | MovingBackground:
    """Return the image of a file, or pictures for times from the first frame on."""
    path = Path(text)
    if path.is_dir():
        files = frame_files(path)
        if len(files) < len(times):
            raise InputError(
                f"{path}: expected at least {len(times):,} frames, one for each that "
                f"is to be rendered, got {len(files):,}"
            )
        return background_frames(files[: len(times)], times, camera)
    if not path.is_file():
        raise InputError(
            "--background: expected a grey, R,G,B, a PNG file, a directory of them or "
            f"a video, got {text!r}"
        )
    if path.suffix.lower() == ".png":
        return background_image(path, camera)
    background = background_video(path, camera)
    # each frame is shown until the next one would be
    lasts = background.times[-1] * len(background.times) / (len(background.times) - 1)
    if times[-1] > lasts:
        raise InputError(
            f"{path}: expected a video as long as the film, {times[-1]:.6g} s, got one "
            f"of {lasts:.6g} s"
        )
    return background


def views_named(word: str, scene: "Scene", camera: "Camera") -> "ViewSet":
    """Return the pictures that `--views` names.

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
    """Return the folder of one's own that `--views` names; None where it names none."""
    return None if word == SHIPPED_SET else word


def camera_path(
    asked: argparse.Namespace,
    uncertain: "UncertainScene",
    camera: "Camera",
    times: np.ndarray,
) -> "CameraPath | None":
    """Return the path of what carries a camera; None if it stands still.

    It is read from --flight, or the scene's vehicle flies through its blasts.

    Raises:
        InputError: It is told and not needed, cannot be read or flown, or ends before
            the film does.
    """
    if not camera.mount:
        if asked.flight is not None:
            raise InputError(
                f'--flight: expected a camera with mount = "vehicle" in {asked.scene}, '
                "got one that stands still"
            )
        return None
    end = float(times[-1]) + float(camera.exposure_s)
    if asked.flight is None:
        path, source = _flown(uncertain, end, asked.seed), asked.scene
    else:
        path, source = read_camera_path(asked.flight), asked.flight
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


def landscape_asked(asked: argparse.Namespace, *, carried: bool) -> "Landscape | None":
    """Return ground and sky, where they are asked for or a camera moves; else None.

    Raises:
        InputError: The ground is no image and scale, or another background is named.
    """
    from jblast.sensors.camera.surroundings import landscape, sun_at

    sun = None if asked.sun is None else sun_at(*asked.sun)
    sky = carried or asked.background == SKY or asked.ground is not None
    if sun is not None and (asked.background not in (None, SKY) or not sky):
        raise InputError(
            f"--sun: expected --background {SKY} or --ground with it, got "
            f"{'neither' if asked.background is None else repr(asked.background)}"
        )
    if asked.background not in (None, SKY):
        if asked.ground is not None:
            raise InputError(
                f"--ground: expected no --background but {SKY} with it, got "
                f"{asked.background!r}"
            )
        return None
    if asked.ground is None:
        return landscape(sun=sun) if sky else None
    name, colon, scale = asked.ground.rpartition(":")
    try:
        metres = float(scale)
    except ValueError:
        metres = math.nan
    if not (colon and name and 0.0 < metres < math.inf):
        raise InputError(
            "--ground: expected IMAGE.png:METRES_PER_PIXEL, as field.png:0.05, got "
            f"{asked.ground!r}"
        )
    return landscape(read_colours(Path(name)), metres, sun=sun)


def still_landscape(ground: "Landscape", camera: "Camera") -> np.ndarray:
    """Return what a camera that stands still sees of ground and sky."""
    import jax.numpy as jnp

    from jblast.sensors.camera.geometry import pixel_rays

    light = ground.light(pixel_rays(camera), 1.0 / jnp.max(camera.focal))
    return np.moveaxis(np.asarray(light), 0, -1)
