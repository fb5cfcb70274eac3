r"""The recipe of a set of views: directions, instants and framing.

A recipe is what the user asks for and what is chosen for the look. Lengths are
Blender's metre and have no meaning: pictures are scaled to the law's radius.

Directions are $n$ unit vectors towards east, north, up, none below the horizon. The
Fibonacci lattice turns by the golden angle from one to the next,

$$\phi_i = i\,\pi (3 - \sqrt 5), \qquad z_i = 1 - \frac{i + \epsilon}{n - \frac12 +
\epsilon}, \qquad i = 0 \dots n - 1$$

so that equal areas contain equal numbers. With $\epsilon = 1/2$ it is the plain one,
which is the upper half of Gonzalez' (2010) for the sphere; seen from above at radius
$\sqrt{1 - z}$ it is Vogel's golden spiral. Other $\epsilon$ move the first points away
from the pole, where the plain one is densest: Hardin, Michaels and Saff (2016) for the
sphere, with numbers by Roberts (2018), both second-hand. A spiral and a latitude grid
are included for comparison.

The packing distance of a set is the least angle between two of its directions. No $n$
points on the whole sphere are further apart than Fejes Toth's (1943) bound

$$\delta \le \arccos\frac{\cot^2\omega - 1}{2}, \qquad \omega = \frac{n}{n - 2}
\frac{\pi}{6}$$

which 3, 4, 6 and 12 points reach. On the hemisphere the caps of half that angle about
$n$ points may extend below the horizon, by no more than $\delta/2$; they do not
overlap, so that their area gives

$$n \left(1 - \cos\tfrac\delta2\right) \le 1 + \sin\tfrac\delta2$$

which none reaches: there is always room between caps.

Instants. A frame stands for a phase: time since the burst over the fireball's duration.
The law's radius grows with a time constant of a 258th of that (1 kg), so growth is over
when the fire has hardly begun. The simulation has as many steps as the eye needs, and a
table gives the phase of each step. Pictures are scaled to the law's radius, so that
only shapes come from the simulation.

Framing. Cameras are level and look at the burst. A view at elevation $e$ has it at the
share

$$a(e) = \tfrac12 + 0.36 \cos e$$

of its height from the top: low from the side, as the cloud rises, and in the middle
from above. A frame contains what reaches $\rho$ outwards and $z$ upwards if its side is
at least

$$s \ge \max\left(2 \rho, \frac{z \cos e + \rho \sin e}{a}, \frac{\rho \sin e}{1 - a}
\right)$$

for every elevation. The first frames are a little smaller than that, as the cells of
the simulation would show.
"""

import math
from functools import cache
from typing import Any, NamedTuple

import numpy as np
from jaxtyping import Float

from jblast.errors import InputError, argument, shown
from jblast.sensors.camera.bake.coding import (
    AIR_TEMPERATURE,
    REFERENCE_TEMPERATURE,
    WIEN,
)

