r"""The recipe of a set of views: directions, instants and framing.

A recipe contains the user's options and the constants of the look. Lengths are in
Blender's metre and have no meaning: pictures are scaled to the law's radius.

Directions are $n$ unit vectors towards east, north, up, none below the horizon. The
Fibonacci lattice turns by the golden angle from one to the next,

$$\phi_i = i\,\pi (3 - \sqrt 5), \qquad z_i = 1 - \frac{i + \epsilon}{n - \frac12 +
\epsilon}, \qquad i = 0 \dots n - 1$$

so that equal areas contain equal numbers. With $\epsilon = 1/2$ it is the plain one,
the upper half of Gonzalez' (2010) for the sphere; seen from above at radius
$\sqrt{1 - z}$ it is Vogel's golden spiral. Other $\epsilon$ shift the first points away
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

which no set reaches: there is always room between caps.

Instants. A frame has a phase: time since the burst over the fireball's duration. The
law's radius grows with a time constant of a 258th of that (1 kg), so growth is over
when the fire has hardly begun. The simulation has as many steps as the eye needs, and a
table states the phase of each step. Pictures are scaled to the law's radius, so that
only shapes come from the simulation.

Framing. Cameras are level and look at the burst. A view at elevation $e$ has it at the
share

$$a(e) = \tfrac12 + 0.36 \cos e$$

of its height from the top: low from the side, as the cloud rises, and in the middle
from above. A frame contains a cloud that extends $\rho$ outwards and $z$ upwards if its
side is at least

$$s \ge \max\left(2 \rho, \frac{z \cos e + \rho \sin e}{a}, \frac{\rho \sin e}{1 - a}
\right)$$

for every elevation. The side of the first frames has a minimum, because otherwise the
cells of the simulation would show.
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
"""Smallest and largest side of a frame [px], and largest number of views: a set of 512
views of 40 frames of 128 px takes 1.7 GB of memory."""
STEPS = (1.0, 7.0, 14.0, 38.0, 60.0)
"""Steps of the simulation for `PHASES`; ln phase is linear between them."""
LAST = int(STEPS[-1])
"""Last step of the simulation."""
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
"""Parameters of the simulation. Chosen by eye."""
LOOK: dict[str, Any] = {
    "extinction": 60.0,
    "contrast": 0.5,
    "step": {"glow": 2.0, "shade": 3.0},
    "wien": WIEN,
    "reference_k": REFERENCE_TEMPERATURE,
    "air_k": AIR_TEMPERATURE,
    "span_k": REFERENCE_TEMPERATURE - AIR_TEMPERATURE,
}
"""Parameters of the gas. Chosen by eye; `wien` and temperatures are from `coding`."""
LIGHT: dict[str, Any] = {"sky": 1.1, "sun": 24.0, "towards": [0.5, -0.6, 1.0]}
"""Strength of sky and sun, and its direction. Light is scattered only once, so that it
has to be strong."""
SAMPLES = {"glow": 3, "shade": 4}
"""Rays through a pixel in each of the two renderings. The time is proportional to them;
the noise that they leave in shade is averaged (`coding.SMOOTHED`)."""
PHASES = (0.0004, 0.016, 0.08, 1.0, 3.5)
"""Phases of these steps: burst, growth over, fire in full, fire out, smoke."""
FADES = (0.85, 1.5)
"""Phases between which the last embers fade. Chosen by eye."""
LOWEST = 0.36
"""Distance of the burst below the middle, seen from the side, over the side [-]. Chosen
by eye: the cloud rises above the burst, and only dust is below it."""
ROOM = 1.04
"""Side of a picture over the least that contains the cloud [-]: a margin of 2 % on each
side for gas thinner than the simulation's threshold."""
MIN_SIDE = 0.4
"""Smallest side of a picture relative to the largest of the set [-]. In a smaller one
the cells of the simulation would show."""
GOLDEN_ANGLE = math.pi * (3.0 - math.sqrt(5.0))
"""Azimuth between neighbours of a Fibonacci lattice, seen from above [rad]."""
PLAIN = 0.5
"""Offset from the pole of the plain Fibonacci lattice [points]."""
MAX_DIRECTIONS = 4096
"""Largest number of directions of a lattice: the distances between all pairs take 134
MB of memory."""
Directions = Float[np.ndarray, "view 3"]
"""Unit vectors towards east, north, up."""
OFFSETS = np.round(np.arange(0.0, 4.0001, 0.01), 2)
"""Trial offsets from the pole [points]: from the pole itself to four points away."""


