"""Sequences with a blast: a fireball as the renderer has it, before a texture.

Charges of 1 kg to 1 t, so far away that the fireball ends with a given radius in the
image. It is the law's smooth ball, on the ground, which hides its lower half, or in the
air; or the explosion of a set of pictures, on the ground, from any side and from up to
30 degrees above. On the ground its light falls on what is behind, below the horizon.
"""

from typing import NamedTuple

import jax.numpy as jnp
import numpy as np
from jaxtyping import Float, UInt8

from jblast.scene import Camera, Charge, Scene, look_at
from jblast.sensors.camera.baked_explosion import ExplosionViews
from jblast.sensors.camera.image import luminance
from jblast.sensors.camera.rendering import render
from jblast.verification.cases.flash.background import (
    HEIGHT,
    RATE_HZ,
    WIDTH,
    Background,
    ImageSensor,
    random_background,
)
from jblast.waves.fireball import LARGEST_RADIUS

FOCAL = 140.0
"""Of the camera: a field of view of 60 degrees across [px]."""
LEAD = 30
"""Frames before that of the first light, at 1,000 a second."""
SECONDS = 0.04
"""Filmed after the burst."""
STEEPEST = np.radians(30.0)
"""From which a camera looks down on the pictures of an explosion [rad]."""


class BlastFilm(NamedTuple):
    """A sequence with a blast, and what is true of it.

    Attributes:
        times: Of the frames, from the first on [s].
        frames: Linear grey values of 8 bits.
        burst_s: When it went off [s].
        first: Number of the first frame that shows it.
        charge_kg: TNT.
        range_m: From the camera.
        radius_px: Of the fireball when it has grown.
        pixel: Where the burst is in the first frame that shows it (x, y).
        in_air: Whether no ground hides its lower half.
    """

    times: Float[np.ndarray, " frame"]
    frames: UInt8[np.ndarray, "frame height width"]
    burst_s: float
    first: int
    charge_kg: float
    range_m: float
    radius_px: float
    pixel: tuple[float, float]
    in_air: bool


def blast(
    seed: int,
    *,
    charge_kg: float | None = None,
    radius_px: float | None = None,
    rate_hz: float = RATE_HZ,
    moving: float = 0.7,
    drift: float | None = None,
    sensor: ImageSensor | None = None,
    pictures: ExplosionViews | None = None,
    filmed_s: float = SECONDS,
) -> BlastFilm:
    """Return a sequence with a blast.

    Args:
        seed: Another seed is another scene.
        charge_kg: By default log-uniform from 1 to 1,000 [kg].
        radius_px: By default log-uniform from 10 to 50 [px].
        rate_hz: Frames a second [Hz].
        moving: Probability that the camera moves.
        drift: How fast the image moves sideways, and nothing else of it [px/s]; by
            default as it is drawn.
        sensor: Whose noise it has; by default the usual one's.
        pictures: Of an explosion, in place of the law's ball.
        filmed_s: Filmed after the burst [s].
    """
    rng = np.random.default_rng([99, seed])
    drawn = 10 ** rng.uniform(0.0, 3.0), 10 * 5 ** rng.uniform(0.0, 1.0)
    charge_kg = drawn[0] if charge_kg is None else charge_kg
    radius_px = drawn[1] if radius_px is None else radius_px
    sine = radius_px / np.hypot(FOCAL, radius_px)
    away = LARGEST_RADIUS * charge_kg ** (1 / 3) / sine
    across = rng.uniform(20, WIDTH - 20) - 0.5 * (WIDTH - 1)
    down = rng.uniform(25, HEIGHT - 15) - 0.5 * (HEIGHT - 1)
    in_air = bool(rng.random() < 0.5)
    behind = random_background(rng, moving=moving)
    if drift is not None:
        behind = Background(behind.texture, drift=(drift, 0.0))
    # so far into its interval does the burst come
    lead = round(LEAD * rate_hz / RATE_HZ)
    burst = (lead + rng.uniform(0.0, 1.0)) / rate_hz
    count = round(filmed_s * rate_hz)
    times = np.arange(lead + 1 + count) / rate_hz
    round_it, above = 0.0, 0.0
    if pictures is not None:
        in_air = False
        round_it, above = rng.uniform(-np.pi, np.pi), rng.uniform(0.0, STEEPEST)
    charge = Charge(
        mass_kg=charge_kg, position_m=(0.0, 0.0, 2.0 * away if in_air else 0.0)
    )
    camera = _camera(charge, away, (round_it, above), (across, down))
    layers = _layers(charge, camera, pictures, times[lead + 1 :] - burst)
    sensor = ImageSensor() if sensor is None else sensor
    frames = [sensor.seen(rng, behind.light(float(t))) for t in times[: lead + 1]]
    start = np.array(behind.moved(burst))
    for time, layer in zip(times[lead + 1 :], layers, strict=True):
        # the camera's motion moves it as it moves the rest
        dx, dy = np.array(behind.moved(float(time))) - start
        light, alpha = _moved(layer, dx, dy)
        frames.append(sensor.seen(rng, light + (1 - alpha) * behind.light(float(time))))
    pixel = 0.5 * (WIDTH - 1) + across, 0.5 * (HEIGHT - 1) + down
    return BlastFilm(
        times,
        np.stack(frames),
        burst,
        lead + 1,
        charge_kg,
        away,
        radius_px,
        (float(pixel[0]), float(pixel[1])),
        in_air,
    )


