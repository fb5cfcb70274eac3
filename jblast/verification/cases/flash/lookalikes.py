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