ENGINES = ("cycles", "eevee")
SIZES, MOST_VIEWS = (16, 512), 512
"""Least and greatest side of a frame [px], and most views."""
STEPS = (1.0, 7.0, 14.0, 38.0, 60.0)
"""Steps of the simulation at which phases are given; ln phase is linear between."""
LAST = int(STEPS[-1])
"""Step with which the simulation ends."""
PHYSICS: dict[str, float | int] = {
    "last": LAST,
    "resolution": 64,
    "width": 3.7,
    "height": 4.4,
    "radius": 0.72,
    "lobes": 26,
    "grows": 6,
    "fuel": 1.6,
    "soot": 0.8,
    "heat": 2.0,
    "speed": 1.2,
    "puffs": 30,
    "dust": 0.35,
    "buoyancy": 1.8,
    "vorticity": 0.2,
    "burning_rate": 0.6,
    "flame_smoke": 1.5,
    "flame_vorticity": 0.5,
    "noise": 1.5,
}
"""Of the simulation. Chosen by eye."""
LOOK: dict[str, Any] = {
    "extinction": 60.0,
    "contrast": 0.5,
    "step": {"glow": 2.0, "shade": 3.0},
    "wien": WIEN,
    "reference_k": REFERENCE_TEMPERATURE,
    "air_k": AIR_TEMPERATURE,
    "span_k": REFERENCE_TEMPERATURE - AIR_TEMPERATURE,
}
"""Of the gas. Chosen by eye; `wien` and the temperatures are those of `coding`."""
LIGHT: dict[str, Any] = {"sky": 1.1, "sun": 24.0, "towards": [0.5, -0.6, 1.0]}
"""Of sky and sun. Light is scattered once, so that there has to be much of it."""
SAMPLES = {"glow": 3, "shade": 4}
"""Rays through a pixel in each of the two renderings."""
PHASES = (0.0004, 0.016, 0.08, 1.0, 3.5)
"""Phases of these steps: burst, growth over, fire in full, fire out, smoke."""
FADES = (0.85, 1.5)
"""Phases between which the last embers go out."""
LOWEST = 0.36
"""Distance of the burst below the middle, seen from the side, over the side [-]."""
ROOM = 1.04
"""Side of a picture over the least that holds the cloud [-]."""
MIN_SIDE = 0.4
"""Smallest side of a picture relative to the largest of the set [-]."""
GOLDEN_ANGLE = math.pi * (3.0 - math.sqrt(5.0))
"""Between one point of a Fibonacci lattice and the next, seen from above [rad]."""
PLAIN = 0.5
"""Offset from the pole of the plain Fibonacci lattice [points]."""
MAX_DIRECTIONS = 4096
"""Largest number of directions of a lattice; distances between all pairs are in
memory simultaneously.
"""
Directions = Float[np.ndarray, "view 3"]
"""Unit vectors towards east, north, up."""
OFFSETS = np.round(np.arange(0.0, 4.0001, 0.01), 2)
"""Offsets from the pole that are tried [points]."""


def fibonacci_lattice(number: int, offset: float = PLAIN) -> Directions:
    """Return a Fibonacci lattice on the upper hemisphere.

    Args:
        number: How many, 1 to `MAX_DIRECTIONS`.
        offset: How far the first stands from the pole, in points: 0 is the pole itself.

    Raises:
        InputError: The number is none of these, or the offset is negative.
    """
    index = _indices(number)
    if not 0.0 <= offset < math.inf:
        raise InputError(f"offset: expected 0 or more, got {shown(offset)}")
    height = 1.0 - (index + offset) / (number - 0.5 + offset)
    return _directions(GOLDEN_ANGLE * index, height)


def latitude_grid(number: int) -> Directions:
    """Return rings of equal distance in elevation, and of even steps in azimuth.

    What spherical coordinates suggest: as many in each ring, or one less, so that they
    crowd at the zenith. At the horizon a step in azimuth is as long as one in elevation
    with four times as many azimuths as rings.

    Args:
        number: How many, 1 to `MAX_DIRECTIONS`.

    Raises:
        InputError: The number is none of these.
    """
    index = _indices(number)
    rings = max(1, round(math.sqrt(number / 4.0)))
    azimuth, elevation = [], []
    for ring, members in enumerate(np.array_split(index, rings)):
        azimuth.append(np.arange(len(members)) * (2 * math.pi / len(members)))
        middle = (ring + 0.5) / rings * (math.pi / 2)
        elevation.append(np.full(len(members), middle))
    return _directions(np.concatenate(azimuth), np.sin(np.concatenate(elevation)))


def offset_lattice(number: int) -> Directions:
    """Return the Fibonacci lattice whose offset from the pole packs best."""
    return fibonacci_lattice(number, best_offset(number))


SAMPLINGS = {
    "fibonacci": fibonacci_lattice,
    "hardin": offset_lattice,
    "grid": latitude_grid,
}
"""Samplings of directions, by name."""