def _camera(
    charge: Charge, away: float, side: tuple[float, float], pixel: tuple[float, float]
) -> Camera:
    """Return a level camera, its principal point where it has to be.

    Args:
        charge: What it looks at.
        away: How far that is, level [m].
        side: From where: angle around it from the south, and above the horizon [rad].
        pixel: Where the charge is seen, from the middle of the image (x, y).
    """
    around, above = side
    place = np.asarray(charge.position_m, float)
    ahead = np.array([np.sin(around), np.cos(around), 0.0])
    up = max(away * np.tan(above), 0.0 if place[2] else 1.5)
    eye = place - away * ahead + np.array([0.0, 0.0, up])
    x, y = pixel
    middle = 0.5 * (WIDTH - 1) + x, 0.5 * (HEIGHT - 1) + y - FOCAL * up / away
    return Camera(
        position=eye,
        quaternion=look_at(eye, eye + ahead),
        focal=np.array([FOCAL, FOCAL]),
        center=np.array(middle),
        width=WIDTH,
        height=HEIGHT,
    )


def _layers(
    charge: Charge,
    camera: Camera,
    pictures: ExplosionViews | None,
    since: Float[np.ndarray, " frame"],
) -> Float[np.ndarray, "frame 2 height width"]:
    """Return grey light times alpha, and alpha; below 0 where the fire lights more."""
    scene = Scene(charge=charge)
    before_black, before_white = (
        luminance(
            np.asarray(
                render(
                    scene,
                    camera,
                    jnp.asarray(since),
                    background=behind,
                    ground=pictures is None,
                    views=pictures,
                ),
                np.float32,
            )
        )
        for behind in (0.0, 1.0)
    )
    return np.stack([before_black, 1.0 - (before_white - before_black)], axis=1)


def _moved(
    layer: Float[np.ndarray, "2 height width"], dx: float, dy: float
) -> Float[np.ndarray, "2 height width"]:
    """Return a layer moved right and down, linear between pixels."""
    i, j = int(np.floor(dy)), int(np.floor(dx))
    b, a = np.float32(dy - i), np.float32(dx - j)
    wide = np.pad(layer, ((0, 0), (1, 1), (1, 1)))
    across = (1 - a) * wide[:, :, 1:] + a * wide[:, :, :-1]
    moved = ((1 - b) * across[:, 1:] + b * across[:, :-1])[:, :HEIGHT, :WIDTH]
    out = np.zeros_like(layer)
    rows = slice(max(i, 0), min(HEIGHT + i, HEIGHT))
    columns = slice(max(j, 0), min(WIDTH + j, WIDTH))
    if rows.start < rows.stop and columns.start < columns.stop:
        out[:, rows, columns] = moved[
            :,
            rows.start - i : rows.stop - i,
            columns.start - j : columns.stop - j,
        ]
    return out
