"""What looks like a flash and is none: lamps, cars, glints, shots, lightning, noise.

Each draws itself anew and returns what it adds to the light of a background at a time.
"""

from collections.abc import Callable

import numpy as np
from jaxtyping import Float

from jblast.verification.cases.flash.background import HEIGHT, WIDTH

Light = Float[np.ndarray, "height width"]
Disturbance = Callable[[float, Light], Light]
"""From the time [s] and the light behind to the light with it."""

_X, _Y = np.meshgrid(
    np.arange(WIDTH, dtype=np.float32), np.arange(HEIGHT, dtype=np.float32)
)


def _place(rng: np.random.Generator) -> tuple[float, float]:
    return rng.uniform(10, WIDTH - 10), rng.uniform(10, HEIGHT - 10)


def _disc(x: float, y: float, radius: float) -> Light:
    """Return how much of each pixel a disc covers, roughly."""
    away = np.hypot(_X - np.float32(x), _Y - np.float32(y))
    return np.clip(np.float32(radius + 0.5) - away, 0.0, 1.0)


def nothing(rng: np.random.Generator) -> Disturbance:
    """Return nothing: the camera and its noise alone."""
    return lambda time, behind: behind


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


def _add_spot(light: Light, bright: np.float32, x: float, y: float, r: float) -> None:
    """Add a small disc to an image in place."""
    left, top = max(int(x - r) - 1, 0), max(int(y - r) - 1, 0)
    bottom, right = max(int(y + r) + 3, 0), max(int(x + r) + 3, 0)
    here = np.s_[top:bottom, left:right]
    away = np.hypot(_X[here] - x, _Y[here] - y)
    light[here] += bright * np.clip(r - away + 0.5, 0.0, 1.0).astype(np.float32)


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