class Recipe(NamedTuple):
    """Parameters from which a set of views is made.

    Attributes:
        views: How many directions.
        frames: How many instants.
        size: Side of a frame [px].
        engine: Which of Blender's renderers, one of `ENGINES`.
        seed: Of the explosion's lobes, and of nothing else.
        sampling: How directions are spread, one of `SAMPLINGS`.
        physics: Of the simulation.
    """

    views: int = 32
    frames: int = 40
    size: int = 128
    engine: str = "cycles"
    seed: int = 0
    sampling: str = "hardin"
    physics: dict[str, float | int] = PHYSICS

    def checked(self) -> "Recipe":
        """Return the recipe.

        Raises:
            InputError: A number is outside what is possible, or a name is unknown.
        """
        timeline(self.frames)
        _between("views", self.views, 1, MOST_VIEWS)
        _between("size", self.size, *SIZES)
        for name, known in (("engine", ENGINES), ("sampling", tuple(SAMPLINGS))):
            if getattr(self, name) not in known:
                raise InputError(
                    f"{argument(name)}: expected one of {', '.join(known)}, got "
                    f"{shown(getattr(self, name))}"
                )
        return self

    def directions(self) -> Directions:
        """Return from where the explosion is seen."""
        return SAMPLINGS[self.sampling](self.views)

    def as_json(self) -> dict[str, Any]:
        """Return all that the pictures depend on."""
        asked = {k: v for k, v in self._asdict().items() if k != "physics"}
        chosen = {"physics": dict(self.physics), "look": LOOK, "light": LIGHT}
        return asked | chosen | {"samples": SAMPLES}


def differences(ours: Any, theirs: Any, where: str = "") -> list[str]:
    """Return what differs in two recipes, in words: `size 128, there 64`."""
    if isinstance(ours, dict) and isinstance(theirs, dict):
        keys = sorted(ours.keys() | theirs.keys())
        return [
            line
            for key in keys
            for line in differences(
                ours.get(key), theirs.get(key), f"{where}.{key}" if where else key
            )
        ]
    return [] if ours == theirs else [f"{where} {shown(ours)}, there {shown(theirs)}"]


def _between(name: str, value: int, least: int, most: int) -> None:
    if not least <= value <= most:
        raise InputError(
            f"{argument(name)}: expected {least} to {most}, got {shown(value)}"
        )


class Instant(NamedTuple):
    """A frame of a set.

    Attributes:
        step: Of the simulation, from 1.
        phase: Time since the burst over the fireball's duration.
        fade: Factor of its heat: embers go out at last.
    """

    step: int
    phase: float
    fade: float


def timeline(number: int) -> list[Instant]:
    """Return the instants of so many frames, at even steps of the simulation.

    Raises:
        InputError: There would be fewer than two, or more than there are steps.
    """
    if not 2 <= number <= LAST:
        raise InputError(
            f"{argument('frames')}: expected 2 to {LAST} frames, got {shown(number)}"
        )
    steps = np.rint(np.linspace(1, LAST, number)).astype(int)
    logs = np.interp(steps, STEPS, np.log(PHASES))
    out, gone = FADES
    return [
        Instant(
            step=int(step),
            phase=float(f"{math.exp(log):.4g}"),
            fade=min(1.0, max(0.0, (gone - math.exp(log)) / (gone - out))),
        )
        for step, log in zip(steps, logs, strict=True)
    ]


def anchor_share(elevation_deg: float) -> float:
    """Return how far down a picture the burst is, from 0 at the top to 1 [-]."""
    return 0.5 + LOWEST * math.cos(math.radians(elevation_deg))


def anchor_px(elevation_deg: float, size: int) -> tuple[float, float]:
    """Return where the burst is [px]: right and down from the first pixel's middle."""
    return size / 2 - 0.5, anchor_share(elevation_deg) * size - 0.5


def picture_sides(
    reach: Float[np.ndarray, " frame"],
    top: Float[np.ndarray, " frame"],
    elevation_deg: Float[np.ndarray, " view"],
) -> Float[np.ndarray, " frame"]:
    """Return the side of each frame, alike for all views, never less than before [m].

    Args:
        reach: How far the cloud is from the axis at most [m].
        top: How high it is at most [m].
        elevation_deg: Of the views.
    """
    angle = np.radians(elevation_deg)[:, None]
    share = 0.5 + LOWEST * np.cos(angle)
    above = (top * np.cos(angle) + reach * np.sin(angle)) / share
    below = reach * np.sin(angle) / (1.0 - share)
    least = np.maximum(2.0 * reach, np.maximum(above, below).max(axis=0))
    sides = ROOM * np.maximum(least, MIN_SIDE * least.max())
    return np.maximum.accumulate(sides)


