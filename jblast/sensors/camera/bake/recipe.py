"""What a set of views is made from: what was asked for, and what we chose for the look.

Lengths are Blender's metre and mean nothing: pictures are scaled to the law's radius.
"""

from typing import Any, NamedTuple

from jblast.errors import InputError, argument, shown
from jblast.sensors.camera.bake.coding import (
    AIR_TEMPERATURE,
    REFERENCE_TEMPERATURE,
    WIEN,
)
from jblast.sensors.camera.bake.timeline import LAST, timeline
from jblast.sensors.camera.sampling.lattices import (
    Directions,
    fibonacci_lattice,
    latitude_grid,
)
from jblast.sensors.camera.sampling.packing import offset_lattice

SAMPLINGS = {
    "fibonacci": fibonacci_lattice,
    "hardin": offset_lattice,
    "grid": latitude_grid,
}
"""How directions are spread, by name."""

ENGINES = ("cycles", "eevee")
SIZES, MOST_VIEWS = (16, 512), 512
"""Least and greatest side of a frame [px], and most views."""

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


class Recipe(NamedTuple):
    """What a set of views is made from.

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
