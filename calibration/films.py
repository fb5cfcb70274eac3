"""Films for comparing detectors of flashes: blasts and lookalikes.

Blasts are fireballs of the renderer in front of a texture that moves with the camera.
Charges are 1 kg to 1 t, at distances where the final fireball has a given radius in the
image. The fireball is either the law's smooth ball, in the air or on the ground (which
hides its lower half), or a rendered explosion on the ground, from any side and from up
to 30 degrees above. On the ground its light falls on the background below the horizon.

Lookalikes are lamps, cars, glints, shots, lightning and noise. Each draws parameters
and returns the light in front of a background at a time, from four primitives: discs,
glare, rectangles and a gain over time. The ranges of the parameters are set by hand to
cover everyday scenes; none is fitted.
"""

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import NamedTuple

import jax.numpy as jnp
import numpy as np
from jaxtyping import Float, UInt8
from scipy.ndimage import map_coordinates, shift

from jblast.scene import Camera, Charge, Scene, look_at
from jblast.sensors.camera.explosion import ExplosionViews
from jblast.sensors.camera.image import luminance
from jblast.sensors.camera.rendering import render
from jblast.waves.fireballs import LARGEST_RADIUS

FOCAL = 140.0
"""Focal length [px]: a horizontal field of view of 60 degrees."""
# Detectors need some frames to estimate noise and motion.
LEAD = 30
"""Frames before the first light, at 1,000 frames/s."""
# Twice the longest accepted delay of a detection.
FILMED_S = 0.04
"""Duration of the film behind the burst [s]."""
STEEPEST = np.radians(30.0)
"""Largest elevation of the camera above a rendered explosion [rad]."""
# Long enough for several flashes of one source, and for mains flicker.
SECONDS = 0.3
"""Duration of a sequence without a blast [s]."""
Sequence = tuple[Float[np.ndarray, " frame"], UInt8[np.ndarray, "frame height width"]]
Light = Float[np.ndarray, "height width"]
Disturbance = Callable[[float, Light], Light]
"""Function from the time [s] and the light of the background to the light with it."""
# A quarter of VGA in each direction: thousands of sequences are simulated.
WIDTH, HEIGHT = 160, 120
"""Size of the image [px]."""
_X, _Y = np.meshgrid(
    np.arange(WIDTH, dtype=np.float32), np.arange(HEIGHT, dtype=np.float32)
)
RATE_HZ = 1000.0
"""Frame rate [Hz]."""
# Three image widths, so that a moving camera does not see the same part twice.
SIZE = 512
"""Size of the periodic texture [px]."""


class BlastFilm(NamedTuple):
    """A sequence with a blast, and its truth.

    Attributes:
        times: Times of the frames, from the first on [s].
        frames: Linear grey values of 8 bits.
        burst_s: Time of the burst [s].
        first: Number of the first frame with light of the burst.
        charge_kg: Mass of TNT [kg].
        range_m: Distance from the camera [m].
        radius_px: Final radius of the fireball [px].
        pixel: Position of the burst in frame `first` (x, y) [px].
    """

    times: Float[np.ndarray, " frame"]
    frames: UInt8[np.ndarray, "frame height width"]
    burst_s: float
    first: int
    charge_kg: float
    range_m: float
    radius_px: float
    pixel: tuple[float, float]


def seen(
    rng: np.random.Generator,
    light: Light,
    dark: float = 0.008,
    full: float = 2e-4,
    hot: float = 1e-4,
) -> UInt8[np.ndarray, "height width"]:
    """Return light with noise, as linear grey values of 8 bits.

    Args:
        rng: Random generator.
        light: Light, 1 at full scale.
        dark: Standard deviation in the dark.
        full: Additional variance at full light.
        hot: Share of hot pixels, each of which flashes 10 times a second.
    """
    spread = np.sqrt(dark**2 + full * np.maximum(light, 0.0))
    noise = rng.standard_normal(light.shape, np.float32)
    grey = light + spread * noise
    sparks = rng.poisson(hot * light.size * 10.0 / RATE_HZ)
    if sparks:
        rows, columns = (rng.integers(n, size=sparks) for n in light.shape)
        grey[rows, columns] = 1.0
    return np.rint(255.0 * np.clip(grey, 0.0, 1.0)).astype(np.uint8)


