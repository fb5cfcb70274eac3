r"""Pictures of an explosion from many directions, made by Blender.

    python -m calibration.bake --out SET [--views N] [--frames N] [--size PX]
        [--seed N] [--blender PATH]

Blender (3.4 or later) simulates an explosion on the ground with Mantaflow and renders
it by Cycles from each direction, without a background. `jblast render --views SET`
shows it. The same command continues an interrupted run: finished pictures and views
are kept, unfinished work is in `SET/.bake`. Two sets of one seed are similar, not
identical. How long it takes is in `results/bake_time.txt`.

Directions are $n$ unit vectors towards east, north, up, none below the horizon. The
Fibonacci lattice turns by the golden angle from one to the next,

$$\phi_i = i\,\pi (3 - \sqrt 5), \qquad z_i = 1 - \frac{i + \epsilon}{n - \frac12 +
\epsilon}, \qquad i = 0 \dots n - 1$$

so that equal areas contain equal numbers. With $\epsilon = 1/2$ it is the upper half of
Gonzalez' (2010) for the sphere. Other $\epsilon$ shift the first points away from the
pole, where the plain one is densest: Hardin, Michaels and Saff (2016), with numbers by
Roberts (2018), both second-hand. The one that packs best is used: the least angle
between two of 32 directions is 23.3 degrees, 22.3 with $\epsilon = 1/2$.

A frame has a phase: time since the burst over the fireball's duration. The law's radius
grows with a time constant of a 258th of that (1 kg), so growth is over when the fire
has hardly begun. The simulation has as many steps as the eye needs, and a table states
the phase of each step. Pictures are scaled to the law's radius, so that only shapes
come from the simulation. Lengths are in Blender's metre and have no meaning.

Cameras are level and look at the burst. A view at elevation $e$ has it at the share

$$a(e) = \tfrac12 + 0.36 \cos e$$

of its height from the top. A frame contains a cloud that extends $\rho$ outwards and
$z$ upwards if its side is at least

$$s \ge \max\left(2 \rho, \frac{z \cos e + \rho \sin e}{a}, \frac{\rho \sin e}{1 - a}
\right)$$

Blender renders a frame twice: gas that emits and absorbs, and gas that scatters the
light of the sky. Heat $h$ codes emitted light logarithmically, as a temperature $T_h =
T_a + h\,(T - T_a)$ does, with $T$ that of the fireball's law:

$$\frac{L}{L(T)} = \exp\left[w \left(1 - \frac{T}{T_h}\right)\right], \qquad w =
\frac{c_2}{\lambda T}$$

(Wien). With the $w$ used, this is a black body's relative luminance within 9 %, from
1100 K to the reference. A view's file is described in `camera/files/views.py`.

The visible radius of an explosion in a picture is $R = 2\,\sigma_x$, the spread of the
columns of its opaque pixels: the radius of a disc, and of half a disc on the ground,
since columns of both are as high as $\sqrt{R^2 - x^2}$, whose variance is $R^2/4$.
"""

import argparse
import json
import math
import shutil
import subprocess
import time
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from jaxtyping import Float, UInt8
from PIL import Image
from scipy.ndimage import gaussian_filter

from jblast.files import replacing, write_text
from jblast.sensors.camera.files.images import srgb_bytes
from jblast.sensors.camera.files.views import sheet_frames
from jblast.sensors.camera.image import LUMINANCE, srgb_to_linear

