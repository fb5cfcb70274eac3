"""Films for comparing detectors of flashes: blasts and lookalikes.

Blasts are fireballs of the renderer in front of a texture that moves with the camera.
Charges are 1 kg to 1 t, at distances where the final fireball has a given radius in the
image. The fireball is either the law's smooth ball, in the air or on the ground (which
hides its lower half), or a rendered explosion on the ground, from any side and from up
to 30 degrees above. On the ground its light falls on the background below the horizon.

Lookalikes are lamps, cars, glints, shots, lightning and noise. Each is drawn at random
and returns the light that it adds to a background at a time.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import NamedTuple

import jax.numpy as jnp
import numpy as np
from jaxtyping import Float, UInt8

from jblast.scene import Camera, Charge, Scene, look_at
from jblast.sensors.camera.baked_explosion import ExplosionViews
from jblast.sensors.camera.image import luminance
from jblast.sensors.camera.rendering import render
from jblast.waves.fireball import LARGEST_RADIUS

FOCAL = 140.0
"""Of the camera: a field of view of 60 degrees across [px]."""
LEAD = 30
"""Frames before that of the first light, at 1,000 a second."""
FILMED_S = 0.04
"""Filmed after the burst."""
STEEPEST = np.radians(30.0)
"""From which a camera looks down on the pictures of an explosion [rad]."""
SECONDS = 0.3
"""Of a sequence; what looks like a flash begins in it, once or several times."""
Sequence = tuple[Float[np.ndarray, " frame"], UInt8[np.ndarray, "frame height width"]]
Light = Float[np.ndarray, "height width"]
Disturbance = Callable[[float, Light], Light]
"""From the time [s] and the light behind to the light with it."""
WIDTH, HEIGHT = 160, 120
_X, _Y = np.meshgrid(
    np.arange(WIDTH, dtype=np.float32), np.arange(HEIGHT, dtype=np.float32)
)
RATE_HZ = 1000.0
"""Frames a second [Hz]."""
SIZE = 512
"""Of the texture, which repeats [px]."""


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


@dataclass(frozen=True)
class ImageSensor:
    """Noise of a sensor, its variance linear in the light.

    Attributes:
        dark: Standard deviation in the dark, of full scale.
        full: Variance that full light adds.
        hot: Share of pixels that spark now and then, each 10 times a second.
    """

    dark: float = 0.008
    full: float = 2e-4
    hot: float = 1e-4

    def seen(
        self, rng: np.random.Generator, light: Float[np.ndarray, "height width"]
    ) -> UInt8[np.ndarray, "height width"]:
        """Return light as grey values of 8 bits, linear."""
        spread = np.sqrt(self.dark**2 + self.full * np.maximum(light, 0.0))
        noise = rng.standard_normal(light.shape, np.float32)
        seen = light + spread * noise
        sparks = rng.poisson(self.hot * light.size * 10.0 / RATE_HZ)
        if sparks:
            seen[
                rng.integers(light.shape[0], size=sparks),
                rng.integers(light.shape[1], size=sparks),
            ] = 1.0
        return np.rint(255.0 * np.clip(seen, 0.0, 1.0)).astype(np.uint8)


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
    filmed_s: float = FILMED_S,
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


def car(rng: np.random.Generator) -> Disturbance:
    """Return a car that passes, brighter or darker than what is behind; some lit."""
    length, height = rng.uniform(15, 90), rng.uniform(6, 40)
    y, way = rng.uniform(0, HEIGHT - 10), rng.choice([-1.0, 1.0])
    speed = way * rng.uniform(30, 500)
    begin = rng.uniform(-60, WIDTH) if rng.random() < 0.5 else 0.0
    begin = begin if begin else (-length if way > 0 else WIDTH)
    paint = rng.uniform(0.02, 1.0)
    windows = rng.uniform(0.3, 1.5)
    lamp = rng.uniform(1.0, 4.0) if rng.random() < 0.5 else 0.0

    def passing(time: float, behind: Light) -> Light:
        left = begin + speed * time
        cover = np.clip(_X - left + 0.5, 0, 1) * np.clip(left + length - _X + 0.5, 0, 1)
        cover = (
            cover * np.clip(_Y - y + 0.5, 0, 1) * np.clip(y + height - _Y + 0.5, 0, 1)
        )
        upper = (y + 0.4 * height > _Y) & (
            np.abs(_X - left - 0.5 * length) < 0.3 * length
        )
        body = np.where(upper, np.float32(paint * windows), np.float32(paint))
        light = behind + cover * (body - behind)
        if lamp:
            nose = left + length if way > 0 else left
            light = light + 3.0 * _disc(nose, y + 0.7 * height, lamp)
        return light

    return passing


def glints(rng: np.random.Generator) -> Disturbance:
    """Return the sun on water or chrome: spots that come, move and go in 1 to 20 ms."""
    count = rng.integers(3, 60)
    x0, y0 = _place(rng)
    spread = rng.uniform(3, 50)
    xs, ys = rng.normal(x0, spread, count), rng.normal(y0, 0.4 * spread, count)
    starts, lives = rng.uniform(0.0, 0.3, count), rng.uniform(1e-3, 20e-3, count)
    sizes = rng.uniform(0.3, 3.0, count)
    speeds = rng.normal(0.0, 150.0, (2, count))

    def sparkling(time: float, behind: Light) -> Light:
        light = behind
        for i in np.flatnonzero((time >= starts) & (time < starts + lives)):
            age = time - starts[i]
            bright = 4.0 * np.sin(np.pi * age / lives[i])
            spot = _disc(
                xs[i] + speeds[0, i] * age, ys[i] + speeds[1, i] * age, sizes[i]
            )
            light = light + np.float32(bright) * spot
        return light

    return sparkling


def lamps(rng: np.random.Generator) -> Disturbance:
    """Return one or two lamps with a glare, switched on; some flicker by pulses.

    A diode is there at once, a filament within 20 to 100 ms; pulses last half of 2 to
    10 ms.
    """
    x, y = _place(rng)
    radius, on = rng.uniform(0.5, 8.0), rng.uniform(0.05, 0.2)
    rise = 0.0 if rng.random() < 0.5 else rng.uniform(0.02, 0.1)
    power = 10 ** rng.uniform(-0.3, 1.5)
    glare = rng.uniform(0.0, 0.15)
    apart = rng.uniform(2.5, 8.0) * radius
    pulsed = rng.uniform(2e-3, 10e-3) if rng.random() < 0.3 else 0.0
    off = on + rng.uniform(0.03, 0.3)
    centres = [(x, y), (x + apart, y)][: rng.integers(1, 3)]
    shape = np.zeros_like(_X)
    for a, b in centres:
        away = np.hypot(_X - a, _Y - b) / radius
        shape += _disc(a, b, radius) + glare / (1.0 + away**2)

    def lit(time: float, behind: Light) -> Light:
        if not on <= time < off or (pulsed and (time - on) % pulsed > 0.5 * pulsed):
            return behind
        share = 1.0 if rise == 0.0 else -np.expm1(-(time - on) / rise)
        return behind + np.float32(power * share**3) * shape

    return lit


def lightning(rng: np.random.Generator) -> Disturbance:
    """Return strokes, or a camera's flash: all of the scene, brighter on a side."""
    count = rng.integers(1, 5)
    starts = rng.uniform(0.05, 0.25, count)
    falls = 10 ** rng.uniform(-3.3, -1.0, count)
    rises = 10 ** rng.uniform(-4.0, -2.3, count)
    gains = rng.uniform(0.2, 5.0, count)
    x, y = _place(rng)
    reach = rng.uniform(40.0, 400.0)
    shape = np.exp(-((_X - x) ** 2 + (_Y - y) ** 2) / reach**2)

    def struck(time: float, behind: Light) -> Light:
        gain = 0.0
        for start, fall, rise, most in zip(starts, falls, rises, gains, strict=True):
            age = time - start
            if age >= 0.0:
                gain += most * -np.expm1(-age / rise) * np.exp(-age / fall)
        return behind * (1.0 + np.float32(gain) * shape)

    return struck