def blast(
    seed: int,
    *,
    radius_px: float | None = None,
    drift: float | None = None,
    pictures: ExplosionViews | None = None,
    filmed_s: float = FILMED_S,
) -> BlastFilm:
    """Return a sequence with a blast.

    Args:
        seed: Seed of the scene.
        radius_px: Final radius [px]; by default log-uniform from 10 to 50.
        drift: Speed of a purely sideways motion of the image [px/s]; by default the
            motion is random.
        pictures: Views of an explosion, in place of the ball of the law.
        filmed_s: Duration of the film behind the burst [s].
    """
    # 99 separates these seeds from those of `negative`, which begin with the kind
    rng = np.random.default_rng([99, seed])
    # drawn in any case, so that a given radius changes nothing else
    charge_kg, drawn_px = 10 ** rng.uniform(0.0, 3.0), 10 * 5 ** rng.uniform(0.0, 1.0)
    radius_px = drawn_px if radius_px is None else radius_px
    sine = radius_px / np.hypot(FOCAL, radius_px)
    distance = LARGEST_RADIUS * charge_kg ** (1 / 3) / sine
    across = rng.uniform(20, WIDTH - 20) - 0.5 * (WIDTH - 1)
    down = rng.uniform(25, HEIGHT - 15) - 0.5 * (HEIGHT - 1)
    in_air = bool(rng.random() < 0.5)
    behind = random_background(rng)
    if drift is not None:
        behind = Background(behind.texture, drift=(drift, 0.0))
    # the burst has a random phase within its frame
    burst = (LEAD + rng.uniform(0.0, 1.0)) / RATE_HZ
    times = np.arange(LEAD + 1 + round(filmed_s * RATE_HZ)) / RATE_HZ
    azimuth, elevation = 0.0, 0.0
    if pictures is not None:
        in_air = False
        azimuth, elevation = rng.uniform(-np.pi, np.pi), rng.uniform(0.0, STEEPEST)
    charge = Charge(
        mass_kg=charge_kg, position_m=(0.0, 0.0, 2.0 * distance if in_air else 0.0)
    )
    camera = _camera(charge, distance, (azimuth, elevation), (across, down))
    layers = _layers(charge, camera, pictures, times[LEAD + 1 :] - burst)
    frames = [seen(rng, behind.light(float(t))) for t in times[: LEAD + 1]]
    start = np.array(behind.moved(burst))
    for time, layer in zip(times[LEAD + 1 :], layers, strict=True):
        # the motion of the camera moves the fireball together with the background
        dx, dy = np.array(behind.moved(float(time))) - start
        light, alpha = shift(layer, (0, dy, dx), order=1, mode="grid-constant")
        frames.append(seen(rng, light + (1 - alpha) * behind.light(float(time))))
    pixel = 0.5 * (WIDTH - 1) + across, 0.5 * (HEIGHT - 1) + down
    return BlastFilm(
        times,
        np.stack(frames),
        burst,
        LEAD + 1,
        charge_kg,
        distance,
        radius_px,
        (float(pixel[0]), float(pixel[1])),
    )


def _camera(
    charge: Charge,
    distance: float,
    side: tuple[float, float],
    pixel: tuple[float, float],
) -> Camera:
    """Return a level camera with a shifted principal point.

    Args:
        charge: Target of the camera.
        distance: Horizontal distance [m].
        side: Azimuth from the south and elevation of the camera [rad].
        pixel: Position of the charge from the centre of the image (x, y) [px].
    """
    azimuth, elevation = side
    target = np.asarray(charge.position_m, float)
    ahead = np.array([np.sin(azimuth), np.cos(azimuth), 0.0])
    # on the ground, eye level; in the air, the height of the charge
    up = max(distance * np.tan(elevation), 0.0 if target[2] else 1.5)
    eye = target - distance * ahead + np.array([0.0, 0.0, up])
    x, y = pixel
    middle = 0.5 * (WIDTH - 1) + x, 0.5 * (HEIGHT - 1) + y - FOCAL * up / distance
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
    """Return grey light times alpha, and alpha, for each frame.

    Alpha is negative where the fire adds light to the background.
    """

    def before(background: float) -> np.ndarray:
        seen = render(
            Scene(charge),
            camera,
            jnp.asarray(since),
            background=background,
            views=pictures,
        )
        return luminance(np.asarray(seen, np.float32))

    # light = a + (1 - alpha) x background: two backgrounds give both unknowns
    before_black, before_white = before(0.0), before(1.0)
    return np.stack([before_black, 1.0 - (before_white - before_black)], axis=1)


