"""At which instants a film's light is looked at, so that events know their times.

Between two instants the logarithm of the light is taken for linear. An interval is
halved as long as its middle says that this moves events by more than a bound: where the
logarithm in the middle is d off, and changes by D over the length T, a crossing is
moved by d T / D, and by less than T in any case. Its halves must say so too: a jump
hides from one middle, if it stands against a slope, but not from the next.

That bounds the events of an ideal camera, whose levels are fixed. A pixel that is reset
takes its next reference from the light between two instants, and what the light is off
in a steep interval moves an event in a slow one: its light is bounded itself.
"""

import math
from collections import deque
from collections.abc import Iterator
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from jblast.scene import Camera
from jblast.sensors.camera.events.log_intensity import DARKEST
from jblast.sensors.camera.files.backgrounds import MovingBackground
from jblast.sensors.camera.film import Film
from jblast.sensors.camera.geometry.camera_path import CameraPath, pixels_moved
from jblast.waves.fireball import fireball_duration, fireball_growth_time

STAMP_ERROR = 1e-4
"""How far off the time of an event may be [s]: a fifth of the time that the
photoreceptor of our noisy camera takes, and of its refractory period."""

LIGHT_ERROR = 5e-4
"""How far off the logarithm of the light of a camera with resets may be, in thresholds:
found by trial, so that 99 in 100 of its events are within `STAMP_ERROR` too."""

JUMP = 1 / 16
"""Where light jumps, when it does is known to so much of the bound of times."""

LEFT = 0.01
"""Share of the events of an interval that may be farther off."""

PER_LIFE = 32
"""First instants over the time a fireball glows: what passes a pixel lasts longer."""

MOVED = 0.5
"""Pixels that the ground moves by between first instants, where a camera moves: so fine
patterns are not taken for still."""

BLOCK = 16
"""Instants of a block: few programs are compiled if all are alike."""

QUIET = 1e-3
"""Thresholds that all pixels together may pass in an interval where nothing happens."""

Block = tuple[Float[np.ndarray, " _"], Float[np.ndarray, "_ height width"]]


def first_instants(film: Film) -> Float[np.ndarray, " time"]:
    """Return the instants looked at first, from the first frame to the last [s].

    As many as the fireball's life asks for, close after a burst; those of the pictures
    where pictures stand for it, and those of a background that moves.
    """
    start, stop = float(film.times[0]), float(film.times[-1])
    charges = film.scene.charges
    bursts = np.array([float(charge.time_s) for charge in charges])
    masses = [charge.tnt_mass("fireball_radius_m") for charge in charges]
    step = min(float(fireball_duration(mass)) for mass in masses) / PER_LIFE
    found = [bursts]
    if film.views is None:
        for burst, mass in zip(bursts, masses, strict=True):
            growth = float(fireball_growth_time(mass))
            found.append(burst + growth * 0.25 * 2.0 ** np.arange(10))
    else:
        for burst, charge in zip(bursts, charges, strict=True):
            found.append(burst + film.views.instants(charge))
    if isinstance(film.background, MovingBackground):
        found.append(start + film.background.times)
    if film.path is not None:
        found.append(_moved_on(film.camera, film.path))
    even = np.linspace(start, stop, 1 + max(1, int(np.ceil((stop - start) / step))))
    inside = np.concatenate([even, *found])
    inside = np.unique(inside[(inside >= start) & (inside <= stop)])
    # two that rounding alone keeps apart are one
    apart = np.diff(inside, prepend=-np.inf) > 1e-9 * (stop - start)
    return inside[apart]


def _moved_on(camera: Camera, path: CameraPath) -> Float[np.ndarray, " time"]:
    """Return when the picture of the ground has moved on by another `MOVED` pixels."""
    moved = np.asarray(pixels_moved(camera, path), float)
    wanted = np.arange(0.0, moved[-1], MOVED)
    return np.interp(wanted, moved, np.asarray(path.time, float))


class Interval(NamedTuple):
    """An interval between two instants; with its middle, if that is enough.

    Attributes:
        times: Its ends, or its ends and its middle [s].
        light: At these.
        is_half: Whether it is a half of one that was found fine.
    """

    times: tuple[float, ...]
    light: tuple[Float[np.ndarray, "height width"], ...]
    is_half: bool = False


class _Bounds(NamedTuple):
    """What decides whether an interval is fine; see `subdivided`."""

    threshold: float
    time_s: float
    light: float


def subdivided(
    film: Film,
    threshold: float,
    bound_s: float = STAMP_ERROR,
    light_error: float = math.inf,
) -> Iterator[Block]:
    """Return times [s] and grey light of a film, close enough together for events.

    Blocks of `BLOCK` instants but for the last.

    Args:
        film: What is filmed; its exposure is left out.
        threshold: The smaller threshold: smaller changes give no events.
        bound_s: All but `LEFT` of an ideal camera's events are to be less than this
            off [s].
        light_error: How far off the logarithm of the light may be, for all but `LEFT`
            of its changes.
    """
    times: list[float] = []
    light: list[np.ndarray] = []
    for time, image in _instants(film, _Bounds(threshold, bound_s, light_error)):
        times.append(time)
        light.append(image)
        if len(times) == BLOCK:
            yield np.array(times), np.stack(light)
            times, light = [], []
    if times:
        yield np.array(times), np.stack(light)


def _instants(film: Film, bounds: _Bounds):
    """Return time and image of one instant after another."""
    knots = first_instants(film)
    last = knots[0], film.light(knots[:1])[0]
    yield last
    for begin in range(1, len(knots), BLOCK):
        part = knots[begin : begin + BLOCK]
        ends = [last, *zip(part, film.light(part), strict=True)]
        intervals = deque(
            Interval((a[0], b[0]), (a[1], b[1])) for a, b in pairwise(ends)
        )
        while intervals:
            while intervals and len(intervals[0].times) == 3:
                interval = intervals.popleft()
                yield interval.times[1], interval.light[1]
                yield interval.times[2], interval.light[2]
            _look_closer(intervals, film, bounds)
        last = ends[-1]


def _look_closer(intervals: deque[Interval], film: Film, bounds: _Bounds) -> None:
    """Look at middles of the first intervals that have none, and halve the bad ones."""
    front = [i for i, interval in enumerate(intervals) if len(interval.times) == 2][
        :BLOCK
    ]
    if not front:
        return
    middles = [0.5 * sum(intervals[i].times) for i in front]
    images = film.light(np.array(middles))
    for i, time, image in reversed(list(zip(front, middles, images, strict=True))):
        (start, stop), (before, after), is_half = intervals[i]
        light = before, image, after
        fine = _is_fine(stop - start, light, bounds)
        if fine and is_half:
            intervals[i] = Interval((start, time, stop), light)
        else:
            intervals[i] = Interval((time, stop), light[1:], fine)
            intervals.insert(i, Interval((start, time), light[:2], fine))


def _is_fine(length: float, light, bounds: _Bounds) -> bool:
    """Return whether an interval with its middle is fine enough."""
    before, middle, after = (np.log(np.maximum(image, DARKEST)) for image in light)
    passed = np.abs(middle - before) + np.abs(after - middle)
    if passed.sum() <= QUIET * bounds.threshold:
        return True
    off, bad = np.abs(middle - 0.5 * (before + after)), np.zeros(passed.shape, bool)
    if length > bounds.time_s:
        bad |= off * length > bounds.time_s * np.abs(after - before)
    if length > JUMP * bounds.time_s:
        # with its middle an interval is off by a quarter of that
        bad |= off > 4.0 * bounds.light
    return bool(passed[bad].sum() <= LEFT * passed.sum())