def mains(rng: np.random.Generator) -> Disturbance:
    """Return lamps of the mains, at 100 or 120 Hz, over a part of the scene."""
    hz, depth = rng.choice([100.0, 120.0]), rng.uniform(0.1, 0.9)
    x, y = _place(rng)
    reach, phase = rng.uniform(5.0, 120.0), rng.uniform(0, 2 * np.pi)
    shape = np.exp(-((_X - x) ** 2 + (_Y - y) ** 2) / reach**2)

    def humming(time: float, behind: Light) -> Light:
        wave = depth * np.sin(2 * np.pi * hz * time + phase)
        return behind * (1.0 + np.float32(wave) * shape)

    return humming


def nothing(rng: np.random.Generator) -> Disturbance:
    """Return nothing: the camera and its noise alone."""
    return lambda time, behind: behind


def shots(rng: np.random.Generator) -> Disturbance:
    """Return flashes like a muzzle's: whole within 1 ms, gone after 1 to 5 ms."""
    count = rng.integers(1, 5)
    x, y = _place(rng)
    starts = rng.uniform(0.05, 0.25, count)
    lives, sizes = rng.uniform(1e-3, 5e-3, count), rng.uniform(2.0, 14.0, count)
    rise = rng.uniform(0.2e-3, 1e-3)

    def flashing(time: float, behind: Light) -> Light:
        light = behind
        for start, life, size in zip(starts, lives, sizes, strict=True):
            age = time - start
            if 0.0 <= age < life:
                bright = 5.0 * np.exp(-1.5 * age / life)
                spot = _disc(x, y, size * min(age / rise, 1.0))
                light = light + np.float32(bright) * spot
        return light

    return flashing