def _place(rng: np.random.Generator) -> tuple[float, float]:
    return rng.uniform(10, WIDTH - 10), rng.uniform(10, HEIGHT - 10)


def _disc(x: float, y: float, radius: float) -> Light:
    """Return the approximate coverage of each pixel by a disc, 0 to 1."""
    distance = np.hypot(_X - np.float32(x), _Y - np.float32(y))
    return np.clip(np.float32(radius + 0.5) - distance, 0.0, 1.0)


def _glare(x: float, y: float, reach: float) -> Light:
    """Return a bell about a place, 1 there and 1/e at the reach."""
    return np.exp(-((_X - x) ** 2 + (_Y - y) ** 2) / reach**2)


def _box(left: float, top: float, width: float, height: float) -> Light:
    """Return the coverage of each pixel by a rectangle, 0 to 1."""
    across = np.clip(_X - left + 0.5, 0, 1) * np.clip(left + width - _X + 0.5, 0, 1)
    above = across * np.clip(_Y - top + 0.5, 0, 1)
    return above * np.clip(top + height - _Y + 0.5, 0, 1)


def _added(shape: Light, power: Callable[[float], float]) -> Disturbance:
    """Return a source of light with a power over time."""
    return lambda time, behind: behind + np.float32(power(time)) * shape


def _gained(shape: Light, gain: Callable[[float], float]) -> Disturbance:
    """Return more light on the scene, by a gain over time."""
    return lambda time, behind: behind * (1.0 + np.float32(gain(time)) * shape)


def _spots(
    at: Callable[[float], Iterable[tuple[float, float, float, float]]],
) -> Disturbance:
    """Return discs by their light, columns, rows and radii at a time."""

    def lit(time: float, behind: Light) -> Light:
        for bright, x, y, radius in at(time):
            behind = behind + np.float32(bright) * _disc(x, y, radius)
        return behind

    return lit


def _heated(age: float, rise: float) -> float:
    """Return the share of a lamp's light: at once for diodes, slower for filaments."""
    share = 1.0 if rise == 0.0 else -np.expm1(-age / rise)
    # the light of a filament is about the cube of its share of the temperature
    return share**3


def car(rng: np.random.Generator) -> Disturbance:
    """Return a passing car, brighter or darker than the background, some with lamps."""
    length, height = rng.uniform(15, 90), rng.uniform(6, 40)
    y, sense = rng.uniform(0, HEIGHT - 10), rng.choice([-1.0, 1.0])
    speed = sense * rng.uniform(30, 500)
    begin = rng.uniform(-60, WIDTH) if rng.random() < 0.5 else 0.0
    begin = begin if begin else (-length if sense > 0 else WIDTH)
    paint = rng.uniform(0.02, 1.0)
    windows = rng.uniform(0.3, 1.5)
    lamp = rng.uniform(1.0, 4.0) if rng.random() < 0.5 else 0.0

    def passing(time: float, behind: Light) -> Light:
        left = begin + speed * time
        upper = (y + 0.4 * height > _Y) & (
            np.abs(_X - left - 0.5 * length) < 0.3 * length
        )
        body = np.where(upper, np.float32(paint * windows), np.float32(paint))
        light = behind + _box(left, y, length, height) * (body - behind)
        if lamp:
            nose = left + length if sense > 0 else left
            light = light + 3.0 * _disc(nose, y + 0.7 * height, lamp)
        return light

    return passing


def glints(rng: np.random.Generator) -> Disturbance:
    """Return the sun on water or chrome: moving spots that last 1 to 20 ms."""
    count = rng.integers(3, 60)
    x0, y0 = _place(rng)
    spread = rng.uniform(3, 50)
    xs, ys = rng.normal(x0, spread, count), rng.normal(y0, 0.4 * spread, count)
    starts, lives = rng.uniform(0.0, 0.3, count), rng.uniform(1e-3, 20e-3, count)
    sizes = rng.uniform(0.3, 3.0, count)
    u, v = rng.normal(0.0, 150.0, (2, count))

    def sparkling(time: float):
        for i in np.flatnonzero((time >= starts) & (time < starts + lives)):
            age = time - starts[i]
            bright = 4.0 * np.sin(np.pi * age / lives[i])
            yield bright, xs[i] + u[i] * age, ys[i] + v[i] * age, sizes[i]

    return _spots(sparkling)