def fibonacci_lattice(number: int, offset: float = PLAIN) -> Directions:
    """Return a Fibonacci lattice on the upper hemisphere.

    Args:
        number: Number of directions, 1 to `MAX_DIRECTIONS`.
        offset: Distance of the first direction from the pole, in points: 0 is the pole.

    Raises:
        InputError: The number is out of range, or the offset is negative.
    """
    index = _indices(number)
    if not 0.0 <= offset < math.inf:
        raise InputError(f"offset: expected 0 or more, got {shown(offset)}")
    height = 1.0 - (index + offset) / (number - 0.5 + offset)
    return _directions(GOLDEN_ANGLE * index, height)


def latitude_grid(number: int) -> Directions:
    """Return rings of equal distance in elevation, and of even steps in azimuth.

    This is the plain grid of spherical coordinates. Rings have equal numbers, or one
    less, so that directions are crowded at the zenith. At the horizon a step in azimuth
    is as long as one in elevation with four times as many azimuths as rings.

    Args:
        number: Number of directions, 1 to `MAX_DIRECTIONS`.

    Raises:
        InputError: The number is out of range.
    """
    index = _indices(number)
    # four times as many azimuths as rings: square cells at the horizon
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
        views: Number of directions.
        frames: Number of instants.
        size: Side of a frame [px].
        engine: Renderer of Blender, one of `ENGINES`.
        seed: Seed of the explosion's lobes, and of nothing else.
        sampling: Sampling of directions, one of `SAMPLINGS`.
        physics: Parameters of the simulation.
    """

    views: int = 32
    frames: int = 40
    size: int = 128
    engine: str = "cycles"
    seed: int = 0
    sampling: str = "hardin"
    physics: dict[str, float | int] = PHYSICS

    def checked(self) -> "Recipe":
        """Return the recipe itself.

        Raises:
            InputError: A number is out of range, or a name is unknown.
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
        """Return the directions from which the explosion is seen."""
        return SAMPLINGS[self.sampling](self.views)

    def as_json(self) -> dict[str, Any]:
        """Return everything on which the pictures depend."""
        options = {k: v for k, v in self._asdict().items() if k != "physics"}
        chosen = {"physics": dict(self.physics), "look": LOOK, "light": LIGHT}
        return options | chosen | {"samples": SAMPLES}


def differences(ours: Any, theirs: Any, where: str = "") -> list[str]:
    """Return the differences of two recipes as text: `size 128, there 64`."""
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
        step: Step of the simulation, from 1.
        phase: Time since the burst over the fireball's duration.
        fade: Factor of its heat, which lets embers fade at the end.
    """

    step: int
    phase: float
    fade: float


def timeline(number: int) -> list[Instant]:
    """Return the instants of a number of frames, at even steps of the simulation.

    Raises:
        InputError: The number is below two, or above the number of steps.
    """
    if not 2 <= number <= LAST:
        raise InputError(
            f"{argument('frames')}: expected 2 to {LAST} frames, got {shown(number)}"
        )
    # whole steps, because the simulation stores no others
    steps = np.rint(np.linspace(1, LAST, number)).astype(int)
    # phases span four decades
    logs = np.interp(steps, STEPS, np.log(PHASES))
    out, gone = FADES
    return [
        Instant(
            step=int(step),
            # four digits, as they are written to the index
            phase=float(f"{math.exp(log):.4g}"),
            fade=min(1.0, max(0.0, (gone - math.exp(log)) / (gone - out))),
        )
        for step, log in zip(steps, logs, strict=True)
    ]


def anchor_share(elevation_deg: float) -> float:
    """Return the burst's position in a picture, from 0 at the top to 1 [-]."""
    return 0.5 + LOWEST * math.cos(math.radians(elevation_deg))