LOOKALIKES: dict[str, Callable[[np.random.Generator], Disturbance]] = {
    "ego-motion": nothing,
    "noise": nothing,
    "lamps": lamps,
    "passing car": car,
    "sun glints": glints,
    "muzzle flashes": shots,
    "lightning": lightning,
    "mains lamps": mains,
}
"""By name; noise is a sensor several times worse, which `negatives` sees to."""
KINDS = tuple(LOOKALIKES)


def auto_exposure(rng: np.random.Generator) -> Disturbance:
    """Return an exposure that is changed in steps, or fast ramps, and a bright lamp."""
    edges = np.sort(rng.uniform(0.0, 0.3, rng.integers(1, 8)))
    gains = 2.0 ** np.cumsum(rng.uniform(-1.5, 1.5, len(edges) + 1))
    gains /= gains[0]
    ramp = rng.choice([0.0, rng.uniform(2e-3, 50e-3)])
    x, y = _place(rng)
    lamp = rng.uniform(0.0, 3.0) * _disc(x, y, rng.uniform(1.0, 12.0))

    def exposed(time: float, behind: Light) -> Light:
        at = int(np.searchsorted(edges, time))
        gain = gains[at]
        if at and ramp and time - edges[at - 1] < ramp:
            part = (time - edges[at - 1]) / ramp
            gain = gains[at - 1] * (gains[at] / gains[at - 1]) ** part
        return np.float32(gain) * (behind + lamp)

    return exposed