def lamps(rng: np.random.Generator) -> Disturbance:
    """Return one or two lamps with glare that are switched on; some are pulsed.

    A diode has its full light immediately, a filament within 20 to 100 ms. Pulses have
    a period of 2 to 10 ms and a duty cycle of one half.
    """
    x, y = _place(rng)
    radius, on = rng.uniform(0.5, 8.0), rng.uniform(0.05, 0.2)
    rise = 0.0 if rng.random() < 0.5 else rng.uniform(0.02, 0.1)
    power = 10 ** rng.uniform(-0.3, 1.5)
    glare = rng.uniform(0.0, 0.15)
    apart = rng.uniform(2.5, 8.0) * radius
    pulsed = rng.uniform(2e-3, 10e-3) if rng.random() < 0.3 else 0.0
    off = on + rng.uniform(0.03, 0.3)
    shape = np.zeros_like(_X)
    for a in (x, x + apart)[: rng.integers(1, 3)]:
        away = np.hypot(_X - a, _Y - y) / radius
        shape += _disc(a, y, radius) + glare / (1.0 + away**2)

    def lit(time: float) -> float:
        dark = not on <= time < off or (pulsed and (time - on) % pulsed > 0.5 * pulsed)
        return 0.0 if dark else power * _heated(time - on, rise)

    return _added(shape, lit)


def lightning(rng: np.random.Generator) -> Disturbance:
    """Return strokes that light the whole scene, brighter on one side."""
    count = rng.integers(1, 5)
    starts = rng.uniform(0.05, 0.25, count)
    falls = 10 ** rng.uniform(-3.3, -1.0, count)
    rises = 10 ** rng.uniform(-4.0, -2.3, count)
    gains = rng.uniform(0.2, 5.0, count)
    x, y = _place(rng)
    strokes = list(zip(starts, falls, rises, gains, strict=True))

    def struck(time: float) -> float:
        return sum(
            most * -np.expm1(-(time - start) / rise) * np.exp(-(time - start) / fall)
            for start, fall, rise, most in strokes
            if time >= start
        )

    return _gained(_glare(x, y, rng.uniform(40.0, 400.0)), struck)


def mains(rng: np.random.Generator) -> Disturbance:
    """Return mains lamps, which flicker at 100 or 120 Hz, over a part of the scene."""
    # Light follows the power, at twice the frequency of the mains.
    hz, depth = rng.choice([100.0, 120.0]), rng.uniform(0.1, 0.9)
    x, y = _place(rng)
    reach, phase = rng.uniform(5.0, 120.0), rng.uniform(0, 2 * np.pi)
    return _gained(
        _glare(x, y, reach), lambda t: depth * np.sin(2 * np.pi * hz * t + phase)
    )


def nothing(rng: np.random.Generator) -> Disturbance:
    """Return the background unchanged: the camera and its noise alone."""
    return lambda time, behind: behind


def shots(rng: np.random.Generator) -> Disturbance:
    """Return muzzle flashes: full within 1 ms, over after 1 to 5 ms."""
    count = rng.integers(1, 5)
    x, y = _place(rng)
    starts = rng.uniform(0.05, 0.25, count)
    lives, sizes = rng.uniform(1e-3, 5e-3, count), rng.uniform(2.0, 14.0, count)
    rise = rng.uniform(0.2e-3, 1e-3)

    def flashing(time: float):
        for start, life, size in zip(starts, lives, sizes, strict=True):
            age = time - start
            if 0.0 <= age < life:
                yield 5.0 * np.exp(-1.5 * age / life), x, y, size * min(age / rise, 1.0)

    return _spots(flashing)


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
"""Lookalikes by name; `negative` gives "noise" a sensor several times worse."""
KINDS = tuple(LOOKALIKES)


def negative(kind: str, seed: int) -> Sequence:
    """Return times [s] and linear grey frames of 8 bits without a blast.

    Args:
        kind: One of `KINDS`.
        seed: Seed of the scene.
    """
    # With the kind in the seed, scenes of two kinds do not share their numbers.
    rng = np.random.default_rng([KINDS.index(kind), seed])
    behind = random_background(rng, moving=1.0 if kind == "ego-motion" else 0.7)
    sensor: tuple[float, ...] = ()
    if kind == "noise":
        worse = rng.uniform(1.0, 5.0)
        sensor = 0.008 * worse, 2e-4 * worse**2, 10 ** rng.uniform(-4, -2)
    disturbance = LOOKALIKES[kind](rng)
    times = np.arange(round(SECONDS * RATE_HZ)) / RATE_HZ
    frames = [
        seen(rng, disturbance(float(t), behind.light(float(t))), *sensor) for t in times
    ]
    return times, np.stack(frames)


