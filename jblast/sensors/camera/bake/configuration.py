"""What the scripts that Blender runs are to do, as JSON can hold it."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from jblast.sensors.camera.bake.framing import anchor_share
from jblast.sensors.camera.bake.recipe import LIGHT, LOOK, SAMPLES, Recipe
from jblast.sensors.camera.bake.timeline import Instant
from jblast.sensors.camera.sampling.lattices import Directions, azimuth_elevation

COLDEST = 0.05
"""Least heat that is taken for hot: what is left when all has mixed with air glows no
more [of the simulation's unit]."""


def simulation_settings(
    recipe: Recipe, instants: Sequence[Instant], work: Path
) -> dict[str, Any]:
    """Return what `simulate.py` reads.

    Args:
        recipe: What the set is made from.
        instants: Frames of which is to be written down how far they reach.
        work: Where the cache, the scene and what was found go.
    """
    work = work.resolve()
    return {
        "physics": recipe.physics,
        "seed": recipe.seed,
        "cache": str(work / "cache"),
        "blend": str(work / "baked.blend"),
        "baked": str(work / "baked.json"),
        "frames": [instant.step for instant in instants],
    }


def rendering_settings(
    recipe: Recipe,
    instants: Sequence[Instant],
    hot: Sequence[float],
    sides: Sequence[float],
    direction: Directions,
    folders: dict[int, Path],
) -> dict[str, Any]:
    """Return what `render_views.py` reads.

    Args:
        recipe: What the set is made from.
        instants: Of the frames.
        hot: How hot each is.
        sides: How much of the world each holds [Blender's metre].
        direction: From where each view of the set sees it.
        folders: Of the views that are to be rendered, by their number.
    """
    azimuth, elevation = (angle.tolist() for angle in azimuth_elevation(direction))
    return {
        "engine": recipe.engine,
        "size": recipe.size,
        "samples": SAMPLES,
        "look": LOOK,
        "light": LIGHT,
        "frames": [
            {
                "frame": instant.step,
                "hot": max(warmth, COLDEST),
                "fade": instant.fade,
                "extinction": LOOK["extinction"],
                "scale": float(side),
            }
            for instant, warmth, side in zip(instants, hot, sides, strict=True)
        ],
        "views": [
            {
                "folder": str(folder.resolve()),
                "azimuth": azimuth[number],
                "elevation": elevation[number],
                "anchor": anchor_share(elevation[number]),
            }
            for number, folder in folders.items()
        ],
    }
