"""What carries the camera of `jblast render`, and what stands behind its fire."""

import argparse
import math
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from jblast.errors import InputError

if TYPE_CHECKING:
    from jblast.scene import Camera, UncertainScene
    from jblast.sensors.camera.geometry.camera_path import CameraPath
    from jblast.sensors.camera.rendering.landscape import Landscape

SKY = "sky"
"""Word for `--background`: ground and sky."""


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
        from jblast.sensors.camera.files.camera_path import read_camera_path

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
    from jblast.sensors.camera.geometry.camera_path import CameraPath
    from jblast.study.flights.draws import checked_scene, drawn_scenes
    from jblast.study.flights.duration import flight_seconds
    from jblast.study.flights.fly import fly
    from jblast.study.flights.records import Options
    from jblast.study.flights.statistics import trajectory_of

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
    from jblast.sensors.camera.rendering.landscape import landscape
    from jblast.sensors.camera.rendering.sun import sun_at

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
    from jblast.sensors.camera.files.frames import read_colours

    return landscape(read_colours(Path(name)), metres, sun=sun)


def still_landscape(ground: "Landscape", camera: "Camera") -> np.ndarray:
    """Return what a camera that stands still sees of ground and sky."""
    import jax.numpy as jnp

    from jblast.sensors.camera.geometry.pixel_rays import pixel_rays

    light = ground.light(pixel_rays(camera), 1.0 / jnp.max(camera.focal))
    return np.moveaxis(np.asarray(light), 0, -1)