def balloon(rng: np.random.Generator) -> Disturbance:
    """Return a balloon that is blown up: its radius grows, its light stays as it is."""
    x, y = _place(rng)
    first, last = rng.uniform(1.0, 8.0), rng.uniform(12.0, 45.0)
    begin, lasts = rng.uniform(-0.1, 0.15), 10 ** rng.uniform(-1.3, 0.3)
    paint = rng.uniform(0.3, 1.0)
    power = rng.choice([1 / 3, 1 / 2, 1.0])  # by an even flow, or quicker
    shine = rng.uniform(0.0, 2.0)

    def growing(time: float, behind: Light) -> Light:
        part = np.clip((time - begin) / lasts, 0.0, 1.0) ** power
        radius = first + (last - first) * part
        if time < begin and begin > 0.0:
            return behind
        cover = _disc(x, y, radius)
        from_middle = np.hypot(_X - x, _Y - y) / radius
        body = paint * (1.0 - 0.5 * np.clip(from_middle, 0.0, 1.0) ** 2)
        light = behind + cover * (body.astype(np.float32) - behind)
        spot = _disc(x - 0.4 * radius, y - 0.4 * radius, 0.12 * radius)
        return light + np.float32(shine) * spot

    return growing


def camera_flash(rng: np.random.Generator) -> Disturbance:
    """Return a photographer's flash: a lamp in view, and the scene that it lights."""
    x, y = _place(rng)
    begin, lasts = rng.uniform(0.0, 0.25), 10 ** rng.uniform(-3.7, -2.3)
    power, gain = rng.uniform(5.0, 100.0), rng.uniform(0.1, 3.0)
    size, reach = rng.uniform(1.0, 5.0), rng.uniform(2.0, 15.0)
    glare = np.exp(-((_X - x) ** 2 + (_Y - y) ** 2) / reach**2)

    def flashed(time: float, behind: Light) -> Light:
        age = time - begin
        if age < 0.0:
            return behind
        share = np.float32(np.exp(-age / lasts))
        lamp = np.float32(power) * (_disc(x, y, size) + np.float32(0.03) * glare)
        return behind * (1.0 + np.float32(gain) * share) + share * lamp

    return flashed


def clouds(rng: np.random.Generator) -> Disturbance:
    """Return the edges of clouds' shadows that pass: light up to five times as much."""
    way, speed = rng.uniform(0, 2 * np.pi), rng.uniform(20.0, 600.0)
    soft, gain = rng.uniform(3.0, 40.0), rng.uniform(1.2, 5.0)
    length, phase = rng.uniform(60.0, 300.0), rng.uniform(0.0, 1.0)
    along = _X * np.cos(way) + _Y * np.sin(way)

    def passing(time: float, behind: Light) -> Light:
        place = ((along - speed * time) / length + phase) % 1.0
        edge = np.minimum(place, 1.0 - place) - 0.25
        share = 0.5 + 0.5 * np.tanh(edge * length / soft)
        return behind * (1.0 + (gain - 1.0) * share).astype(np.float32)

    return passing


def door(rng: np.random.Generator) -> Disturbance:
    """Return a door or blind that opens to daylight: a bright stripe that widens."""
    x, y = _place(rng)
    wide, high = rng.uniform(10, 60), rng.uniform(20, 90)
    begin, lasts = rng.uniform(0.0, 0.2), 10 ** rng.uniform(-1.3, 0.0)
    daylight, spill = rng.uniform(0.6, 5.0), rng.uniform(0.0, 0.5)
    both = rng.random() < 0.4  # a sliding door of two leaves, or curtains

    def opening(time: float, behind: Light) -> Light:
        part = np.clip((time - begin) / lasts, 0.0, 1.0)
        width = wide * part * (2.0 - part)
        if width == 0.0:
            return behind
        left = x - 0.5 * width if both else x
        cover = np.clip(_X - left + 0.5, 0, 1) * np.clip(left + width - _X + 0.5, 0, 1)
        top = y - 0.5 * high
        cover = cover * np.clip(_Y - top + 0.5, 0, 1)
        cover = cover * np.clip(top + high - _Y + 0.5, 0, 1)
        square = (_X - x) ** 2 + (_Y - y) ** 2
        gain = spill * width / wide * np.exp(-square / 60.0**2)
        light = behind * (1.0 + gain.astype(np.float32))
        return light + cover * (np.float32(daylight) - light)

    return opening