def spiral_lattice(number: int) -> Directions:
    r"""Return Bauer's spiral on the upper hemisphere.

    It is the upper half of that of $2n$ points on the sphere: turns stand as far apart
    as points along them, $\phi = \sqrt{2 n \pi}\,\theta$, $z = 1 - (i + 1/2)/n$.

    Args:
        number: How many, 1 to `MAX_DIRECTIONS`.

    Raises:
        InputError: The number is none of these.

    References:
        Bauer (2000), as in Hardin, Michaels and Saff (2016), second-hand.
    """
    height = 1.0 - (_indices(number) + 0.5) / number
    return _directions(math.sqrt(2 * math.pi * number) * np.arccos(height), height)


def azimuth_elevation(
    direction: Directions,
) -> tuple[Float[np.ndarray, " view"], Float[np.ndarray, " view"]]:
    """Return azimuth, clockwise from north, 0 to 360, and elevation [deg]."""
    east, north, up = direction.T
    azimuth = np.degrees(np.arctan2(east, north)) % 360.0
    return azimuth, np.degrees(np.arctan2(up, np.hypot(east, north)))


def _indices(number: int) -> Float[np.ndarray, " view"]:
    if not 1 <= number <= MAX_DIRECTIONS:
        raise InputError(
            f"number: expected 1 to {MAX_DIRECTIONS} directions, got {shown(number)}"
        )
    return np.arange(number, dtype=float)


def _directions(
    azimuth: Float[np.ndarray, " view"], height: Float[np.ndarray, " view"]
) -> Directions:
    """Return unit vectors of azimuths, clockwise from north, and heights."""
    across = np.sqrt(1.0 - np.square(height))
    return np.stack(
        [across * np.sin(azimuth), across * np.cos(azimuth), height], axis=-1
    )


def packing_distance(direction: Directions) -> float:
    """Return the least angle between two of several directions [rad].

    By the chord, which resolves small angles where their cosine is rounded.

    Raises:
        InputError: There are fewer than two.
    """
    if len(direction) < 2:
        raise InputError(f"directions: expected two or more, got {len(direction)}")
    cosines = direction @ direction.T
    np.fill_diagonal(cosines, -np.inf)
    first, second = np.unravel_index(np.argmax(cosines), cosines.shape)
    chord = np.linalg.norm(direction[first] - direction[second])
    return 2.0 * math.asin(min(1.0, float(chord) / 2.0))


@cache
def best_offset(number: int) -> float:
    """Return at which offset a Fibonacci lattice of so many packs best, of `OFFSETS`.

    One direction alone is at no distance: the plain one's.
    """
    if number < 2:
        return PLAIN

    def distance(offset: float) -> float:
        return packing_distance(fibonacci_lattice(number, float(offset)))

    return float(max(OFFSETS, key=distance))


def sphere_bound(number: int) -> float:
    """Return what no packing of so many points on the whole sphere exceeds [rad].

    Raises:
        InputError: There are fewer than three.
    """
    if number < 3:
        raise InputError(f"number: expected three or more, got {shown(number)}")
    omega = number / (number - 2) * math.pi / 6
    return math.acos((1.0 / math.tan(omega) ** 2 - 1.0) / 2.0)


def hemisphere_bound(number: int) -> float:
    """Return what no packing of so many points on the hemisphere exceeds [rad].

    The area's bound, solved by bisection; two points are at most 180 degrees apart.
    """
    low, high = 0.0, math.pi
    for _ in range(60):
        middle = (low + high) / 2
        fits = number * (1 - math.cos(middle / 2)) <= 1 + math.sin(middle / 2)
        low, high = (middle, high) if fits else (low, middle)
    return high