def anchor_px(elevation_deg: float, size: int) -> tuple[float, float]:
    """Return the position of the burst [px], from the centre of the first pixel."""
    return size / 2 - 0.5, anchor_share(elevation_deg) * size - 0.5


def picture_sides(
    reach: Float[np.ndarray, " frame"],
    top: Float[np.ndarray, " frame"],
    elevation_deg: Float[np.ndarray, " view"],
) -> Float[np.ndarray, " frame"]:
    """Return the side of each frame, equal for all views, never decreasing [m].

    Args:
        reach: Largest distance of the cloud from the axis [m].
        top: Largest height of the cloud [m].
        elevation_deg: Elevations of the views.
    """
    # all views share one side per frame, so that they can be mixed
    angle = np.radians(elevation_deg)[:, None]
    share = 0.5 + LOWEST * np.cos(angle)
    above = (top * np.cos(angle) + reach * np.sin(angle)) / share
    below = reach * np.sin(angle) / (1.0 - share)
    least = np.maximum(2.0 * reach, np.maximum(above, below).max(axis=0))
    sides = ROOM * np.maximum(least, MIN_SIDE * least.max())
    # never smaller again: the scale of a picture must not jump back
    return np.maximum.accumulate(sides)


def spiral_lattice(number: int) -> Directions:
    r"""Return Bauer's spiral on the upper hemisphere.

    It is the upper half of that of $2n$ points on the sphere. Turns are as far apart as
    points along them: $\phi = \sqrt{2 n \pi}\,\theta$, $z = 1 - (i + 1/2)/n$.

    Args:
        number: Number of directions, 1 to `MAX_DIRECTIONS`.

    Raises:
        InputError: The number is out of range.

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
    """Return unit vectors for azimuths, clockwise from north, and heights."""
    across = np.sqrt(1.0 - np.square(height))
    return np.stack(
        [across * np.sin(azimuth), across * np.cos(azimuth), height], axis=-1
    )


def packing_distance(direction: Directions) -> float:
    """Return the smallest angle between two of several directions [rad].

    It is calculated from the chord, which resolves angles whose cosine rounds to 1.

    Raises:
        InputError: There are fewer than two.
    """
    if len(direction) < 2:
        raise InputError(f"directions: expected two or more, got {len(direction)}")
    cosines = direction @ direction.T
    # a direction's distance to itself does not count
    np.fill_diagonal(cosines, -np.inf)
    first, second = np.unravel_index(np.argmax(cosines), cosines.shape)
    # the nearest pair has the largest cosine; its angle comes from the chord
    chord = np.linalg.norm(direction[first] - direction[second])
    return 2.0 * math.asin(min(1.0, float(chord) / 2.0))


@cache
def best_offset(number: int) -> float:
    """Return the offset of `OFFSETS` at which a Fibonacci lattice packs best.

    A single direction has no distance: its offset is that of the plain lattice.
    """
    if number < 2:
        return PLAIN

    def distance(offset: float) -> float:
        return packing_distance(fibonacci_lattice(number, float(offset)))

    return float(max(OFFSETS, key=distance))


def sphere_bound(number: int) -> float:
    """Return the upper bound of the packing distance on the whole sphere [rad].

    Raises:
        InputError: There are fewer than three.
    """
    if number < 3:
        raise InputError(f"number: expected three or more, got {shown(number)}")
    omega = number / (number - 2) * math.pi / 6
    return math.acos((1.0 / math.tan(omega) ** 2 - 1.0) / 2.0)


def hemisphere_bound(number: int) -> float:
    """Return the upper bound of the packing distance on the hemisphere [rad].

    Area bound, solved by bisection; two points are at most 180 degrees apart.
    """
    low, high = 0.0, math.pi
    for _ in range(60):  # 60 halvings of pi: below the rounding of float64
        middle = (low + high) / 2
        fits = number * (1 - math.cos(middle / 2)) <= 1 + math.sin(middle / 2)
        low, high = (middle, high) if fits else (low, middle)
    return high