def glitter(rng: np.random.Generator) -> Disturbance:
    """Return the sun on waves: facets that flash all the time, from before the film.

    Each facet of a patch of water shows the sun for a few milliseconds whenever a wave
    turns it there; as many come as go (Cox and Munk 1954: a sea of independent slopes).
    """
    count = rng.integers(100, 1500)
    x0, y0 = _place(rng)
    spread = rng.uniform(10, 60)
    xs, ys = rng.normal(x0, spread, count), rng.normal(y0, 0.4 * spread, count)
    periods, lives = rng.uniform(0.1, 1.0, count), rng.uniform(3e-3, 40e-3, count)
    phases, sizes = rng.uniform(0.0, 1.0, count), rng.uniform(0.3, 1.5, count)
    powers = rng.uniform(1.0, 6.0, count)

    def sparkling(time: float, behind: Light) -> Light:
        light = behind.copy()
        ages = ((time / periods + phases) % 1.0) * periods
        for i in np.flatnonzero(ages < lives):
            bright = np.float32(powers[i] * np.sin(np.pi * ages[i] / lives[i]))
            _add_spot(light, bright, xs[i], ys[i], sizes[i])
        return light

    return sparkling


def headlights(rng: np.random.Generator) -> Disturbance:
    """Return a pair of headlights turned on: LED at once, filaments in 100 ms."""
    x, y = _place(rng)
    apart, size = rng.uniform(4.0, 40.0), rng.uniform(1.0, 6.0)
    begin, rise = rng.uniform(0.0, 0.2), rng.choice([0.0, rng.uniform(0.03, 0.15)])
    power, reach = rng.uniform(1.0, 30.0), rng.uniform(2.0, 12.0)
    shape = sum(
        _disc(c, y, size) + 0.05 * np.exp(-((_X - c) ** 2 + (_Y - y) ** 2) / reach**2)
        for c in (x - 0.5 * apart, x + 0.5 * apart)
    )

    def lit(time: float, behind: Light) -> Light:
        if time < begin:
            return behind
        share = 1.0 if rise == 0.0 else -np.expm1(-(time - begin) / rise)
        # a filament's light is about the cube of its share of the final temperature
        return behind + np.float32(power * share**3) * shape

    return lit


def welding(rng: np.random.Generator) -> Disturbance:
    """Return an arc that burns and goes out at random, with glare and sparks."""
    x, y = _place(rng)
    size, reach = rng.uniform(0.7, 3.0), rng.uniform(3.0, 25.0)
    power = rng.uniform(5.0, 60.0)
    edges = np.cumsum(rng.exponential(rng.uniform(3e-3, 60e-3), 400)) - 0.1
    flicker = rng.uniform(0.0, 0.6)
    hz, phase = rng.choice([100.0, 120.0, 300.0]), rng.uniform(0.0, 2 * np.pi)
    square = (_X - x) ** 2 + (_Y - y) ** 2
    shape = _disc(x, y, size) + 0.03 * np.exp(-square / reach**2)
    shape = shape + 0.3 / (1.0 + square / 36.0) / power
    count = 60
    angles, speeds = rng.uniform(0, 2 * np.pi, count), rng.uniform(50, 600, count)
    starts = rng.uniform(-0.1, 0.3, count)

    def burning(time: float, behind: Light) -> Light:
        if np.searchsorted(edges, time) % 2:
            return behind
        wave = 1.0 - flicker * (0.5 + 0.5 * np.sin(2 * np.pi * hz * time + phase))
        light = behind + np.float32(power * wave) * shape.astype(np.float32)
        for i in np.flatnonzero((time >= starts) & (time < starts + 0.05)):
            way = speeds[i] * (time - starts[i])
            at = x + way * np.cos(angles[i]), y + way * np.sin(angles[i])
            _add_spot(light, np.float32(2.0), *at, 0.6)
        return light

    return burning


EVERYDAY: dict[str, Callable[[np.random.Generator], Disturbance]] = {
    "sun glitter": glitter,
    "balloon": balloon,
    "headlights": headlights,
    "camera flash": camera_flash,
    "welding": welding,
    "door": door,
    "clouds": clouds,
    "auto exposure": auto_exposure,
}
"""By name: scenes that the test was not set by."""
OTHERS = tuple(EVERYDAY)
"""Kinds that the test was not set by."""


