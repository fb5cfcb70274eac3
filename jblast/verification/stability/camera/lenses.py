"""Where the formulas of a lens break: behind the camera, and past the fold."""

import jax.numpy as jnp
import numpy as np

from jblast.errors import InputError
from jblast.scene import Camera
from jblast.sensors.camera.geometry import fold_radius, project, unproject
from jblast.verification.stability.failure import FailureMode, verified

BARREL = (-0.3, 0.0, 0.0, 0.0, 0.0)
"""A wide lens's distortion, whose formula folds over inside the view."""


def lens_failures() -> list[FailureMode]:
    """Measure both."""
    return [behind_failure(), fold_failure()]


def wide_camera(distortion=BARREL) -> Camera:
    """Return a camera at the origin that looks north, 90 degrees wide and more."""
    return Camera(
        position=jnp.zeros(3),
        quaternion=jnp.array([-np.sqrt(0.5), 0.0, 0.0, np.sqrt(0.5)]),
        focal=jnp.full(2, 200.0),
        center=jnp.array([319.5, 239.5]),
        width=640,
        height=480,
        distortion=jnp.array(distortion),
    )


def behind_failure() -> FailureMode:
    """Measure what the pinhole's formula makes of a place behind the camera."""
    camera = wide_camera((0.0,) * 5)
    place = jnp.array([1.0, -5.0, 0.5])  # behind, to the right, above
    found = project(camera, place)
    (fx, fy), (cx, cy) = np.asarray(camera.focal), np.asarray(camera.center)
    x, y, z = 1.0, -0.5, -5.0
    ahead = project(camera, jnp.array([1.0, 5.0, 0.5]))
    seen = bool(ahead.seen) and not bool(found.seen)
    return FailureMode(
        area="events",
        method="pinhole projection x/z",
        failure="a place behind the camera has a pixel",
        boundary=0.0,
        unit="m ahead and less",
        beyond=f"5 m behind: pixel ({fx * x / z + cx:.0f}, {fy * y / z + cy:.0f}) of "
        "640 x 480, upside down",
        response=verified("marks", seen, "a place behind the camera"),
        message="seen false, and a finite pixel, so that gradients stay finite",
    )


def fold_failure() -> FailureMode:
    """Measure where the distortion of a wide lens folds over."""
    camera = wide_camera()
    edge = float(fold_radius(camera.distortion, jnp.array([1.0, 0.0])))
    out = 1.4 * edge
    bent = out * (1.0 + BARREL[0] * out**2)
    beyond = project(camera, jnp.array([out, 1.0, 0.0]))
    inside = project(camera, jnp.array([0.99 * edge, 1.0, 0.0]))
    most = edge * (1.0 + BARREL[0] * edge**2)
    refused = False
    try:
        unproject(camera, camera.center + jnp.array([200.0 * 1.01 * most, 0.0]))
    except InputError:
        refused = True
    seen = bool(inside.seen) and not bool(beyond.seen) and refused
    return FailureMode(
        area="events",
        method=f"lens distortion, k1 = {BARREL[0]:g}",
        failure="the formula folds over: two directions have one pixel",
        boundary=float(np.degrees(np.arctan(edge))),
        unit="degrees off the axis",
        beyond=f"{np.degrees(np.arctan(out)):.0f} degrees off the axis are put at "
        f"x = {bent:.2f}, inside the {most:.2f} of the fold",
        response=verified("marks", seen, "the fold"),
        message="seen false; unproject refuses a pixel past the fold",
    )