def texture(
    rng: np.random.Generator, mean: float, contrast: float, fineness: float = 1.2
) -> Float[np.ndarray, "size size"]:
    """Return a random texture with the spectrum of natural scenes, about 1/f.

    Args:
        rng: Random generator.
        mean: Mean of the light.
        contrast: Standard deviation of ln(light).
        fineness: Exponent of the fall of amplitudes with frequency.
    """
    f = np.fft.fftfreq(SIZE)
    size = np.hypot(f[:, None], f[None, : SIZE // 2 + 1])
    size[0, 0] = 1.0  # the mean is set below; zero would be divided by
    # the Gaussian damps detail of a few pixels, as the blur of a lens does
    amplitude = size**-fineness * np.exp(-((size / 0.35) ** 2))
    amplitude[0, 0] = 0.0
    white = np.fft.rfft2(rng.standard_normal((SIZE, SIZE)))
    field = np.fft.irfft2(white * amplitude, s=(SIZE, SIZE))
    field *= contrast / field.std()
    # The mean of a log-normal is exp(sd^2/2), which is divided out.
    return np.clip(mean * np.exp(field - 0.5 * contrast**2), 0.0, 1.5).astype(
        np.float32
    )


@dataclass(frozen=True)
class Background:
    """A texture and the motion of the image over it.

    Attributes:
        texture: Light, periodic.
        drift: Speed of the image (columns, rows) [px/s].
        shake: Amplitude of a vibration [px].
        shake_hz: Frequency of the vibration [Hz].
        roll: Rate of roll of the image [rad/s].
        jerk_s: Time of a knock on the camera; infinite for none [s].
        jerk: Change of the drift at the knock [px/s].
    """

    texture: Float[np.ndarray, "size size"]
    drift: tuple[float, float] = (0.0, 0.0)
    shake: float = 0.0
    shake_hz: float = 40.0
    roll: float = 0.0
    jerk_s: float = np.inf
    jerk: tuple[float, float] = (0.0, 0.0)

    def moved(self, time: float) -> tuple[float, float]:
        """Return the displacement of the background in the image (x, y) [px]."""
        wave = self.shake * np.sin(2.0 * np.pi * self.shake_hz * time)
        late = max(time - self.jerk_s, 0.0)
        across = self.drift[0] * time + self.jerk[0] * late
        down = self.drift[1] * time + self.jerk[1] * late
        return across + wave, down + 0.7 * wave

    def light(self, time: float) -> Float[np.ndarray, "height width"]:
        """Return the light of the background at a time [s]."""
        dx, dy = self.moved(time)
        c, s = np.cos(self.roll * time), np.sin(self.roll * time)
        x, y = _X - 0.5 * WIDTH, _Y - 0.5 * HEIGHT
        u, v = c * x + s * y + 0.5 * WIDTH - dx, c * y - s * x + 0.5 * HEIGHT - dy
        return map_coordinates(self.texture, (v, u), order=1, mode="grid-wrap")


def random_background(rng: np.random.Generator, *, moving: float = 0.7) -> Background:
    """Draw a background, by day or dusk, for a camera that mostly moves.

    Args:
        rng: Random generator.
        moving: Probability that the camera moves.
    """
    mean, contrast = rng.uniform(0.05, 0.45), rng.uniform(0.1, 0.6)
    light = texture(rng, mean, contrast, rng.uniform(1.0, 1.6))
    if rng.random() > moving:
        return Background(light)
    direction, speed = rng.uniform(0, 2 * np.pi), rng.uniform(0.0, 200.0)
    knock = rng.uniform(0, 2 * np.pi)
    return Background(
        light,
        drift=(speed * np.cos(direction), 0.5 * speed * np.sin(direction)),
        shake=rng.choice([0.0, rng.uniform(0.0, 0.6)]),
        shake_hz=rng.uniform(10.0, 120.0),
        roll=rng.choice([0.0, rng.uniform(-1.0, 1.0)]),
        jerk_s=rng.uniform(0.05, 0.25) if rng.random() < 0.3 else np.inf,
        jerk=(150.0 * np.cos(knock), 150.0 * np.sin(knock)),
    )
