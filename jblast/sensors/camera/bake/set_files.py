"""A set of views of an explosion as files: a sheet of frames a view, and an index."""

from pathlib import Path

import numpy as np
from jaxtyping import Float, UInt8

from jblast.errors import InputError
from jblast.files import replacing, write_text
from jblast.sensors.camera.bake.coding import (
    AIR_TEMPERATURE,
    REFERENCE_TEMPERATURE,
    columns_for,
    frames_of_sheet,
    sheet,
    sheet_layout,
)
from jblast.sensors.camera.bake.exr import Channels, read_exr
from jblast.sensors.camera.bake.framing import anchor_px
from jblast.sensors.camera.bake.passes import layers_of
from jblast.sensors.camera.bake.recipe import Recipe
from jblast.sensors.camera.bake.timeline import Instant
from jblast.sensors.camera.bake.visible_radius import visible_radius
from jblast.sensors.camera.files.view_index import INDEX
from jblast.sensors.camera.sampling.lattices import Directions, azimuth_elevation

MAKER = "jblast bake"
"""What an index says of who made it."""

LAYERS = ("glow", "shade")
"""Pictures of a frame: light of the gas itself, and of the sky."""

QUALITY, ALPHA_QUALITY, EFFORT = 88, 90, 4
"""Of WebP, lossy."""


def view_file(number: int) -> str:
    """Return the name of a view's file."""
    return f"{number:02d}.webp"


def write_view(path: Path, folder: Path, size: int, frames: int) -> None:
    """Write a view's sheet from its pictures.

    Args:
        path: What to write.
        folder: Holds `0000.glow.exr`, `0000.shade.exr` and so on.
        size: Side of a frame [px].
        frames: How many there are.

    Raises:
        InputError: A picture is not whole, or of another size; it is removed.
    """
    from PIL import Image

    tiles = []
    for index in range(frames):
        pictures = (folder / f"{index:04d}.{layer}.exr" for layer in LAYERS)
        tiles.append(layers_of(*(_picture(file, size) for file in pictures)))
    pixels = Image.fromarray(sheet(tiles, columns_for(frames)))
    with replacing(path) as temporary:
        pixels.save(
            temporary,
            format="WEBP",
            quality=QUALITY,
            alpha_quality=ALPHA_QUALITY,
            method=EFFORT,
        )


def _picture(path: Path, size: int) -> Channels:
    """Return a rendered picture; one that cannot be used goes, to be rendered again."""
    try:
        found = read_exr(path)
        missing = set("RGBA") - found.keys()
        if missing:
            raise InputError(f"{path}: expected channels R, G, B, A, got {set(found)}")
        if found["A"].shape != (size, size):
            height, width = found["A"].shape
            raise InputError(
                f"{path}: expected {size} x {size} pixels, got {width} x {height}"
            )
    except InputError:
        path.unlink(missing_ok=True)
        raise
    return found


def read_sheet(path: Path) -> UInt8[np.ndarray, "height width 4"]:
    """Return a view's sheet.

    Raises:
        InputError: It is no whole WebP picture with alpha.
    """
    from PIL import Image

    try:
        with Image.open(path, formats=["WEBP"]) as picture:
            return np.asarray(picture.convert("RGBA"))
    except (OSError, ValueError, SyntaxError, EOFError) as error:
        raise InputError(
            f"{path}: expected a whole WebP picture, but it cannot be read ({error})"
        ) from None


def is_whole_view(path: Path, size: int, frames: int) -> bool:
    """Return whether a view's file can be read and has the tiles it should have."""
    try:
        shape = read_sheet(path).shape[:2]
    except InputError:
        return False
    columns, rows = sheet_layout(shape, size)
    exact = (2 * rows * size, columns * size) == shape
    return exact and columns == columns_for(frames) and columns * rows >= frames


def write_index(
    out: Path,
    recipe: Recipe,
    instants: list[Instant],
    direction: Directions,
    sides: Float[np.ndarray, " frame"],
    version: str,
) -> None:
    """Write the index of a set whose views are there.

    Args:
        out: Its folder.
        recipe: What it was made from.
        instants: Of the frames.
        direction: From where each view sees it.
        sides: Of each frame [Blender's metre].
        version: Of Blender.
    """
    phases = ", ".join(f"{instant.phase:g}" for instant in instants)
    physics = ", ".join(f"{key} = {value}" for key, value in recipe.physics.items())
    lines = [
        "# Views of an explosion; `jblast bake` made them.",
        'kind = "explosion"',
        f"size_px = {recipe.size}",
        f"phases = [{phases}]",
        f"reference_temperature_k = {REFERENCE_TEMPERATURE}",
        f"air_temperature_k = {AIR_TEMPERATURE}",
        "",
        "[made]",
        f'by = "{MAKER}"',
        f'blender = "{version}"',
        f'engine = "{recipe.engine}"',
        'solver = "Mantaflow"',
        f"seed = {recipe.seed}",
        f'sampling = "{recipe.sampling}"',
        f"physics = {{ {physics} }}",
        f"sides = [{', '.join(f'{side:.4g}' for side in sides)}]",
        'licence = "CC0-1.0"',
    ]
    for number, (azimuth, elevation) in enumerate(
        zip(*azimuth_elevation(direction), strict=True)
    ):
        path = out / view_file(number)
        frames = frames_of_sheet(read_sheet(path), recipe.size, len(instants))
        radii = ", ".join(f"{visible_radius(frame.alpha):.2f}" for frame in frames)
        across, down = anchor_px(float(elevation), recipe.size)
        lines += [
            "",
            "[[view]]",
            f'file = "{view_file(number)}"',
            f"azimuth_deg = {azimuth:.4f}",
            f"elevation_deg = {elevation:.4f}",
            f"anchor_px = [{across:g}, {down:.3f}]",
            f"radius_px = [{radii}]",
        ]
    write_text(out / INDEX, "\n".join(lines) + "\n")