def negative(kind: str, seed: int, rate_hz: float = RATE_HZ) -> Sequence:
    """Return times [s] and linear grey frames of 8 bits without a blast.

    Args:
        kind: One of `KINDS` or `OTHERS`.
        seed: Another seed is another scene.
        rate_hz: Frames a second [Hz].
    """
    rng = np.random.default_rng([(KINDS + OTHERS).index(kind), seed])
    behind = random_background(rng, moving=1.0 if kind == "ego-motion" else 0.7)
    sensor = ImageSensor()
    if kind == "noise":
        worse = rng.uniform(1.0, 5.0)
        sensor = ImageSensor(0.008 * worse, 2e-4 * worse**2, 10 ** rng.uniform(-4, -2))
    disturbance = (LOOKALIKES | EVERYDAY)[kind](rng)
    times = np.arange(round(SECONDS * rate_hz)) / rate_hz
    frames = [
        sensor.seen(rng, disturbance(float(t), behind.light(float(t)))) for t in times
    ]
    return times, np.stack(frames)


def negatives(count: int, first: int = 0) -> Iterator[tuple[str, Sequence]]:
    """Return sequences of all kinds in turn, and what each is.

    Args:
        count: How many.
        first: Number of the first, so that work can be split.
    """
    for number in range(first, first + count):
        kind = KINDS[number % len(KINDS)]
        yield kind, negative(kind, number // len(KINDS))


def _place(rng: np.random.Generator) -> tuple[float, float]:
    return rng.uniform(10, WIDTH - 10), rng.uniform(10, HEIGHT - 10)


def _disc(x: float, y: float, radius: float) -> Light:
    """Return how much of each pixel a disc covers, roughly."""
    away = np.hypot(_X - np.float32(x), _Y - np.float32(y))
    return np.clip(np.float32(radius + 0.5) - away, 0.0, 1.0)


def _add_spot(light: Light, bright: np.float32, x: float, y: float, r: float) -> None:
    """Add a small disc to an image in place."""
    left, top = max(int(x - r) - 1, 0), max(int(y - r) - 1, 0)
    bottom, right = max(int(y + r) + 3, 0), max(int(x + r) + 3, 0)
    here = np.s_[top:bottom, left:right]
    away = np.hypot(_X[here] - x, _Y[here] - y)
    light[here] += bright * np.clip(r - away + 0.5, 0.0, 1.0).astype(np.float32)


def texture(
    rng: np.random.Generator, mean: float, contrast: float, fineness: float = 1.2
) -> Float[np.ndarray, "size size"]:
    """Return a random texture: the spectrum of natural scenes, about 1/f.

    Args:
        rng: Where chance comes from.
        mean: Of the light.
        contrast: Standard deviation of its logarithm.
        fineness: Exponent of the fall of amplitudes with frequency.
    """
    f = np.fft.fftfreq(SIZE)
    size = np.hypot(f[:, None], f[None, : SIZE // 2 + 1])
    size[0, 0] = 1.0
    amplitude = size**-fineness * np.exp(-((size / 0.35) ** 2))
    amplitude[0, 0] = 0.0
    white = np.fft.rfft2(rng.standard_normal((SIZE, SIZE)))
    field = np.fft.irfft2(white * amplitude, s=(SIZE, SIZE))
    field *= contrast / field.std()
    return np.clip(mean * np.exp(field - 0.5 * contrast**2), 0.0, 1.5).astype(
        np.float32
    )


@dataclass(frozen=True)
class Background:
    """A texture, and how the image moves over it.

    Attributes:
        texture: Light, repeating at its edges.
        drift: Columns and rows a second [px/s].
        shake: Amplitude of a vibration in both [px].
        shake_hz: Its frequency [Hz].
        roll: Turn of the image [rad/s].
        jerk_s: When the camera is knocked; infinite for never [s].
        jerk: By how much the drift changes then [px/s].
    """

    texture: Float[np.ndarray, "size size"]
    drift: tuple[float, float] = (0.0, 0.0)
    shake: float = 0.0
    shake_hz: float = 40.0
    roll: float = 0.0
    jerk_s: float = np.inf
    jerk: tuple[float, float] = (0.0, 0.0)

    def moved(self, time: float) -> tuple[float, float]:
        """Return how far what stands still has moved in the image [px]."""
        wave = self.shake * np.sin(2.0 * np.pi * self.shake_hz * time)
        late = max(time - self.jerk_s, 0.0)
        across = self.drift[0] * time + self.jerk[0] * late
        down = self.drift[1] * time + self.jerk[1] * late
        return across + wave, down + 0.7 * wave

    def light(self, time: float) -> Float[np.ndarray, "height width"]:
        """Return the light behind at an instant [s]."""
        dx, dy = self.moved(time)
        if self.roll == 0.0:
            return _shifted(self.texture, dx, dy)
        angle = self.roll * time
        x, y = np.meshgrid(
            np.arange(WIDTH, dtype=np.float32) - 0.5 * WIDTH,
            np.arange(HEIGHT, dtype=np.float32) - 0.5 * HEIGHT,
        )
        c, s = np.float32(np.cos(angle)), np.float32(np.sin(angle))
        u = c * x + s * y + np.float32(0.5 * WIDTH - dx)
        v = c * y - s * x + np.float32(0.5 * HEIGHT - dy)
        return _sampled(self.texture, u, v)


def _shifted(texture: np.ndarray, dx: float, dy: float) -> np.ndarray:
    """Return the texture's corner, moved right and down, linear between pixels."""
    left, top = int(np.floor(-dx)), int(np.floor(-dy))
    a, b = np.float32(-dx - left), np.float32(-dy - top)
    rows = (top + np.arange(HEIGHT + 1)) % SIZE
    columns = (left + np.arange(WIDTH + 1)) % SIZE
    part = texture[rows[:, None], columns]
    across = (1 - a) * part[:, :-1] + a * part[:, 1:]
    return (1 - b) * across[:-1] + b * across[1:]


def _sampled(texture: np.ndarray, u: np.ndarray, v: np.ndarray) -> np.ndarray:
    """Return the texture at columns and rows, linear between pixels."""
    left, top = np.floor(u), np.floor(v)
    a, b = u - left, v - top
    i, j = top.astype(np.int32) % SIZE, left.astype(np.int32) % SIZE
    k, m = (i + 1) % SIZE, (j + 1) % SIZE
    above = (1 - a) * texture[i, j] + a * texture[i, m]
    return (1 - b) * above + b * ((1 - a) * texture[k, j] + a * texture[k, m])


def random_background(rng: np.random.Generator, *, moving: float = 0.7) -> Background:
    """Draw a background, by day or dusk, before a camera that mostly moves.

    Args:
        rng: Where chance comes from.
        moving: Probability that it moves.
    """
    mean, contrast = rng.uniform(0.05, 0.45), rng.uniform(0.1, 0.6)
    made = texture(rng, mean, contrast, rng.uniform(1.0, 1.6))
    if rng.random() > moving:
        return Background(made)
    way, speed = rng.uniform(0, 2 * np.pi), rng.uniform(0.0, 200.0)
    knock = rng.uniform(0, 2 * np.pi)
    return Background(
        made,
        drift=(speed * np.cos(way), 0.5 * speed * np.sin(way)),
        shake=rng.choice([0.0, rng.uniform(0.0, 0.6)]),
        shake_hz=rng.uniform(10.0, 120.0),
        roll=rng.choice([0.0, rng.uniform(-1.0, 1.0)]),
        jerk_s=rng.uniform(0.05, 0.25) if rng.random() < 0.3 else np.inf,
        jerk=(150.0 * np.cos(knock), 150.0 * np.sin(knock)),
    )