LAYERS = ("glow", "shade")
"""Pictures of a frame: light of the gas itself, and of the sky."""
QUALITY: dict[str, int] = {"quality": 88, "alpha_quality": 90, "method": 4}
"""Options of lossy WebP. Heat and opacity are data, so the quality is high; artefacts
in transparent parts are removed on reading (`views.FAINTEST`)."""
LOOK_S = 0.5
"""Interval between two looks for finished views [s]."""
COLDEST = 0.05
"""Smallest heat of a frame's hot gas [unit of the simulation]. Gas mixed with air has
less, and does not glow."""
REFERENCE_TEMPERATURE, AIR_TEMPERATURE = 2200.0, 288.15
"""Temperature of heat 1, that of the fireball's law at its start, and of heat 0 [K]."""
SPAN = REFERENCE_TEMPERATURE - AIR_TEMPERATURE
WIEN = 11.12
r"""$w$ at the reference temperature [-]: $\lambda$ = 588 nm, amid visible light."""
MIN_OPACITY = 1.0 / 255.0
"""Opacity up to which a pixel has no heat: one step of 8 bits."""
SMOOTHED = 1.1
"""Standard deviation of the average of shade [px]: its few rays leave noise. A larger
one would blur the lobes."""
OPAQUE = 0.5
"""Opacity from which a pixel belongs to the cloud [-]: dust that is swept over the
ground is mostly thinner."""
STEPS = (1.0, 7.0, 14.0, 38.0, 60.0)
"""Steps of the simulation for `PHASES`; ln phase is linear between them."""
PHASES = (0.0004, 0.016, 0.08, 1.0, 3.5)
"""Phases of these steps: burst, growth over, fire in full, fire out, smoke."""
FADES = (0.85, 1.5)
"""Phases between which the last embers fade. Chosen by eye, as the tables below."""
PHYSICS: dict[str, float | int] = {
    "last": int(STEPS[-1]),
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
LOOK: dict[str, Any] = {
    "extinction": 60.0,
    "contrast": 0.5,
    "step": {"glow": 2.0, "shade": 3.0},
    "wien": WIEN,
    "reference_k": REFERENCE_TEMPERATURE,
    "air_k": AIR_TEMPERATURE,
    "span_k": SPAN,
}
LIGHT: dict[str, Any] = {"sky": 1.1, "sun": 24.0, "towards": [0.5, -0.6, 1.0]}
"""Strength of sky and sun, and its direction. Light is scattered only once, so that it
has to be strong."""
SAMPLES = {"glow": 3, "shade": 4}
"""Rays through a pixel in each of the two renderings. The time is proportional to them;
the noise that they leave in shade is averaged (`SMOOTHED`)."""
LOWEST = 0.36
"""Distance of the burst below the middle, seen from the side, over the side [-]: the
cloud rises above the burst, and only dust is below it."""
ROOM = 1.04
"""Side of a picture over the least that contains the cloud [-]: a margin of 2 % on each
side for gas thinner than the simulation's threshold."""
MIN_SIDE = 0.4
"""Smallest side of a picture relative to the largest of the set [-]. In a smaller one
the cells of the simulation would show."""
GOLDEN_ANGLE = math.pi * (3.0 - math.sqrt(5.0))
"""Azimuth between neighbours of a Fibonacci lattice, seen from above [rad]."""
Directions = Float[np.ndarray, "view 3"]
"""Unit vectors towards east, north, up."""
Image4 = Float[np.ndarray, "height width 4"]


class Recipe(NamedTuple):
    """Parameters from which a set of views is made.

    Attributes:
        views: Number of directions.
        frames: Number of instants, at most one for each step of the simulation.
        size: Side of a frame [px].
        seed: Seed of the explosion's lobes, and of nothing else.
        physics: Parameters of the simulation.
    """

    views: int = 32
    frames: int = 40
    size: int = 128
    seed: int = 0
    physics: dict[str, float | int] = PHYSICS


def main() -> None:
    """Simulate, render and write the missing views."""
    parser = argparse.ArgumentParser(description="Bake views of an explosion.")
    parser.add_argument("--out", type=Path, required=True, help="folder of the set")
    for name in ("views", "frames", "size", "seed"):
        parser.add_argument(f"--{name}", type=int, default=getattr(Recipe(), name))
    parser.add_argument("--blender", default="blender", help="program")
    asked = vars(parser.parse_args())
    out, blender = asked.pop("out"), asked.pop("blender")
    bake(Recipe(**asked), out, blender)


def bake(recipe: Recipe, out: Path, blender: str) -> None:
    """Make the missing parts of a set.

    Args:
        recipe: The set.
        out: Its folder: new, or with an unfinished set of the same recipe.
        blender: Name or path of the program.

    Raises:
        SystemExit: The folder has a finished set or another one; or Blender failed.
    """
    work, ours = out / ".bake", json.dumps(recipe._asdict())
    kept = work / "recipe.json"
    if (out / "views.toml").exists() or (kept.exists() and kept.read_text() != ours):
        raise SystemExit(f"{out}: has another set; expected a new folder")
    work.mkdir(parents=True, exist_ok=True)
    write_text(kept, ours)
    version = subprocess.run([blender, "--version"], capture_output=True, text=True)
    instants, direction = timeline(recipe.frames), offset_lattice(recipe.views)
    files = [out / f"{number:02d}.webp" for number in range(recipe.views)]
    baked = work.resolve() / "baked.json"
    if not baked.exists():  # an incomplete simulation cannot be continued
        shutil.rmtree(work / "cache", ignore_errors=True)
        simulation = {
            "physics": recipe.physics,
            "seed": recipe.seed,
            "cache": str(baked.with_name("cache")),
            "blend": str(baked.with_suffix(".blend")),
            "baked": str(baked),
            "frames": [instant.step for instant in instants],
        }
        run_blender(blender, work, "blender_simulate", simulation)
    extents = json.loads(baked.read_text())
    reach, top = (np.array([e[key] for e in extents]) for key in ("reach", "top"))
    azimuth, elevation = azimuth_elevation(direction)
    sides = picture_sides(reach, top, elevation)
    folders = {
        number: work.resolve() / "frames" / f"{number:03d}"
        for number, file in enumerate(files)
        if not file.exists()
    }
    rendering = {
        "size": recipe.size,
        "samples": SAMPLES,
        "look": LOOK,
        "light": LIGHT,
        "frames": [
            {
                "frame": instant.step,
                "hot": max(extent["hot"], COLDEST),
                "fade": instant.fade,
                "extinction": LOOK["extinction"],
                "scale": float(side),
            }
            for instant, extent, side in zip(instants, extents, sides, strict=True)
        ],
        "views": [
            {
                "folder": str(folder),
                "azimuth": float(azimuth[number]),
                "elevation": float(elevation[number]),
                "anchor": anchor_share(elevation[number]),
            }
            for number, folder in folders.items()
        ],
    }
    run_blender(
        blender,
        work,
        "blender_render_views",
        rendering,
        lambda: pack(files, folders, recipe),
    )
    if folders:
        raise SystemExit(f"{work}/blender.log: Blender left out {len(folders)} views")
    write_index(out, recipe, direction, sides, version.stdout.partition("\n")[0])
    shutil.rmtree(work)


def run_blender(
    blender: str, work: Path, script: str, settings: dict[str, Any], update=lambda: None
) -> None:
    """Run a script in Blender, without a window, and wait for it.

    Args:
        blender: The program.
        work: Folder of unfinished files; Blender's output is added to its log.
        script: Name of a script beside this one.
        settings: Read by the script, which runs in a Python without jblast.
        update: Called while it runs, and once after it ends.

    Raises:
        SystemExit: It ended with an error.
    """
    path, blend = (work / f"{script}.json").resolve(), work.resolve() / "baked.blend"
    write_text(path, json.dumps(settings))
    source = Path(__file__).with_name(f"{script}.py")
    # without python-exit-code Blender ends with 0 after an error of the script
    command = [blender, "--background", "--python-exit-code", "3"]
    command += [] if script == "blender_simulate" else [str(blend)]
    command += ["--factory-startup", "--python", str(source), "--", str(path)]
    with (work / "blender.log").open("ab") as log:
        # Mantaflow writes a file of noise to the working directory
        process = subprocess.Popen(command, stdout=log, stderr=log, cwd=work)
        try:
            while process.poll() is None:
                update()
                time.sleep(LOOK_S)
        finally:
            process.kill()  # on an interruption; otherwise it has ended already
            process.wait()
    update()
    if process.returncode:
        raise SystemExit(
            f"{work}/blender.log: Blender ended with code {process.returncode}; the "
            "same command continues"
        )


def pack(files: list[Path], folders: dict[int, Path], recipe: Recipe) -> None:
    """Write each view whose pictures are complete; they take far more space."""
    for number, folder in list(folders.items()):
        if len(list(folder.glob("[0-9]*.exr"))) == recipe.frames * len(LAYERS):
            frames = [
                layers_of(
                    *(read_exr(folder / f"{i:04d}.{name}.exr") for name in LAYERS)
                )
                for i in range(recipe.frames)
            ]
            with replacing(files[number]) as temporary:
                pixels = Image.fromarray(sheet(frames, columns_for(recipe.frames)))
                pixels.save(temporary, format="WEBP", **QUALITY)
            shutil.rmtree(folder)
            del folders[number]
            print(f"{files[number]}, {len(folders)} views left", flush=True)


def read_exr(path: Path) -> Image4:
    """Return red, green, blue and opacity of a rendered picture, premultiplied."""
    import av  # extra `video`; a set of views is read without it

    with av.open(str(path)) as picture:
        return next(picture.decode(video=0)).to_ndarray().astype(float)


def write_index(
    out: Path,
    recipe: Recipe,
    direction: Directions,
    sides: Float[np.ndarray, " frame"],
    version: str,
) -> None:
    """Write the index of a set whose views are complete.

    Args:
        out: Folder of the set.
        recipe: Its recipe.
        direction: Directions of the views.
        sides: Side of each frame [Blender's metre].
        version: Of Blender.
    """
    phases = ", ".join(f"{instant.phase:g}" for instant in timeline(recipe.frames))
    physics = ", ".join(f"{key} = {value}" for key, value in recipe.physics.items())
    lines = [
        "# Views of an explosion; `python -m calibration.bake` made them.",
        'kind = "explosion"',
        f"size_px = {recipe.size}",
        f"phases = [{phases}]",
        f"reference_temperature_k = {REFERENCE_TEMPERATURE}",
        f"air_temperature_k = {AIR_TEMPERATURE}",
        "",
        "[made]",
        f'blender = "{version}"',
        f"seed = {recipe.seed}",
        f"physics = {{ {physics} }}",
        f"sides = [{', '.join(f'{side:.4g}' for side in sides)}]",
        'licence = "CC0-1.0"',
    ]
    for number, (azimuth, elevation) in enumerate(
        zip(*azimuth_elevation(direction), strict=True)
    ):
        file = f"{number:02d}.webp"
        frames = frames_of(out / file, recipe.size, recipe.frames)
        radii = ", ".join(f"{visible_radius(frame.alpha):.2f}" for frame in frames)
        # from the centre of the first pixel
        across, down = recipe.size / 2, anchor_share(elevation) * recipe.size
        lines += [
            "",
            "[[view]]",
            f'file = "{file}"',
            f"azimuth_deg = {azimuth:.4f}",
            f"elevation_deg = {elevation:.4f}",
            f"anchor_px = [{across - 0.5:g}, {down - 0.5:.3f}]",
            f"radius_px = [{radii}]",
        ]
    write_text(out / "views.toml", "\n".join(lines) + "\n")


class Layers(NamedTuple):
    """A frame of an explosion without background.

    Attributes:
        heat: Heat, 0 to 1.
        shade: Linear colour under the sky, straight, 0 to 1.
        alpha: Opacity, 0 to 1.
    """

    heat: Float[np.ndarray, "height width"]
    shade: Float[np.ndarray, "height width 3"]
    alpha: Float[np.ndarray, "height width"]


def layers_of(glow: Image4, shade: Image4) -> Layers:
    """Return a frame's layers.

    Opacity and heat come from the emitting gas, which has little noise. The colour
    under the sky is the light of the scattering gas over its own opacity, both averaged
    over neighbours.

    Args:
        glow: The emitting gas: premultiplied, linear.
        shade: Likewise the scattering gas.
    """
    alpha = np.clip(glow[..., 3], 0.0, 1.0)
    # premultiplied light over alpha: the mean source of the ray
    light = glow[..., :3] @ np.asarray(LUMINANCE) / np.maximum(alpha, MIN_OPACITY)
    # as far as 4 px
    smooth = gaussian_filter(shade, (SMOOTHED, SMOOTHED, 0), mode="constant", radius=4)
    # guards the division in empty pixels, which are transparent anyway
    colour = smooth[..., :3] / np.maximum(smooth[..., 3:], 1e-3)
    heat = np.where(alpha > MIN_OPACITY, heat_of_light(light), 0.0)
    return Layers(heat, np.clip(colour, 0.0, 1.0), alpha)


def heat_of_light(light: Float[np.ndarray, "..."]) -> Float[np.ndarray, "..."]:
    """Return the heat of light relative to the reference's, clipped to 0 to 1."""
    logs = np.log(np.maximum(light, 1e-30))  # any light this small is heat 0
    temperature = REFERENCE_TEMPERATURE / (1.0 - np.minimum(logs, 0.0) / WIEN)
    return np.clip((temperature - AIR_TEMPERATURE) / SPAN, 0.0, 1.0)


def sheet(frames: list[Layers], columns: int) -> UInt8[np.ndarray, "height width 4"]:
    """Return the two halves of a view's sheet; remaining tiles are empty.

    Args:
        frames: All of one size.
        columns: Tiles in a row.
    """
    size, rows = frames[0].alpha.shape[0], -(-len(frames) // columns)
    whole = np.zeros((2 * rows * size, columns * size, 4), np.uint8)
    whole[: rows * size, :, 3] = 255  # heat is opaque
    for number, (heat, shade, alpha) in enumerate(frames):
        top, left = (size * k for k in divmod(number, columns))
        upper = whole[top : top + size, left : left + size]
        upper[..., :3] = np.rint(255.0 * np.where(alpha > MIN_OPACITY, heat, 0.0))[
            ..., None
        ]
        layer = np.concatenate([shade, alpha[..., None]], axis=-1)
        lower = whole[rows * size + top :, left : left + size][:size]
        lower[...] = srgb_bytes(np.clip(layer, 0.0, 1.0))
    return whole


def frames_of(path: Path, size: int, number: int) -> list[Layers]:
    """Return the frames of a sheet, as they are shown.

    Args:
        path: The sheet.
        size: Side of a frame [px].
        number: Number of frames.
    """
    texels = sheet_frames(path, size, number) / 255.0
    heat, colour, alpha = texels[..., 0], texels[..., 1:4], texels[..., 4]
    frames = zip(heat, srgb_to_linear(colour), alpha, strict=True)
    return [Layers(*frame) for frame in frames]


def columns_for(number: int) -> int:
    """Return the tiles per row with which both halves together are about square."""
    return max(1, math.ceil(math.sqrt(2 * number)))


def visible_radius(alpha: Float[np.ndarray, "height width"]) -> float:
    """Return the radius of a silhouette [px]; 0 if nothing is opaque.

    The variance of pixel centres is increased by that within a pixel, 1/12.

    Args:
        alpha: Opacity of fire and smoke, 0 to 1.
    """
    # column sums: their spread is insensitive to a rim
    columns = (alpha > OPAQUE).sum(axis=0).astype(float)
    if not columns.any():
        return 0.0
    place = np.arange(len(columns))
    middle = np.average(place, weights=columns)
    variance = np.average(np.square(place - middle), weights=columns)
    return 2.0 * float(np.sqrt(variance + 1.0 / 12.0))


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
    """Return the instants of a number of frames, at even steps of the simulation."""
    # whole steps, because the simulation stores no others
    steps = np.rint(np.linspace(1, STEPS[-1], number)).astype(int)
    # phases span four decades; four digits, as they are written to the index
    phases = np.exp(np.interp(steps, STEPS, np.log(PHASES)))
    fades = np.interp(phases, FADES, (1.0, 0.0))
    return [
        Instant(int(step), float(f"{phase:.4g}"), float(fade))
        for step, phase, fade in zip(steps, phases, fades, strict=True)
    ]


def anchor_share(elevation_deg: float) -> float:
    """Return the burst's position in a picture, from 0 at the top to 1 [-]."""
    return 0.5 + LOWEST * math.cos(math.radians(elevation_deg))


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
    angle = np.radians(elevation_deg)[:, None]
    share = 0.5 + LOWEST * np.cos(angle)
    above = (top * np.cos(angle) + reach * np.sin(angle)) / share
    below = reach * np.sin(angle) / (1.0 - share)
    least = np.maximum(2.0 * reach, np.maximum(above, below).max(axis=0))
    sides = ROOM * np.maximum(least, MIN_SIDE * least.max())
    # never smaller again: the scale of a picture must not jump back
    return np.maximum.accumulate(sides)


def fibonacci_lattice(number: int, offset: float = 0.5) -> Directions:
    """Return a Fibonacci lattice on the upper hemisphere.

    Args:
        number: Number of directions.
        offset: Distance of the first direction from the pole, in points: 0 is the pole.
    """
    index = np.arange(number, dtype=float)
    height = 1.0 - (index + offset) / (number - 0.5 + offset)
    azimuth, across = GOLDEN_ANGLE * index, np.sqrt(1.0 - np.square(height))
    return np.stack(
        [across * np.sin(azimuth), across * np.cos(azimuth), height], axis=-1
    )


def offset_lattice(number: int) -> Directions:
    """Return the Fibonacci lattice whose offset from the pole packs best."""
    offsets = np.arange(0.0, 4.0001, 0.01)
    return max((fibonacci_lattice(number, x) for x in offsets), key=packing_distance)


def packing_distance(direction: Directions) -> float:
    """Return the smallest angle between two of several directions, at most 90 deg."""
    cosines = np.triu(direction @ direction.T, 1)
    return math.acos(min(1.0, float(cosines.max())))


def azimuth_elevation(
    direction: Directions,
) -> tuple[Float[np.ndarray, " view"], Float[np.ndarray, " view"]]:
    """Return azimuth, clockwise from north, 0 to 360, and elevation [deg]."""
    east, north, up = direction.T
    azimuth = np.degrees(np.arctan2(east, north)) % 360.0
    return azimuth, np.degrees(np.arctan2(up, np.hypot(east, north)))


if __name__ == "__main__":
    main()
